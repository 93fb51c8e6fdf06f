#include "alight/estimation/residual_watch.h"

#include <algorithm>
#include <cmath>

namespace alight {

void ResidualWatch::add(std::span<const Residual> residuals) {
  const auto n = static_cast<double>(residuals.size());
  if (n < 4) return;
  // The pose takes six of the 2 n residuals' freedom.
  const double share = 2 * n / (2 * n - 6);
  double changing = 0, constant = 0;
  for (const Residual& r : residuals) {
    const auto i = static_cast<std::size_t>(r.led);
    seen_[i] = std::min(seen_[i] + 1, kMemory);
    const Vector2 d_m = r.m_per_px * r.px;
    // Against the mean of the pictures before this one.
    const Vector2 off_m = d_m - mean_m_[i];
    if (seen_[i] > 1) {
      const double fresh = 1 - 1 / seen_[i];
      changing +=
          fresh * off_m.squaredNorm() / (r.m_per_px * r.m_per_px) / r.variance_px2;
    } else {
      changing += 1 / share;
    }
    mean_m_[i] += off_m / seen_[i];
    const double mean_noise =
        noise_ * r.variance_px2 * r.m_per_px * r.m_per_px / (share * seen_[i]);
    constant += mean_m_[i].squaredNorm() - mean_noise;
  }
  pictures_ = std::min(pictures_ + 1, kMemory);
  const double ratio = std::clamp(share * changing / n, kLeast / 2, kMost);
  noise_ = std::clamp(noise_ + (ratio - noise_) / (pictures_ + 4), kLeast, kMost);
  constant_m2_ +=
      (std::max(share * constant / (2 * n), 0.0) - constant_m2_) / pictures_;
}

double ResidualWatch::led_sd_m() const { return std::sqrt(constant_m2_); }

}  // namespace alight
