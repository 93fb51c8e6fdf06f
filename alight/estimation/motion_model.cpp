#include "alight/estimation/motion_model.h"

namespace alight {

MotionState extrapolate(const MotionState& state, const PredictionInput& input,
                        Seconds dt, ProcessModel model, Matrix12* F) {
  const auto& [p_NB, R_NB, v_NB] = state.x;
  const PlatformState& platform = input.platform;
  const Vector3& w = platform.w_IN_N;

  // Specific force and its rate. Set-points come again before the next interval, so
  // their force keeps its direction in N.
  Vector3 f_N = input.f_N;
  Vector3 f_rate_N = Vector3::Zero();
  const Vector3 hover_B(0, 0, kGravity);
  const Vector3 hover_rate_B = input.w_NB_B.cross(hover_B);
  if (model == ProcessModel::hover) {
    f_N = R_NB * hover_B;
    f_rate_N = R_NB * hover_rate_B;
  }

  // a = a_0 + A_p p + A_v v + d, and its rate.
  const Matrix3 W = hat(w);
  const Matrix3 A_p = -W * W - hat(platform.alpha_IN_N);
  const Matrix3 A_v = -2 * W;
  const Vector3 a_NB = relative_acceleration(platform, p_NB, v_NB,
                                             f_N + state.d_N + gravity_N(platform));
  const Vector3 jerk = f_rate_N + A_v * a_NB + A_p * v_NB - w.cross(state.d_N);

  const double dt2 = 0.5 * dt * dt;
  const Matrix3 turn_d = so3_exp(-w * dt);
  const Matrix3 turn_B = so3_exp(input.w_NB_B * dt);
  MotionState next;
  next.x.p_NB = p_NB + v_NB * dt + a_NB * dt2;
  next.x.R_NB = orthonormalized(R_NB * turn_B);
  next.x.v_NB = v_NB + a_NB * dt + jerk * dt2;
  next.d_N = turn_d * state.d_N;

  if (F != nullptr) {
    const Matrix3 I = Matrix3::Identity();
    // The jerk's derivatives through a, v and d.
    const Matrix3 J_p = A_v * A_p;
    const Matrix3 J_v = A_v * A_v + A_p;
    const Matrix3 J_d = A_v - W;
    F->setZero();
    F->block<3, 3>(0, 0) = I + A_p * dt2;
    F->block<3, 3>(0, 6) = I * dt + A_v * dt2;
    F->block<3, 3>(0, 9) = I * dt2;
    F->block<3, 3>(3, 3) = turn_B.transpose();
    F->block<3, 3>(6, 0) = A_p * dt + J_p * dt2;
    F->block<3, 3>(6, 6) = I + A_v * dt + J_v * dt2;
    F->block<3, 3>(6, 9) = I * dt + J_d * dt2;
    F->block<3, 3>(9, 9) = turn_d;
    if (model == ProcessModel::hover) {
      const Matrix3 a_R = -R_NB * hat(hover_B);
      const Matrix3 jerk_R = A_v * a_R - R_NB * hat(hover_rate_B);
      F->block<3, 3>(0, 3) = a_R * dt2;
      F->block<3, 3>(6, 3) = a_R * dt + jerk_R * dt2;
    }
  }
  return next;
}

RelativeState extrapolate(const RelativeState& x, const Vector3& d_N,
                          const PredictionInput& input, Seconds dt,
                          ProcessModel model) {
  return extrapolate(MotionState{x, d_N}, input, dt, model).x;
}

Matrix12 process_covariance(const ProcessNoise& noise, Seconds dt) {
  // Integrals of the chain d -> v -> p; the turn of the axes within dt is left out.
  const double qa = noise.acceleration * noise.acceleration;
  const double qd = noise.disturbance * noise.disturbance;
  const double qr = noise.rate * noise.rate;
  const double dt2 = dt * dt, dt3 = dt2 * dt;
  const double pp = qa * dt3 / 3 + qd * dt3 * dt2 / 20;
  const double pv = qa * dt2 / 2 + qd * dt2 * dt2 / 8;
  const double vv = qa * dt + qd * dt3 / 3;
  const double pd = qd * dt3 / 6, vd = qd * dt2 / 2;
  Matrix12 Q = Matrix12::Zero();
  for (int i = 0; i < 3; ++i) {
    Q(i, i) = pp;
    Q(3 + i, 3 + i) = qr * dt;
    Q(6 + i, 6 + i) = vv;
    Q(9 + i, 9 + i) = qd * dt;
    Q(i, 6 + i) = Q(6 + i, i) = pv;
    Q(i, 9 + i) = Q(9 + i, i) = pd;
    Q(6 + i, 9 + i) = Q(9 + i, 6 + i) = vd;
  }
  return Q;
}

MotionState boxplus(const MotionState& state, const Vector12& d) {
  return {boxplus(state.x, Vector9(d.head<9>())), state.d_N + d.tail<3>()};
}

Vector12 boxminus(const MotionState& a, const MotionState& b) {
  Vector12 d;
  d << boxminus(a.x, b.x), a.d_N - b.d_N;
  return d;
}

}  // namespace alight
