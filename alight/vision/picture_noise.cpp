#include "alight/vision/picture_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "alight/base/median.h"
#include "alight/vision/pixel.h"

namespace alight {
namespace {

constexpr int kGrid = 16;   // rows, and columns
constexpr int kAside = 3;   // px between neighbours: demosaicing blurs nearer ones
constexpr int kShift = 5;   // px by which the columns of a row lie off those above
constexpr double kSds = 5;  // from which on a pixel is more than noise
// sd of a Gaussian over the median of how much two draws of it differ
constexpr double kSdPerMedian = 1.4826 / 1.41421356;

}  // namespace

int PictureNoise::threshold() const {
  return dark + static_cast<int>(std::ceil(kSds * grey_sd));
}

PictureNoise picture_noise(const ImageView& picture) {
  std::array<int, kGrid * kGrid> grey, grey_steps;
  std::array<float, kGrid * kGrid> luminance_steps;
  const int channels = picture.channels;
  std::size_t n = 0;
  const int room = std::max(picture.width - kAside, 1);
  for (int i = 0; i < kGrid; ++i) {
    const std::uint8_t* row = picture.row((2 * i + 1) * picture.height / (2 * kGrid));
    for (int j = 0; j < kGrid; ++j, ++n) {
      const int u = ((2 * j + 1) * room / (2 * kGrid) + i * kShift) % room;
      const int aside = std::min(u + kAside, picture.width - 1);
      const std::uint8_t* a = row + u * channels;
      const std::uint8_t* b = row + aside * channels;
      grey[n] = grey_of(a, channels);
      grey_steps[n] = std::abs(grey[n] - grey_of(b, channels));
      luminance_steps[n] =
          std::abs(luminance_of(a, channels) - luminance_of(b, channels));
    }
  }
  PictureNoise noise;
  noise.dark = median(grey.begin(), grey.end());
  noise.grey_sd = kSdPerMedian * median(grey_steps.begin(), grey_steps.end());
  const double sd = kSdPerMedian * static_cast<double>(median(luminance_steps.begin(),
                                                              luminance_steps.end()));
  noise.luminance_variance = sd * sd;
  return noise;
}

}  // namespace alight
