#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/planning/bezier_basis.h"
#include "alight/planning/planner.h"

namespace alight {

/// n'x <= b for every control point x of a curve of v_IB_N or a_IB_N.
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

/// The relative dynamic limits (eqn:MP_dynconstr) for one motion of the platform:
///   v_IB_N = v0 + v_NB + v_p p_NB
///   a_IB_N = a0 + a_NB + a_v v_NB + a_p p_NB
/// exact in a turning, accelerating N. The paper leaves v_p, a_v and a_p out.
struct DynamicLimitRows {
  bool raised = true;  ///< All curves raised to degree 7, so that they can be added.
  bool turning = true;
  Vector3 v0 = Vector3::Zero();
  Vector3 a0 = Vector3::Zero();
  Matrix3 v_p = Matrix3::Zero();
  Matrix3 a_v = Matrix3::Zero();
  Matrix3 a_p = Matrix3::Zero();
  FixedVector<LimitRow, 32> speed;
  FixedVector<LimitRow, 48> acceleration;  ///< The polyhedron's, then the tilt's.

  // Every face of the polyhedron holds when the norm is below this.
  double speed_inside = 0;
  double acceleration_inside = 0;
  int tilt_rows = 0;
  // Every tilt row holds when |f_xy| <= tilt_slope f_z - tilt_spare, f = a_IB_N - g_N.
  double tilt_slope = 0;
  double tilt_spare = 0;
  Vector3 g_N = Vector3::Zero();
};

/// @param factor  Tightening of the limits, 1 for the online solve.
DynamicLimitRows make_limits(const PlannerConfig& config, const Rig& rig,
                             const LimitPolyhedron& polyhedron,
                             const PlatformState& platform, double factor);

/// Velocity and acceleration curves of v_IB_N, a_IB_N over one segment.
struct MotionCurves {
  ControlPoints v;  ///< Rows 0 .. velocity_map(raised).count - 1.
  ControlPoints a;
};
MotionCurves motion_curves(const DynamicLimitRows& limits, const ControlPoints& c,
                           Seconds T);

}  // namespace alight
