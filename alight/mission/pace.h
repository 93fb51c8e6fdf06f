#pragma once
#include "alight/base/time.h"

namespace alight {

/// The clock by which a trajectory is flown. It can be slowed down to standing still
/// and let go on again; its rate goes over smoothly, so that place and speed never
/// jump. A trajectory flown more slowly keeps every limit it was planned for.
class Pace {
 public:
  static constexpr Seconds kTau = 0.25;  ///< In which 63 % of a change are made.

  struct Reading {
    Seconds s = 0;     ///< Since the trajectory's start, by its own clock.
    double rate = 1;   ///< ds/dt, 0 to 1
    double slope = 0;  ///< 1/s, its derivative
  };

  Pace() = default;
  explicit Pace(Time start) : since_(start) {}

  /// @param t  May lie ahead of the last `aim`, before the start, or so little before
  /// the last `aim` that the rate changed evenly since.
  Reading at(Time t) const;
  /// From `from` on the rate goes over to `rate`, 0 to 1.
  void aim(Time from, double rate);

 private:
  Time since_ = 0;  // at which s, rate were:
  Seconds s_ = 0;
  double rate_ = 1;
  double goal_ = 1;
  double slope_before_ = 0;
};

}  // namespace alight
