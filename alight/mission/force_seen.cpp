#include "alight/mission/force_seen.h"

#include <algorithm>

namespace alight {
namespace {

constexpr Seconds kEvery = 0.1;
constexpr Seconds kGap = 0.25;
constexpr double kJumpM = 0.6, kJumpRad = 0.6;  // within kEvery or kGap

}  // namespace

void ForceSeen::add(Time t, const Pose& X_NB) {
  if (!samples_.empty()) {
    const Sample& last = samples_.back();
    const Seconds since = to_seconds(t - last.t);
    const bool jumps =
        !((X_NB.translation() - last.X_NB.translation()).norm() < kJumpM) ||
        !(angle_between(X_NB.linear(), last.X_NB.linear()) < kJumpRad);
    if (!(since > 0 && since < kGap) || jumps) {
      clear();
    } else if (since < kEvery) {
      return;
    }
  }
  if (samples_.full()) samples_.erase(0);
  samples_.push_back({t, X_NB});
}

std::optional<double> ForceSeen::across(const Matrix3& R_BA) const {
  if (!samples_.full()) return std::nullopt;
  const Sample &first = samples_[0], &middle = samples_[kSamples / 2],
               &last = samples_[kSamples - 1];
  const auto mean_v = [](const Sample& from, const Sample& to) {
    return Vector3((to.X_NB.translation() - from.X_NB.translation()) /
                   to_seconds(to.t - from.t));
  };
  const Vector3 a_NB =
      2 * (mean_v(middle, last) - mean_v(first, middle)) / to_seconds(last.t - first.t);
  const Vector3 f_N = a_NB + Vector3(0, 0, kGravity);
  const Vector3 z_N = middle.X_NB.linear() * R_BA.col(2);
  return (f_N - std::max(f_N.dot(z_N), 0.0) * z_N).norm();
}

}  // namespace alight
