#include "alight/geometry/mosaic.h"

#include <cassert>
#include <initializer_list>

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
  const auto mean2 = [](unsigned sum) {
    return static_cast<std::uint8_t>((sum + 1) / 2);
  };
  const auto mean4 = [](unsigned sum) {
    return static_cast<std::uint8_t>((sum + 2) / 4);
  };
  for (int v = 0; v < height; ++v, raw += width, bgr += std::ptrdiff_t{3} * width) {
    const std::uint8_t* above = v > 0 ? raw - width : raw + width;
    const std::uint8_t* below = v < height - 1 ? raw + width : raw - width;
    // In each row green ones and those of one other colour take turns.
    const int green = channel_at(mosaic, 0, v) == 1 ? 0 : 1;
    const int other = channel_at(mosaic, 1 - green, v);
    const auto green_at = [&](int left, int u, int right) {
      std::uint8_t* out = bgr + std::ptrdiff_t{3} * u;
      out[1] = raw[u];
      out[other] = mean2(unsigned{raw[left]} + raw[right]);
      out[2 - other] = mean2(unsigned{above[u]} + below[u]);
    };
    const auto other_at = [&](int left, int u, int right) {
      std::uint8_t* out = bgr + std::ptrdiff_t{3} * u;
      out[other] = raw[u];
      out[1] = mean4(unsigned{raw[left]} + raw[right] + above[u] + below[u]);
      out[2 - other] =
          mean4(unsigned{above[left]} + above[right] + below[left] + below[right]);
    };
    for (int u = 2 - green; u < width - 1; u += 2) green_at(u - 1, u, u + 1);
    for (int u = 1 + green; u < width - 1; u += 2) other_at(u - 1, u, u + 1);
    for (const int u : {0, width - 1}) {
      const int inwards = u == 0 ? 1 : u - 1;
      u % 2 == green ? green_at(inwards, u, inwards) : other_at(inwards, u, inwards);
    }
  }
}

void take_own_colors(const std::uint8_t* bgr, int width, int height, Mosaic mosaic,
                     std::uint8_t* raw) {
  assert(mosaic != Mosaic::none);
  for (int v = 0; v < height; ++v, raw += width, bgr += std::ptrdiff_t{3} * width) {
    for (const int first : {0, 1}) {
      const std::uint8_t* from = bgr + channel_at(mosaic, first, v);
      for (int u = first; u < width; u += 2) raw[u] = from[std::ptrdiff_t{3} * u];
    }
  }
}

}  // namespace alight
