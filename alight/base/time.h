#pragma once
#include <cmath>
#include <cstdint>

namespace alight {

/// Nanoseconds of the one brain clock. Integer, so that equal instants compare equal
/// and a replay reproduces every bit.
using Time = std::int64_t;

/// Seconds, for durations that enter arithmetic.
using Seconds = double;

constexpr Seconds to_seconds(Time ns) { return static_cast<double>(ns) * 1e-9; }

/// Rounds to the nearest nanosecond.
inline Time from_seconds(Seconds s) { return std::llround(s * 1e9); }

}  // namespace alight
