#pragma once
#include "alight/base/time.h"
#include "alight/geometry/pose.h"

namespace alight {

/// Whether the LEDs that are followed are those of the drone that telemetry speaks of.
///
/// Another drone with the same LEDs looks like it, but leans otherwise: seen and told
/// lean differ by a constant, of how LEDs and thrust stand to one another in the
/// airframe, as long as it is the same drone. No clock, no allocation.
class LeanWatch {
 public:
  /// Another drone, or another flight.
  void forget() { *this = LeanWatch(); }
  /// Nothing was seen and told for a while: only what is usual stays known.
  void pause() { last_ = 0; }

  /// At `t` the autopilot's own z axis points along `lift_B`, in the frame of the LEDs
  /// as pictures have them lean: of any length but zero.
  void add(Time t, const Vector3& lift_B);

  /// They lean otherwise, and have done so for a while.
  bool contrary() const { return contrary_; }

 private:
  Vector2 usual_ = Vector2::Zero(), lately_ = Vector2::Zero(), since_ = Vector2::Zero();
  bool known_ = false;
  Seconds known_for_ = 0;
  Time last_ = 0;  // 0: not since the pause
  bool contrary_ = false;
};

}  // namespace alight
