#pragma once
#include "alight/base/time.h"
#include "alight/geometry/pose.h"

namespace alight {

/// Whether a drone that its autopilot lands beside the platform stands on the floor, by
/// what telemetry says of its climb.
///
/// The pad hides the floor behind it from the camera. An autopilot that is no longer
/// seen there takes seconds to notice that it stands, and meanwhile leans against a
/// drift that it makes up, until it tips over. That it no longer sinks though it had
/// sunk, and to where, is known here sooner. No clock, no allocation.
class FloorContact {
 public:
  /// Another flight, or none.
  void forget() { *this = FloorContact(); }

  /// Just seen so high above where it stands on the floor, m.
  void seen(double height_m);

  /// Telemetry captured at `t`: climb, m/s (NaN: not told), and how far it leans, rad.
  /// After a gap nothing is known until it is seen again.
  void told(Time t, double climb_m_s, double tilt_rad);

  /// It has sunk to the floor and stayed there, upright.
  bool stands() const;

 private:
  bool known_ = false;  // its height
  double height_m_ = 0;
  Time told_ = 0;  // 0: not yet
  bool sank_ = false, upright_ = false;
  Seconds still_for_ = 0;
};

}  // namespace alight
