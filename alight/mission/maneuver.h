#pragma once
#include "alight/control/reference.h"
#include "alight/geometry/trajectory.h"

namespace alight {

/// What the drone is asked to do, as a function of time: stand still in N, move to a
/// point, or fly a planned landing and, past its end, go on down at its last speed.
class Maneuver {
 public:
  Maneuver() = default;  ///< At rest in the origin of N.

  static Maneuver stay(const Vector3& p_NB, double yaw);
  static Maneuver move(const PointToPoint& move);
  /// `sink_m`: how far below the trajectory's end the reference may go on.
  static Maneuver landing(const Trajectory& trajectory, Time start, double sink_m);

  FlatState at(Time t) const;
  bool done(Time t) const;
  bool is_landing() const { return kind_ == Kind::landing; }
  /// When a landing's trajectory begins and ends, a move's ends; 0 for `stay`.
  Time end() const;

 private:
  enum class Kind : std::uint8_t { stay, move, landing };
  Kind kind_ = Kind::stay;
  FlatState rest_;
  PointToPoint move_;
  Trajectory trajectory_;
  Time start_ = 0;
  double sink_m_ = 0;
};

}  // namespace alight
