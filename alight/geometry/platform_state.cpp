#include "alight/geometry/platform_state.h"

namespace alight {
namespace {

Vector3 frame_terms(const PlatformState& platform, const Vector3& p_NB,
                    const Vector3& v_NB) {
  const Vector3& w = platform.w_IN_N;
  return platform.a_IN_N + 2 * w.cross(v_NB) + w.cross(w.cross(p_NB)) +
         platform.alpha_IN_N.cross(p_NB);
}

}  // namespace

PlatformState predict(const PlatformState& state, Seconds dt) {
  PlatformState next = state;
  next.t = state.t + from_seconds(dt);
  const Vector3 turn = state.w_IN_N * dt;
  // Integral of Exp(w s) over [0, dt]: the left Jacobian, J_l(x) = J_r(-x).
  next.X_IN.translation() +=
      state.X_IN.linear() * (so3_right_jacobian(-turn) * (state.v_IN_N * dt));
  next.X_IN.linear() = orthonormalized(state.X_IN.linear() * so3_exp(turn));
  return next;
}

Vector3 gravity_N(const PlatformState& platform) {
  return platform.X_IN.linear().transpose() * Vector3(0, 0, -kGravity);
}

Vector3 inertial_velocity_N(const PlatformState& platform, const Vector3& p_NB,
                            const Vector3& v_NB) {
  return platform.v_IN_N + v_NB + platform.w_IN_N.cross(p_NB);
}

Vector3 inertial_acceleration_N(const PlatformState& platform, const Vector3& p_NB,
                                const Vector3& v_NB, const Vector3& a_NB) {
  return a_NB + frame_terms(platform, p_NB, v_NB);
}

Vector3 relative_acceleration(const PlatformState& platform, const Vector3& p_NB,
                              const Vector3& v_NB, const Vector3& a_IB_N) {
  return a_IB_N - frame_terms(platform, p_NB, v_NB);
}

}  // namespace alight
