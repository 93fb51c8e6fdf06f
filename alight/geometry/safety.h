#pragma once
#include <cstdint>

#include "alight/base/result.h"
#include "alight/geometry/rig.h"

namespace alight {

/// What follows when no landing comes about.
enum class WhenFailed : std::uint8_t {
  hold,  ///< The drone waits at the follow point for the operator.
  leave  ///< It flies to `leave_at_m`, and the autopilot lands there.
};
const char* to_string(WhenFailed action);

/// What follows when the battery is low in flight.
enum class WhenBatteryLow : std::uint8_t {
  finish,  ///< It lands on the pad without waiting; should that fail once, it leaves.
  leave    ///< As WhenFailed::leave, unless a landing is under way.
};
const char* to_string(WhenBatteryLow action);

/// What the user wants done when things go wrong (CONTRACT: Rig, `safety`).
struct Safety {
  double battery_low = 0.15;    ///< Share; from here on no start, no waiting.
  double battery_empty = 0.05;  ///< From here on it leaves, unless it is landing.
  WhenBatteryLow when_battery_low = WhenBatteryLow::finish;
  int landings_max = 8;  ///< Begun; then:
  WhenFailed when_failed = WhenFailed::hold;
  /// In N; where the autopilot is told to land. Zero: the follow point.
  Vector3 leave_at_m = Vector3::Zero();

  /// Names the first field that is out of range, its value and its bounds; `rig` has
  /// the pad from which `leave_at_m` must keep clear.
  Result<void> validate(const Rig& rig) const;
};

/// What the drone must not come down on or against: the platform from the pad to the
/// camera, as seen from above.
class PlatformOutline {
 public:
  explicit PlatformOutline(const Rig& rig);

  /// Level, from the drone's origin to the platform's middle line, m.
  double off(const Vector3& p_NB) const;
  /// Level, the drone is clear of it: it has room to brake and come down beside it.
  bool clear(const Vector3& p_NB) const { return off(p_NB) > distance_; }

 private:
  Vector2 lens_N_;   // from above; the platform reaches from the origin to it
  double distance_;  // half the pad's diagonal, the drone, and its way of braking
};

}  // namespace alight
