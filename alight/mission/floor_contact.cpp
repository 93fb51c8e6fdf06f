#include "alight/mission/floor_contact.h"

#include <cmath>

#include "alight/geometry/so3.h"

namespace alight {
namespace {

constexpr Seconds kGap = 0.3;
// m/s: slower than any landing speed, faster than a dead reckoning makes up.
constexpr double kSinks = 0.25, kStill = 0.18;
constexpr Seconds kStillFor = 0.4;
// m: a second of a climb that is told 0.1 m/s wrong, and what the rig may be off.
constexpr double kNearFloor = 0.15;
constexpr double kUpright = 15 * kDegree;

}  // namespace

void FloorContact::seen(double height_m) {
  if (!std::isfinite(height_m)) return;
  known_ = true;
  height_m_ = height_m;
}

void FloorContact::told(Time t, double climb_m_s, double tilt_rad) {
  if (!known_) return;
  const Seconds dt = told_ == 0 ? 0 : to_seconds(t - told_);
  if (!std::isfinite(climb_m_s) || !std::isfinite(tilt_rad) || dt < 0 || dt > kGap) {
    forget();
    return;
  }
  told_ = t;
  height_m_ += climb_m_s * dt;
  sank_ = sank_ || climb_m_s < -kSinks;
  upright_ = tilt_rad < kUpright;
  still_for_ = std::abs(climb_m_s) < kStill ? still_for_ + dt : 0;
}

bool FloorContact::stands() const {
  return known_ && sank_ && upright_ && height_m_ < kNearFloor &&
         still_for_ >= kStillFor;
}

}  // namespace alight
