#include "alight/mission/lean_watch.h"

#include <algorithm>
#include <cmath>

#include "alight/geometry/so3.h"

namespace alight {
namespace {

// s: what is usual, what is so lately, and what has been for a second.
constexpr Seconds kUsual = 3, kLately = 0.25, kSecond = 1;
constexpr Seconds kGap = 0.2;
constexpr Seconds kKnownAfter = 0.5;
// Of landings in random worlds none differed by more than 5.6 and 4.3 deg, just after
// take-off in wind; in another drone 15 and more within half a second, or 5 to 9 for
// good.
constexpr double kOtherwise = 9 * kDegree, kForASecond = 6 * kDegree;
constexpr double kLearns = 3 * kDegree;

}  // namespace

void LeanWatch::add(Time t, const Vector3& lift_B) {
  const Vector2 lean = lift_B.head<2>() / lift_B.norm();
  if (!lean.allFinite()) return;
  const Seconds dt = last_ == 0 ? 0 : to_seconds(t - last_);
  if (last_ != 0 && dt <= 0) return;
  if (!known_) usual_ = lean;
  known_ = true;
  if (last_ == 0 || dt > kGap) lately_ = since_ = usual_;
  last_ = t;
  if (dt == 0) return;
  const Seconds counts = std::min(dt, kGap);
  const auto follow = [&](Vector2& mean, Seconds tau) {
    mean += (1 - std::exp(-counts / tau)) * (lean - mean);
  };
  follow(lately_, kLately);
  follow(since_, kSecond);
  const double off = (lately_ - usual_).norm();
  contrary_ = known_for_ > kKnownAfter &&
              (off > kOtherwise || (since_ - usual_).norm() > kForASecond);
  if (off > kLearns && known_for_ > kKnownAfter) return;
  // At first the mean of all.
  follow(usual_, std::min(kUsual, known_for_ + counts));
  known_for_ += counts;
}

}  // namespace alight
