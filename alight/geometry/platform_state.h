#pragma once
#include "alight/base/time.h"
#include "alight/geometry/pose.h"

namespace alight {

/// Pose and motion of the platform at one instant. Velocities and accelerations are
/// those of N in I, expressed in N (suffix _N).
struct PlatformState {
  Time t = 0;
  Pose X_IN = Pose::Identity();
  Vector3 v_IN_N = Vector3::Zero();      ///< m/s
  Vector3 w_IN_N = Vector3::Zero();      ///< rad/s
  Vector3 a_IN_N = Vector3::Zero();      ///< m/s^2, of the origin of N
  Vector3 alpha_IN_N = Vector3::Zero();  ///< rad/s^2
};

/// Carries the platform forward (or back) by `dt` s, the speed along its own axes and
/// the turn rate kept: constant turn rate and velocity, exact for a circle. Both
/// accelerations keep their components in N.
PlatformState predict(const PlatformState& state, Seconds dt);

/// g in N: R_NI (0, 0, -9.81).
Vector3 gravity_N(const PlatformState& platform);

/// Motion of B seen from I, expressed in N, from the motion seen from N:
///   v_IB_N = v_IN_N + v_NB + w x p_NB
///   a_IB_N = a_IN_N + a_NB + 2 w x v_NB + w x (w x p_NB) + alpha x p_NB
Vector3 inertial_velocity_N(const PlatformState& platform, const Vector3& p_NB,
                            const Vector3& v_NB);
Vector3 inertial_acceleration_N(const PlatformState& platform, const Vector3& p_NB,
                                const Vector3& v_NB, const Vector3& a_NB);

/// The inverse of inertial_acceleration_N: a_NB from a_IB_N.
Vector3 relative_acceleration(const PlatformState& platform, const Vector3& p_NB,
                              const Vector3& v_NB, const Vector3& a_IB_N);

}  // namespace alight
