#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/planning/bezier_basis.h"
#include "alight/planning/planner.h"

namespace alight {

/// n'x <= b for every control point x of a curve of the motion in I.
struct LimitRow {
  Vector3 n = Vector3::Zero();
  double b = 0;
  double b_fixed = 0;  ///< What rows hold that the boundary states alone decide.
  Constraint meaning = Constraint::speed;
};

/// A polyhedron inside the unit ball, its vertices on it (standard), or the unit box
/// (paper).
struct LimitPolyhedron {
  FixedVector<Vector3, 32> normals;  ///< unit
  double face_distance = 1;
  bool box = false;
};
LimitPolyhedron make_polyhedron(Profile profile);

/// The limits of one drone over one motion of the platform (eqn:MP_dynconstr): speed
/// and acceleration as norms in I; tilt, thrust and body rates through flatness, of the
/// specific force f = a_IB_N - g_N. The paper bounds v_IN_N + v and a_IN_N + a alone.
struct DynamicLimitRows {
  PlatformState platform;
  PlatformForecast forecast;
  bool raised = true;   ///< All curves raised to one degree, so that they can be added.
  bool turning = true;  ///< Frame terms other than v0, a0, f0 and j0 are not all zero.
  double reach = 3;     ///< |p_NB| stays below it, m: for what the cubics leave over.

  FixedVector<LimitRow, 32> speed;
  FixedVector<LimitRow, 32> acceleration;
  FixedVector<LimitRow, 16> force;  ///< Tilt, then thrust.
  /// n'j - b f_z <= 0: |j| <= rate |f| on the safe side, as f_z <= |f|.
  FixedVector<LimitRow, 32> body_rate;

  // Every face of the polyhedron holds when the norm is below this.
  double speed_inside = 0;
  double acceleration_inside = 0;
  // Every tilt row holds when |f_xy| <= tilt_slope f_z - tilt_spare.
  std::size_t tilt_rows = 0;
  double tilt_slope = 0;
  double tilt_spare = 0;

  bool varying() const { return !forecast.nodes.empty(); }
};

/// @param factor  Tightening of the limits, 1 for the online solve.
DynamicLimitRows make_limits(const PlannerConfig& config, const Rig& rig,
                             const LimitPolyhedron& polyhedron,
                             const PlatformState& platform, double factor,
                             const PlatformForecast& forecast = {});

/// Least and greatest specific force that the planner asks of the rotors, m/s^2.
struct ThrustRange {
  double least = 0;
  double most = 0;
};
ThrustRange thrust_range(const PlannerConfig& config, const DroneSpec& drone);

/// Fastest change of heading in N's plane, seen from I, that keeps the body's own rate
/// about z below its bound at any planned tilt. rad/s
double heading_rate_max(const PlannerConfig& config, const DroneSpec& drone);

inline constexpr int kForecastDegree = 3;  ///< Of the platform's motion on a segment.
inline constexpr int kMotionPoints = kControlPoints + kForecastDegree;
using MotionPoints =
    Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor, kMotionPoints, 3>;

/// The frame's motion over one segment, by its Bernstein coefficients. `slack` is what
/// a forecast's cubics may be off from it; rows are that much tighter.
struct SegmentFrame {
  int degree = 0;
  std::array<FrameMotion, kForecastDegree + 1> at;
  double slack_v = 0, slack_a = 0, slack_f = 0, slack_j = 0;
};
using SegmentFrames = std::array<SegmentFrame, kSegments>;
SegmentFrames segment_frames(const DynamicLimitRows& limits,
                             const std::array<Seconds, kSegments>& T);

/// Control points of the motion in I over one segment; f and j only if `raised`.
struct MotionCurves {
  MotionPoints v, a, f, j;
};
MotionCurves motion_curves(const DynamicLimitRows& limits, const SegmentFrame& frame,
                           const ControlPoints& c, Seconds T);

/// How many control points the curves of velocity, and of the rest, have.
int velocity_points(const DynamicLimitRows& limits);
int acceleration_points(const DynamicLimitRows& limits);

/// Weight of coefficient j of a polynomial of degree `q` times coefficient k of one of
/// degree 7 in coefficient j + k of the product.
double product_weight(int q, int j, int k);

}  // namespace alight
