#pragma once
#include <cstdint>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace alight {

/// Index of the first byte above `threshold` in [begin, end), or `end`.
inline int first_bright_scalar(const std::uint8_t* bytes, int begin, int end,
                               int threshold) {
  while (begin < end && bytes[begin] <= threshold) ++begin;
  return begin;
}

/// The same, 64 bytes at a time where the machine can: nearly all of a short exposure
/// is dark, and to run over the dark is what detection costs.
inline int first_bright(const std::uint8_t* bytes, int begin, int end, int threshold) {
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
#endif
  return first_bright_scalar(bytes, begin, end, threshold);
}

}  // namespace alight
