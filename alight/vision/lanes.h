#pragma once
#include <algorithm>
#include <bit>
#include <cstdint>

#include "alight/vision/wide.h"

namespace alight {

/// Arithmetic of loops over many floats: no library calls, no branches, so that
/// compilers take several at a time. The same bits on any machine.

constexpr int kLane = 8;  ///< Numbers go through the machine in eights.

/// Sum of products over whole lanes, in an order that any machine can keep to.
ALIGHT_INLINE float dot(const float* a, const float* b, int n) {
  float lane[kLane] = {};
  for (int i = 0; i < n; i += kLane) {
    for (int k = 0; k < kLane; ++k) lane[k] += a[i + k] * b[i + k];
  }
  for (int k = 0; k < kLane / 2; ++k) lane[k] += lane[k + kLane / 2];
  return (lane[0] + lane[1]) + (lane[2] + lane[3]);
}

/// 2^t, to 8e-6; t is cut to [-100, 100].
ALIGHT_INLINE float exp2_of(float t) {
  const float x = std::min(std::max(t, -100.f), 100.f);
  const int whole = static_cast<int>(x + 128.f) - 128;  // the greatest below x
  // 2^f on [0, 1]: the square of 2^(f/2) by its Taylor series.
  const float h = 0.34657359f * (x - static_cast<float>(whole));
  const float root =
      1 +
      h * (1 + h * (0.5f + h * (0.16666667f + h * (0.04166667f + h * 0.00833333f))));
  return root * root * std::bit_cast<float>((whole + 127) << 23);
}

/// exp(x), to 1e-5; x is cut as that of exp2_of.
ALIGHT_INLINE float exp_of(float x) { return exp2_of(1.44269504f * x); }

/// Logarithm to base 2 of a normal x > 0, to 3e-7 beyond its own rounding.
ALIGHT_INLINE float log2_of(float x) {
  // x = m 2^whole with m about 1: between sqrt(1/2) and sqrt(2).
  constexpr std::int32_t kRootHalf = 0x3f3504f3;
  const auto bits = std::bit_cast<std::int32_t>(x);
  const std::int32_t whole = (bits - kRootHalf) >> 23;
  const float m = std::bit_cast<float>(bits - (whole << 23));
  const float s = (m - 1) / (m + 1), s2 = s * s;
  // 2 atanh(s) / ln 2
  return static_cast<float>(whole) +
         s * (2.88539008f + s2 * (0.96179669f + s2 * (0.57707802f + s2 * 0.41219859f)));
}

/// x to the power of `exponent`, x > 0, where the result is an ordinary number.
ALIGHT_INLINE float pow_of(float x, float exponent) {
  return exp2_of(exponent * log2_of(x));
}

}  // namespace alight
