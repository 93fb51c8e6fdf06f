#pragma once
#include <cstddef>
#include <cstdint>

#include "alight/geometry/mosaic.h"

namespace alight {

/// A picture that somebody else owns. Rows may be padded (`stride`).
/// `channels` 1 is grey, 3 is interleaved blue, green, red.
struct ImageView {
  const std::uint8_t* data = nullptr;
  int width = 0;
  int height = 0;
  int channels = 3;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next
  /// Of three channels, which one each pixel has seen; the others are interpolated.
  Mosaic mosaic = Mosaic::none;

  bool empty() const { return data == nullptr; }
  const std::uint8_t* row(int v) const { return data + v * stride; }
};

/// Depth along the optical axis, mm, aligned with the colour picture; 0 is "unknown".
struct DepthView {
  const std::uint16_t* data = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride = 0;  ///< pixels from one row to the next

  bool empty() const { return data == nullptr; }
  const std::uint16_t* row(int v) const { return data + v * stride; }
};

/// Half-open pixel rectangle [u0, u1) x [v0, v1).
struct Roi {
  int u0 = 0;
  int v0 = 0;
  int u1 = 0;
  int v1 = 0;

  bool empty() const { return u1 <= u0 || v1 <= v0; }
};

}  // namespace alight
