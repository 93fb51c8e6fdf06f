#pragma once
#include "alight/base/time.h"
#include "alight/geometry/flat_state.h"
#include "alight/geometry/relative_state.h"

namespace alight {

/// An error of speed counts for as long as the rest of a landing takes from the commit
/// on: where the drone would touch is its place and so much of its speed.
constexpr Seconds kMissAhead = 0.25;

/// How far off its way a drone in `x` would touch, level, were the commit now, m.
double expected_miss(const RelativeState& x, const FlatState& reference);

/// What misses a drone has had lately, in this wind and after this platform: the root
/// of their mean square, of which each counts less by its age. One that is far smaller
/// is rare, and long to wait for.
class UsualMiss {
 public:
  /// Nothing is known yet.
  void begin() { known_s_ = 0; }
  /// `miss` m is to be expected at `now`.
  void see(double miss, Time now);
  /// m; 0: not known.
  double rms() const;

 private:
  double mean_square_ = 0;
  Seconds known_s_ = 0;
  Time last_ = 0;
};

/// How well that is known: sd along the worst axis of N, m.
/// @param cov  Of place, attitude and velocity, as RelativeState has them.
double miss_sd(const Covariance9& cov);

}  // namespace alight
