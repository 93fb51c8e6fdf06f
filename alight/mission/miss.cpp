#include "alight/mission/miss.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr Seconds kRemembered = 4;
constexpr Seconds kStep = 0.01;  // what the first one stands for
constexpr Seconds kGap = 0.1;    // no miss stands for longer

}  // namespace

double expected_miss(const RelativeState& x, const FlatState& reference) {
  const Vector3 off = x.p_NB - reference.p_NB + kMissAhead * (x.v_NB - reference.v_NB);
  return off.head<2>().norm();
}

void UsualMiss::see(double miss, Time now) {
  const bool first = known_s_ == 0;
  const Seconds dt = first ? kStep : std::min(to_seconds(now - last_), kGap);
  last_ = now;
  if (!(dt > 0) || !std::isfinite(miss)) return;
  // A plain mean until as much has been seen as is remembered.
  known_s_ = std::min(known_s_ + dt, kRemembered);
  mean_square_ =
      first ? miss * miss : mean_square_ + dt / known_s_ * (miss * miss - mean_square_);
}

double UsualMiss::rms() const { return known_s_ > 0 ? std::sqrt(mean_square_) : 0; }

double miss_sd(const Covariance9& cov) {
  const Vector3 variance = cov.diagonal().head<3>() +
                           2 * kMissAhead * cov.block<3, 3>(0, 6).diagonal() +
                           kMissAhead * kMissAhead * cov.diagonal().tail<3>();
  return std::sqrt(std::max(0.0, variance.maxCoeff()));
}

}  // namespace alight
