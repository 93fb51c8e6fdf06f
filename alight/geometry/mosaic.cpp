#include "alight/geometry/mosaic.h"

#include <cassert>

namespace alight {

const char* to_string(Mosaic mosaic) {
  switch (mosaic) {
    case Mosaic::none:
      return "none";
    case Mosaic::rggb:
      return "rggb";
    case Mosaic::bggr:
      return "bggr";
    case Mosaic::grbg:
      return "grbg";
    case Mosaic::gbrg:
      return "gbrg";
  }
  return "?";
}

void interpolate_colors(const std::uint8_t* raw, int width, int height, Mosaic mosaic,
                        std::uint8_t* bgr) {
  assert(mosaic != Mosaic::none && width > 1 && height > 1);
  const auto mean = [](int sum, int n) {
    return static_cast<std::uint8_t>((sum + n / 2) / n);
  };
  for (int v = 0; v < height; ++v) {
    const std::uint8_t* own = raw + std::ptrdiff_t{v} * width;
    const std::uint8_t* above = v > 0 ? own - width : own + width;
    const std::uint8_t* below = v < height - 1 ? own + width : own - width;
    for (int u = 0; u < width; ++u, bgr += 3) {
      const int left = u > 0 ? u - 1 : u + 1, right = u < width - 1 ? u + 1 : u - 1;
      const int beside = own[left] + own[right], upright = above[u] + below[u];
      const int seen = channel_at(mosaic, u, v);
      bgr[seen] = own[u];
      if (seen == 1) {
        const int along_row = channel_at(mosaic, left, v);
        bgr[along_row] = mean(beside, 2);
        bgr[2 - along_row] = mean(upright, 2);
      } else {
        bgr[1] = mean(beside + upright, 4);
        bgr[2 - seen] =
            mean(above[left] + above[right] + below[left] + below[right], 4);
      }
    }
  }
}

void take_own_colors(const std::uint8_t* bgr, int width, int height, Mosaic mosaic,
                     std::uint8_t* raw) {
  assert(mosaic != Mosaic::none);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u, bgr += 3) *raw++ = bgr[channel_at(mosaic, u, v)];
  }
}

}  // namespace alight
