#pragma once
#include "alight/base/time.h"
#include "alight/geometry/relative_state.h"

namespace alight {

/// An error of speed counts for as long as the rest of a landing takes from the commit
/// on: where the drone would touch is its place and so much of its speed.
constexpr Seconds kMissAhead = 0.25;

/// How well that is known: sd along the worst axis of N, m.
/// @param cov  Of place, attitude and velocity, as RelativeState has them.
double miss_sd(const Covariance9& cov);

}  // namespace alight
