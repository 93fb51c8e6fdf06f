#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/base/time.h"

namespace alight {

/// The clock by which a trajectory is flown. It can be slowed down to standing still
/// and let go on again; its rate goes over so smoothly that place, speed and
/// acceleration never jump. A trajectory flown more slowly keeps every limit it was
/// planned for.
class Pace {
 public:
  static constexpr Seconds kTau = 0.125;  ///< Of each of two lags, one after the other.

  struct Reading {
    Seconds s = 0;      ///< Since the trajectory's start, by its own clock.
    double rate = 1;    ///< ds/dt, 0 to 1
    double slope = 0;   ///< 1/s, its derivative
    double curve = 0;   ///< 1/s^2, the derivative of that
    Seconds stops = 0;  ///< How much further it runs if stopped now.
  };

  Pace() : Pace(0) {}
  explicit Pace(Time start) { turns_.push_back({start, 0, 1, 1, 1}); }

  /// @param t  May lie ahead of the last `aim`, before it or before the start.
  Reading at(Time t) const;
  /// From `from` on the rate goes over to `rate`, 0 to 1; what had been aimed for after
  /// `from` is forgotten.
  void aim(Time from, double rate);

 private:
  /// The rate lags behind a wish that lags behind what is aimed for.
  struct Turn {
    Time since = 0;  // at which all others were:
    Seconds s = 0;
    double rate = 1;
    double wish = 1;
    double goal = 1;
  };
  static Turn carried(const Turn& turn, Time t);

  // Those of the last moments: read between now and the last one's start. With 10 ms
  // from one to the next the longest radio delay takes 30.
  FixedVector<Turn, 48> turns_;
};

}  // namespace alight
