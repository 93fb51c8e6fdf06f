#pragma once

/// For loops over many numbers that are also compiled for what a machine may have
/// besides the least that it must have; which of the two runs is decided when it runs.
/// Both give the same bits: no fused operations, sums in the same order.
///
/// A function with this attribute is compiled into each that calls it, for its machine.
#define ALIGHT_INLINE [[gnu::always_inline]] inline

#if defined(__x86_64__)
#define ALIGHT_WIDE [[gnu::target("avx2")]]
#endif

namespace alight {

/// Whether functions marked ALIGHT_WIDE run here.
inline bool is_wide() {
#if defined(ALIGHT_WIDE)
  return __builtin_cpu_supports("avx2");
#else
  return false;
#endif
}

}  // namespace alight
