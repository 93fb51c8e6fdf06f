#include "alight/vision/skirt_learner.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kHeightMost = 0.3;
constexpr double kHeightSd = 0.01;  // no light is two Gaussians more exactly than that
constexpr double kLogSd = 0.5;      // of the variance, about the usual one
constexpr double kStepMost = 0.3;   // of its logarithm

}  // namespace

void SkirtLearner::add(const SkirtLook& look, PointSpread& spread) {
  constexpr double known = 1 / (kLogSd * kLogSd);
  if (looks_ == 0) {
    spread.skirt_variance_px2 = PointSpread::kSkirtUsual * spread.variance_px2;
    usual_ = std::log(spread.skirt_variance_px2);
    information_(1, 1) = known;
  }
  looks_ = std::min(looks_ + 1, kMemory);
  // Bright lights near the lens must not outweigh dim ones for ever.
  const double share = 1 / (1 + look.information(0, 0) * kHeightSd * kHeightSd);
  const double log_variance = std::log(spread.skirt_variance_px2);
  information_ = (1 - 1.0 / kMemory) * information_ + share * look.information;
  information_(1, 1) += known / kMemory;
  Vector2 pull = share * look.pull;
  pull[1] += known / kMemory * (usual_ - log_variance);
  const Vector2 step = information_.inverse() * pull;
  if (!step.allFinite()) return;
  spread.skirt = std::clamp(spread.skirt + step[0], 0.0, kHeightMost);
  const double least = std::log(PointSpread::kSkirtLeast * spread.variance_px2);
  const double most = std::log(PointSpread::kSkirtWidest * spread.variance_px2);
  const double moved = log_variance + std::clamp(step[1], -kStepMost, kStepMost);
  spread.skirt_variance_px2 = std::exp(std::clamp(moved, least, most));
}

}  // namespace alight
