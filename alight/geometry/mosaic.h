#pragma once
#include <cstddef>
#include <cstdint>

namespace alight {

/// The colour filters on a sensor's pixels (Bayer 1976): those of its first row's first
/// two, then of its second row's. none: every pixel sees all colours.
enum class Mosaic : std::uint8_t { none, rggb, bggr, grbg, gbrg };
const char* to_string(Mosaic mosaic);

/// Channel (0 blue, 1 green, 2 red) that the pixel at (u, v) sees itself.
/// @pre a mosaic
inline int channel_at(Mosaic mosaic, int u, int v) {
  const bool odd_u = (u & 1) != 0, odd_v = (v & 1) != 0;
  const bool green_first = mosaic == Mosaic::grbg || mosaic == Mosaic::gbrg;
  if ((odd_u != odd_v) != green_first) return 1;
  const bool red_above = mosaic == Mosaic::rggb || mosaic == Mosaic::grbg;
  return red_above != odd_v ? 2 : 0;
}

/// Pixels one after the other, row after row: `raw`, one byte each, becomes `bgr`,
/// three bytes each. What a pixel sees itself stays, the rest is the mean of its
/// neighbours that see it; at the rim the picture goes on as in a mirror.
/// @pre a mosaic, at least 2 x 2 pixels
void interpolate_colors(const std::uint8_t* raw, int width, int height, Mosaic mosaic,
                        std::uint8_t* bgr);

/// What each pixel of `bgr` has seen itself, into `raw`; as above.
void take_own_colors(const std::uint8_t* bgr, int width, int height, Mosaic mosaic,
                     std::uint8_t* raw);

}  // namespace alight
