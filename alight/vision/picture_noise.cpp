#include "alight/vision/picture_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "alight/base/median.h"

namespace alight {
namespace {

constexpr int kGrid = 16;   // rows, and columns
constexpr int kAside = 3;   // px between neighbours: demosaicing blurs nearer ones
constexpr int kShift = 5;   // px by which the columns of a row lie off those above
constexpr double kSds = 5;  // from which on a pixel is more than noise
// sd of a Gaussian over the median of how much two draws of it differ
constexpr double kSdPerMedian = 1.4826 / 1.41421356;

struct Level {
  int grey, luminance;  // luminance in thousandths
};
Level level_at(const std::uint8_t* p, int channels) {
  if (channels == 1) return {p[0], 1000 * p[0]};
  return {std::max({p[0], p[1], p[2]}), 114 * p[0] + 587 * p[1] + 299 * p[2]};
}

}  // namespace

int PictureNoise::threshold() const {
  return dark + static_cast<int>(std::ceil(kSds * grey_sd));
}

PictureNoise picture_noise(const ImageView& picture) {
  std::array<int, kGrid * kGrid> grey, grey_steps, luminance_steps;
  std::size_t n = 0;
  const int room = std::max(picture.width - kAside, 1);
  for (int i = 0; i < kGrid; ++i) {
    const std::uint8_t* row = picture.row((2 * i + 1) * picture.height / (2 * kGrid));
    for (int j = 0; j < kGrid; ++j, ++n) {
      const int u = ((2 * j + 1) * room / (2 * kGrid) + i * kShift) % room;
      const int aside = std::min(u + kAside, picture.width - 1);
      const Level a = level_at(row + u * picture.channels, picture.channels);
      const Level b = level_at(row + aside * picture.channels, picture.channels);
      grey[n] = a.grey;
      grey_steps[n] = std::abs(a.grey - b.grey);
      luminance_steps[n] = std::abs(a.luminance - b.luminance);
    }
  }
  PictureNoise noise;
  noise.dark = median(grey.begin(), grey.end());
  noise.grey_sd = kSdPerMedian * median(grey_steps.begin(), grey_steps.end());
  const double sd =
      kSdPerMedian * 1e-3 * median(luminance_steps.begin(), luminance_steps.end());
  noise.luminance_variance = sd * sd;
  return noise;
}

}  // namespace alight
