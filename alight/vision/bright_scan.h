#pragma once
#include <cstdint>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include "alight/vision/wide.h"

namespace alight {

/// Index of the first byte above `threshold` in [begin, end), or `end`.
inline int first_bright_scalar(const std::uint8_t* bytes, int begin, int end,
                               int threshold) {
  while (begin < end && bytes[begin] <= threshold) ++begin;
  return begin;
}

/// The same, 64 bytes at a time where the machine can: nearly all of a short exposure
/// is dark, and to run over the dark is what detection costs. Bytes before `begin` are
/// read, too, from the first on.
inline int first_bright_narrow(const std::uint8_t* bytes, int begin, int end,
                               int threshold) {
#if defined(__SSE2__)
  const __m128i tau = _mm_set1_epi8(static_cast<char>(threshold));
  const __m128i zero = _mm_setzero_si128();
  const auto load = [&](int i) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes + i));
  };
  for (; begin + 64 <= end; begin += 64) {
    const __m128i most = _mm_max_epu8(_mm_max_epu8(load(begin), load(begin + 16)),
                                      _mm_max_epu8(load(begin + 32), load(begin + 48)));
    if (_mm_movemask_epi8(_mm_cmpeq_epi8(_mm_subs_epu8(most, tau), zero)) != 0xffff) {
      break;
    }
  }
  for (; begin + 16 <= end; begin += 16) {
    const int dark =
        _mm_movemask_epi8(_mm_cmpeq_epi8(_mm_subs_epu8(load(begin), tau), zero));
    if (dark != 0xffff) return begin + __builtin_ctz(static_cast<unsigned>(~dark));
  }
  if (begin < end && end >= 16) {
    // What is left, together with bytes before it that do not count.
    const int dark =
        _mm_movemask_epi8(_mm_cmpeq_epi8(_mm_subs_epu8(load(end - 16), tau), zero)) |
        ((1 << (16 - (end - begin))) - 1);
    if (dark == 0xffff) return end;
    return end - 16 + __builtin_ctz(static_cast<unsigned>(~dark));
  }
#endif
  return first_bright_scalar(bytes, begin, end, threshold);
}

#if defined(ALIGHT_WIDE)
/// The same, 128 bytes at a time. @pre is_wide()
ALIGHT_WIDE inline int first_bright_wide(const std::uint8_t* bytes, int begin, int end,
                                         int threshold) {
  const __m256i tau = _mm256_set1_epi8(static_cast<char>(threshold));
  for (; begin + 128 <= end; begin += 128) {
    const auto* at = reinterpret_cast<const __m256i*>(bytes + begin);
    const __m256i most = _mm256_max_epu8(
        _mm256_max_epu8(_mm256_loadu_si256(at), _mm256_loadu_si256(at + 1)),
        _mm256_max_epu8(_mm256_loadu_si256(at + 2), _mm256_loadu_si256(at + 3)));
    const __m256i over = _mm256_subs_epu8(most, tau);
    if (_mm256_testz_si256(over, over) == 0) break;
  }
  return first_bright_narrow(bytes, begin, end, threshold);
}
#endif

/// The same, as many at a time as the machine can.
inline int first_bright(const std::uint8_t* bytes, int begin, int end, int threshold) {
#if defined(ALIGHT_WIDE)
  if (is_wide()) return first_bright_wide(bytes, begin, end, threshold);
#endif
  return first_bright_narrow(bytes, begin, end, threshold);
}

}  // namespace alight
