#include "alight/estimation/residual_watch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alight/base/fixed_vector.h"
#include "alight/base/median.h"

namespace alight {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kTold = 6;             // directions: those of one picture of six LEDs
constexpr double kLedLeast_m = 0.0001;  // nobody places LEDs better;
constexpr double kLedFinest_m = 5e-6;   // finer, no picture tells of them
// Of the claimed variances, in pictures of all kinds: from 0.3 to 1.2. Weighs like so
// many directions.
constexpr double kNoiseSupposed = 0.7, kNoiseWeight = 4;
// Pictures: noise is another near than far away, LEDs seem to stand elsewhere from
// another side, but are all the time as exact as they are.
constexpr double kNoiseMemory = 12, kMeanMemory = 60, kLedMemory = 300;
// A claim so many times the usual one stands for something else than noise, as for an
// LED that may be covered in part.
constexpr double kOtherClaim = 6;
// What seems constant counts in full only beyond what noise feigns.
constexpr double kFeigned = 2;
// From so many times what was known on, as by one picture in 2,000 of exact LEDs, it is
// learnt anew: an LED has been knocked, or is covered in part.
constexpr double kPlainly = 4;

}  // namespace

void ResidualWatch::add(std::span<const Residual> residuals) {
  if (residuals.size() < 4) return;
  learn_noise(residuals);
  learn_leds(residuals);
}

void ResidualWatch::learn_noise(std::span<const Residual> residuals) {
  if (noise_told_ == 0) {
    noise_ = kNoiseSupposed;
    noise_told_ = kNoiseWeight;
  }
  FixedVector<double, kMaxLeds> claims;
  for (const Residual& r : residuals) claims.push_back(r.variance_px2);
  const double usual_px2 = median(claims.begin(), claims.end());
  // What the pose that fits this picture best leaves: whatever the filter's own is and
  // how well it is known, 2 n - 6 directions of it are noise.
  Matrix6 A = Matrix6::Zero();
  Vector6 g = Vector6::Zero();
  double square = 0, expected = 0, count = 0;
  bool first = false;
  for (const Residual& r : residuals) {
    if (r.variance_px2 > kOtherClaim * usual_px2) continue;
    const auto i = static_cast<std::size_t>(r.led);
    const double information = 2 / r.variance_px2;
    const Vector2 off_px = r.px - mean_m_[i] / r.m_per_px;
    A.noalias() += information * r.H.transpose() * r.H;
    g.noalias() += information * r.H.transpose() * off_px;
    square += information * off_px.squaredNorm();
    expected +=
        2 + information * mean_noise_m2_[i] / (r.m_per_px * r.m_per_px) / noise_;
    first = first || mean_noise_m2_[i] == 0;
    ++count;
  }
  const Eigen::LLT<Matrix6> llt(A);
  if (count < 4 || llt.info() != Eigen::Success) return;
  square -= g.dot(llt.solve(g));
  expected *= 1 - 3 / count;
  // LEDs that are off make it no smaller, but seem to make it larger.
  if (first) square = std::min(square, expected);
  noise_told_ += expected;
  const double ratio = std::clamp(square / expected, kLeast / 2, kMost);
  noise_ += (ratio - noise_) * expected / noise_told_;
  noise_ = std::clamp(noise_, kLeast, kMost);
  noise_told_ *= 1 - 1 / kNoiseMemory;
}

void ResidualWatch::learn_leds(std::span<const Residual> residuals) {
  const auto n = static_cast<double>(residuals.size());
  double constant = 0, noise = 0, weights = 0;
  for (const Residual& r : residuals) {
    const auto i = static_cast<std::size_t>(r.led);
    Vector2& mean_m = mean_m_[i];
    double& mean_noise_m2 = mean_noise_m2_[i];
    const Vector2 d_m = r.m_per_px * r.px;
    const double drawn_m2 = noise_ * r.left * r.variance_px2 * r.m_per_px * r.m_per_px;
    if (mean_noise_m2 > 0) {
      // What is older counts less, and what was seen from farther away.
      const double before_m2 = mean_noise_m2 / (1 - 1 / kMeanMemory);
      const double gain = before_m2 / (before_m2 + drawn_m2);
      mean_m += gain * (d_m - mean_m);
      mean_noise_m2 = (1 - gain) * before_m2;
    } else {
      mean_m = d_m;
      mean_noise_m2 = drawn_m2;
    }
    // What is seen well tells most of where LEDs are.
    const double weight = 1 / (mean_noise_m2 + kLedLeast_m * kLedLeast_m);
    constant += weight * mean_m.squaredNorm();
    noise += weight * mean_noise_m2;
    weights += 2 * weight;
  }
  // The pose takes up six of the 2 n directions in which LEDs may be off.
  const double share = 2 * n / (2 * n - 6);
  told_ += 2 * n - 6;
  const double hidden_m2 = share * noise / weights;
  const double seen_m2 = share * constant / weights;
  if (seen_m2 > kPlainly * (hidden_m2 + std::max(constant_m2_, 0.0))) weight_ = 0;
  // The less noise hides, the more a picture tells.
  const double doubt_m2 = hidden_m2 + kLedFinest_m * kLedFinest_m;
  const double weight = 1 / (doubt_m2 * doubt_m2);
  weight_ = (1 - 1 / kLedMemory) * weight_ + weight;
  const double gain = weight / weight_;
  constant_m2_ += gain * (seen_m2 - hidden_m2 - constant_m2_);
  hidden_m2_ += gain * (hidden_m2 - hidden_m2_);
}

void ResidualWatch::begin_anew() {
  mean_m_.fill(Vector2::Zero());
  mean_noise_m2_.fill(0);
  constant_m2_ = hidden_m2_ = weight_ = 0;
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
