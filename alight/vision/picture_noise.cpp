#include "alight/vision/picture_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "alight/vision/pixel.h"

namespace alight {
namespace {

constexpr int kGrid = 16;   // rows, and columns
constexpr int kAside = 3;   // px between neighbours: demosaicing blurs nearer ones;
constexpr int kAlike = 4;   // to the next pixel but one under the same colour
constexpr int kShift = 5;   // px by which the columns of a row lie off those above
constexpr double kSds = 5;  // from which on a pixel is more than noise
// sd of a Gaussian over the median of how much two draws of it differ
constexpr double kSdPerMedian = 1.4826 / 1.41421356;
constexpr int kThousand = 1000;
constexpr int kLuminanceStep = 250;  // thousandths of grey levels, to count by

/// Of whole numbers, those above 255 taken for it, 65,535 at most. Counting takes less
/// than sorting.
class CountedMedian {
 public:
  void add(int value) { ++counts_[static_cast<std::size_t>(std::min(value, 255))]; }
  /// The upper one of two. @pre `n` were added
  int of(int n) const {
    int value = 0;
    for (int below = counts_[0]; below <= n / 2;) {
      below += counts_[static_cast<std::size_t>(++value)];
    }
    return value;
  }

 private:
  std::array<std::uint16_t, 256> counts_{};
};

template <int kChannels, bool kMosaic = false>
PictureNoise noise_of(const ImageView& picture) {
  CountedMedian grey, grey_steps, luminance_steps;
  constexpr int channels = kChannels;
  constexpr int kApart = kMosaic ? kAlike : kAside;
  const int room = std::max(picture.width - kApart, 1);
  std::array<int, kGrid> first;  // column of each, in the first row
  for (int j = 0; j < kGrid; ++j) {
    first[static_cast<std::size_t>(j)] = (2 * j + 1) * room / (2 * kGrid);
  }
  for (int i = 0; i < kGrid; ++i) {
    const int v = (2 * i + 1) * picture.height / (2 * kGrid);
    const std::uint8_t* row = picture.row(v);
    for (int u : first) {
      u += i * kShift;
      if (u >= room) u %= room;
      const int aside = std::min(u + kApart, picture.width - 1);
      const std::uint8_t* a = row + u * channels;
      const std::uint8_t* b = row + aside * channels;
      const int level = grey_of(a, channels);
      grey.add(level);
      grey_steps.add(std::abs(level - grey_of(b, channels)));
      const auto light = [&](const std::uint8_t* p) {
        if constexpr (kMosaic) return kThousand * p[channel_at(picture.mosaic, u, v)];
        return thousand_luminance_of(p, channels);
      };
      const int step = std::abs(light(a) - light(b));
      luminance_steps.add((step + kLuminanceStep / 2) / kLuminanceStep);
    }
  }
  constexpr int n = kGrid * kGrid;
  PictureNoise noise;
  noise.dark = grey.of(n);
  noise.grey_sd = kSdPerMedian * grey_steps.of(n);
  const double sd = kSdPerMedian * kLuminanceStep / kThousand * luminance_steps.of(n);
  noise.luminance_variance = sd * sd;
  return noise;
}

}  // namespace

int PictureNoise::threshold() const {
  return dark + static_cast<int>(std::ceil(kSds * grey_sd));
}

PictureNoise picture_noise(const ImageView& picture) {
  if (picture.channels == 1) return noise_of<1>(picture);
  return picture.mosaic == Mosaic::none ? noise_of<3>(picture)
                                        : noise_of<3, true>(picture);
}

}  // namespace alight
