#include "alight/geometry/safety.h"

#include <algorithm>
#include <cmath>

#include "alight/base/bounds.h"

namespace alight {

const char* to_string(WhenFailed action) {
  return action == WhenFailed::hold ? "hold" : "leave";
}

const char* to_string(WhenBatteryLow action) {
  return action == WhenBatteryLow::finish ? "finish" : "leave";
}

PlatformOutline::PlatformOutline(const Rig& rig)
    : lens_N_(rig.camera.X_NC.translation().head<2>()) {
  // From the platform's speed to rest over the ground the autopilot needs some 0.1 m.
  constexpr double kBraking = 0.15;
  distance_ = std::sqrt(0.5) * rig.pad.size_m + rig.drone.size_m + kBraking;
}

double PlatformOutline::off(const Vector3& p_NB) const {
  const Vector2 p = p_NB.head<2>();
  const double length2 = lens_N_.squaredNorm();
  const double along =
      length2 > 0 ? std::clamp(p.dot(lens_N_) / length2, 0.0, 1.0) : 0.0;
  return (p - along * lens_N_).norm();
}

Result<void> Safety::validate(const Rig& rig) const {
  FirstComplaint check;
  check.range("safety.battery_low", battery_low, 0, 1);
  check.range("safety.battery_empty", battery_empty, 0, battery_low);
  check.range("safety.landings_max", landings_max, 1, 1000);
  check.that(leave_at_m.allFinite(), "safety.leave_at_m is not finite");
  if (!leave_at_m.isZero()) {
    check.that(PlatformOutline(rig).clear(leave_at_m),
               "safety.leave_at_m lies over the platform or too near to it: move it "
               "farther from the pad and the camera");
    check.range("safety.leave_at_m (z)", leave_at_m.z(), rig.drone.gear_height_m, 50);
  }
  return check.result();
}

}  // namespace alight
