#pragma once
#include "alight/base/time.h"
#include "alight/geometry/flat_state.h"

namespace alight {

/// The end of a landing: what is added to the reference so that it comes to the pad at
/// its speed but with another acceleration, and the drone with another tilt than wind
/// and turns ask of it. It leans more before and stands up last:
///
///   p = a T^2 x^2 (1 - x)^3 / 2 + d (1 - x^3 (10 - 15 x + 6 x^2)),
///   x = (time to go - early) / T
///
/// which begins smoothly at x = 1 and has no speed left at x = 0, nor any place but d:
/// so far aside it touches, for what it slides from there. On the way it moves by 1.7 %
/// of a T^2 to the side. In the last `early` s the acceleration stays: a leaning
/// drone's feet are down before it is, and when is known to some hundredths.
class Flare {
 public:
  Flare() = default;  ///< None.
  /// @param a_N       Acceleration added at the end, m/s^2, in N.
  /// @param duration  T, s.
  /// @param d_N       Where it touches, from where it would, m, in N.
  Flare(const Vector3& a_N, Seconds duration, Seconds early,
        const Vector3& d_N = Vector3::Zero());

  /// Adds it, `to_go` s before the end. After the end the acceleration fades.
  void add_to(FlatState& state, Seconds to_go) const;

 private:
  Vector3 a_N_ = Vector3::Zero();
  Vector3 d_N_ = Vector3::Zero();
  Seconds duration_ = 0;
  Seconds early_ = 0;
};

}  // namespace alight
