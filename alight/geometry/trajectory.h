#pragma once
#include <array>

#include "alight/base/time.h"
#include "alight/geometry/flat_state.h"

namespace alight {

inline constexpr int kSegments = 2;       ///< rear space, touch-down space
inline constexpr int kControlPoints = 8;  ///< degree 7

using SegmentPoints = std::array<Vector3, kControlPoints>;

/// Piecewise Bezier curve in N (paper, eqn:MP_Bernstein): segment k lasts durations[k]
/// and is run through from t = 0. Control points are positions, m.
struct Trajectory {
  std::array<Seconds, kSegments> durations{1, 1};
  std::array<SegmentPoints, kSegments> c{at_origin(), at_origin()};
  /// The heading, rad: least jerk from yaw_start, at this rate and acceleration, to
  /// rest at yaw_end.
  double yaw_start = 0;
  double yaw_end = 0;
  double yaw_rate_start = 0;          ///< rad/s
  double yaw_acceleration_start = 0;  ///< rad/s^2

  Seconds duration() const { return durations[0] + durations[1]; }

  /// State at `t` s after the start; clamped to the ends, at rest beyond them only if
  /// the curve ends so.
  FlatState at(Seconds t) const;

  static SegmentPoints at_origin() {
    SegmentPoints points;
    points.fill(Vector3::Zero());
    return points;
  }
};

/// Value and derivatives of one Bezier segment, u in [0, 1], duration T s.
void evaluate_bezier(const SegmentPoints& c, double u, Seconds T, FlatState& out);

}  // namespace alight
