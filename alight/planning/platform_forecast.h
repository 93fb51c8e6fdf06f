#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/geometry/platform_state.h"

namespace alight {

/// The platform at one instant of a forecast. All components in N.
struct PlatformNode {
  Vector3 v_IN_N = Vector3::Zero();        ///< m/s
  Vector3 w_IN_N = Vector3::Zero();        ///< rad/s
  Vector3 dv_N = Vector3::Zero();          ///< Rate of the components of v_IN_N, m/s^2
  Vector3 dw_N = Vector3::Zero();          ///< and of w_IN_N, rad/s^2.
  Vector3 g_N = Vector3(0, 0, -kGravity);  ///< m/s^2
};

/// How the platform moves while a plan is in force: nodes `step` apart,
/// joined by cubics that meet values and rates. Past the last one it goes
/// on as it went there. No nodes: steady, as PlanRequest::platform says.
struct PlatformForecast {
  static constexpr std::size_t kNodes = 33;
  Seconds step = 0.25;
  Seconds begin = 0;  ///< The plan starts that long after the first node.
  FixedVector<PlatformNode, kNodes> nodes;

  /// Appends a predicted state. False when full.
  bool add(const PlatformState& state);
};

/// The speed along N's axes and the turn rate change as a_IN_N and alpha_IN_N have it
/// now, for `duration` s at the most, and stay from there.
PlatformForecast constant_acceleration(const PlatformState& state, Seconds duration);

/// What makes motion in N to motion in I, expressed in N:
///   v_IB_N = v0 + v_NB + w p_NB
///   a_IB_N = a0 + a_NB + 2 w v_NB + a_p p_NB,  f = a_IB_N - g_N = f0 + ...
///   j_IB_N = j0 + j_NB + 3 w a_NB + j_v v_NB + j_p p_NB
struct FrameMotion {
  Vector3 v0 = Vector3::Zero();
  Vector3 a0 = Vector3::Zero();
  Vector3 f0 = Vector3::Zero();
  Vector3 j0 = Vector3::Zero();
  Matrix3 w = Matrix3::Zero();
  Matrix3 a_p = Matrix3::Zero();
  Matrix3 j_v = Matrix3::Zero();
  Matrix3 j_p = Matrix3::Zero();

  Vector3 velocity(const Vector3& p, const Vector3& v) const { return v0 + v + w * p; }
  Vector3 acceleration(const Vector3& p, const Vector3& v, const Vector3& a) const {
    return a0 + a + 2 * w * v + a_p * p;
  }
  Vector3 jerk(const Vector3& p, const Vector3& v, const Vector3& a,
               const Vector3& j) const {
    return j0 + j + 3 * w * a + j_v * v + j_p * p;
  }
};

/// At `t` s after the start; exact for a steady platform and at every t for the cubics.
FrameMotion frame_motion(const PlatformState& platform,
                         const PlatformForecast& forecast, Seconds t);

}  // namespace alight
