#include "alight/estimation/residual_watch.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kTold = 6;  // directions: those of one picture of six LEDs
// A noise that seems larger may be the pose that is still settling.
constexpr double kNoiseOfConstant = 3;
constexpr double kLedLeast_m = 0.0001;  // nobody places LEDs better
// Of the claimed variances, in pictures of all kinds: from 0.3 to 1.2. Weighs like so
// many images.
constexpr double kNoiseSupposed = 0.7, kNoiseWeight = 4;
constexpr double kNoiseMemory = 20;  // pictures: noise is another near than far away
// What seems constant counts in full only beyond what noise feigns.
constexpr double kFeigned = 2;

}  // namespace

void ResidualWatch::add(std::span<const Residual> residuals) {
  const auto n = static_cast<double>(residuals.size());
  if (n < 4) return;
  double changing = 0, expected = 0, constant = 0, noise = 0, weights = 0;
  double first = 0, first_expected = 0;
  for (const Residual& r : residuals) {
    const auto i = static_cast<std::size_t>(r.led);
    seen_[i] = std::min(seen_[i] + 1, kMemory);
    const double claimed_px2 = r.left * r.variance_px2;
    const Vector2 d_m = r.m_per_px * r.px;
    // Against the mean of the pictures before this one.
    const Vector2 off_m = d_m - mean_m_[i];
    const double off = off_m.squaredNorm() / (r.m_per_px * r.m_per_px) / r.variance_px2;
    if (seen_[i] > 1) {
      changing += off;
      expected += r.left * seen_[i] / (seen_[i] - 1);
    } else {
      first += off;
      first_expected += r.left;
    }
    mean_m_[i] += off_m / seen_[i];
    // What is seen well tells most of where LEDs are.
    const double noise_m2 = std::min(noise_, kNoiseOfConstant) * claimed_px2 *
                            r.m_per_px * r.m_per_px / seen_[i];
    const double weight = 1 / (noise_m2 + kLedLeast_m * kLedLeast_m);
    constant += weight * mean_m_[i].squaredNorm();
    noise += weight * noise_m2;
    weights += 2 * weight;
  }
  pictures_ = std::min(pictures_ + 1, kMemory);
  if (noise_told_ == 0) {
    noise_ = kNoiseSupposed;
    noise_told_ = kNoiseWeight;
  }
  // LEDs that are off make it no smaller, but seem to make it larger.
  learn_noise(std::min(first, first_expected), first_expected);
  learn_noise(changing, expected);
  noise_told_ *= 1 - 1 / kNoiseMemory;
  // The pose takes up six of the 2 n directions in which LEDs may be off.
  const double share = 2 * n / (2 * n - 6);
  told_ += 2 * n - 6;
  constant_m2_ += (share * (constant - noise) / weights - constant_m2_) / pictures_;
  hidden_m2_ += (share * noise / weights - hidden_m2_) / pictures_;
}

void ResidualWatch::learn_noise(double changing, double expected) {
  if (expected <= 0) return;
  const double ratio = std::clamp(changing / expected, kLeast / 2, kMost);
  noise_told_ += expected;
  noise_ += (ratio - noise_) * expected / noise_told_;
  noise_ = std::clamp(noise_, kLeast, kMost);
}

void ResidualWatch::begin_anew() {
  mean_m_.fill(Vector2::Zero());
  seen_.fill(0);
  constant_m2_ = hidden_m2_ = 0;
}

double ResidualWatch::led_sd_m(double supposed_m) const {
  const double seen_m2 = std::max(constant_m2_, 0.0);
  const double learnt_m =
      seen_m2 > 0 ? seen_m2 / std::sqrt(seen_m2 + kFeigned * hidden_m2_) : 0;
  const double doubt = kTold / (kTold + told_);
  double unseen_m = supposed_m * doubt * doubt;
  // LEDs that are off by more than what noise leaves open would have been seen.
  if (told_ > 0) unseen_m = std::min(unseen_m, std::sqrt(doubt * hidden_m2_));
  return std::max(unseen_m, learnt_m);
}

}  // namespace alight
