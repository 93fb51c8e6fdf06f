#pragma once
#include <algorithm>
#include <cstdint>

#include "alight/geometry/image.h"

namespace alight {

/// Grey of the pixel at `p` as LEDs are looked for: of its brightest channel, so that a
/// blue or red light counts as much as a green one. `channels` as ImageView's.
inline int grey_of(const std::uint8_t* p, int channels) {
  // Which one it is cannot be foretold: no branches.
  return channels == 1 ? p[0] : std::max<int>(std::max<int>(p[0], p[1]), p[2]);
}

/// Thousandths of a luminance that are blue, green and red (ITU-R BT.601).
inline constexpr int kLuminance[] = {114, 587, 299};

/// Luminance of blue, green and red.
template <class T>
inline float luminance_of(const T* p) {
  return kLuminance[0] / 1000.0f * p[0] + kLuminance[1] / 1000.0f * p[1] +
         kLuminance[2] / 1000.0f * p[2];
}

/// Luminance of the pixel at `p`, grey levels.
inline float luminance_of(const std::uint8_t* p, int channels) {
  return channels == 1 ? p[0] : luminance_of(p);
}

/// The same in whole thousandths.
inline int thousand_luminance_of(const std::uint8_t* p, int channels) {
  return channels == 1
             ? 1000 * p[0]
             : kLuminance[0] * p[0] + kLuminance[1] * p[1] + kLuminance[2] * p[2];
}

}  // namespace alight
