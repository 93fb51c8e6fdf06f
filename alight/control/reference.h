#pragma once
#include <Eigen/Core>
#include <limits>

#include "alight/base/time.h"
#include "alight/geometry/flat_state.h"

namespace alight {

/// Bounds of a move in N; `PointToPoint` takes the shortest duration that keeps them.
struct MoveLimits {
  double speed_m_s = 1;
  double acceleration_m_s2 = 1.5;
  double yaw_rate_rad_s = 1;
  /// How far a move upwards may go on down from a start that sinks. Where it would go
  /// farther it rises sooner than it moves, as hard as this whatever else bounds it.
  double dip_m = std::numeric_limits<double>::infinity();
  double lift_m_s2 = 4;
};

/// Minimum-jerk move in N from a moving state to rest at a point: a quintic on each
/// axis, heading by the shorter way round. Bounds hold along the whole move, except
/// where the start itself violates them or sinks too far.
class PointToPoint {
 public:
  /// At rest at the origin for ever.
  PointToPoint() = default;
  PointToPoint(Time start, const FlatState& from, const Vector3& to_p_NB, double to_yaw,
               const MoveLimits& limits);

  /// Before the start: the start, at rest; after the end: the goal, at rest.
  FlatState at(Time t) const;
  Time start() const { return start_; }
  Time end() const { return start_ + from_seconds(duration_); }
  Seconds duration() const { return duration_; }
  bool done(Time t) const { return t >= end(); }
  const Vector3& goal() const { return to_; }
  double goal_yaw() const { return to_yaw_; }

 private:
  FlatState evaluate(Seconds t) const;
  void rise_sooner(const MoveLimits& limits);

  Time start_ = 0;
  Seconds duration_ = 0;
  Seconds rise_ = 0;  // duration of z
  FlatState from_;
  Vector3 to_ = Vector3::Zero();
  double to_yaw_ = 0;
  Eigen::Matrix<double, 3, 6> c_ = Eigen::Matrix<double, 3, 6>::Zero();  // of t^k
  Eigen::Matrix<double, 1, 6> yaw_c_ = Eigen::Matrix<double, 1, 6>::Zero();
};

}  // namespace alight
