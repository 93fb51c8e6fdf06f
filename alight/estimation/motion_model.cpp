#include "alight/estimation/motion_model.h"

#include <cmath>

namespace alight {

MotionState extrapolate(const MotionState& state, const PredictionInput& input,
                        Seconds dt, const MotionModel& model, Matrix15* F) {
  const auto& [p_NB, R_NB, v_NB] = state.x;
  const PlatformState& platform = input.platform;
  const Vector3& w = platform.w_IN_N;

  // Specific force and its rate. Set-points come again before the next interval, so
  // their force keeps its direction in N.
  Vector3 f_N = input.f_N;
  Vector3 f_rate_N = Vector3::Zero();
  const Vector3 hover_B(0, 0, kGravity);
  const Vector3 hover_rate_B = input.w_NB_B.cross(hover_B);
  if (model.force == ProcessModel::hover) {
    f_N = R_NB * hover_B;
    f_rate_N = R_NB * hover_rate_B;
  }

  // a = a_0 + A_p p + A_v v + d + b, and its rate.
  const Vector3 unknown_N = model.drag
                                ? Vector3(state.d_N - state.b_N.cwiseProduct(v_NB))
                                : state.disturbance_N(input.lift_N);
  const Matrix3 W = hat(w);
  const Matrix3 A_p = -W * W - hat(platform.alpha_IN_N);
  Matrix3 A_v = -2 * W;
  if (model.drag) A_v.diagonal() -= state.b_N;
  const Vector3 a_NB = relative_acceleration(platform, p_NB, v_NB,
                                             f_N + unknown_N + gravity_N(platform));
  const double fade = 1 / model.memory_s;
  // Of what turns d in N.
  const Vector3 w_d = model.drag ? Vector3(R_NB * input.w_NB_B) : Vector3(-w);
  const Vector3 jerk =
      f_rate_N + A_v * a_NB + A_p * v_NB + w_d.cross(state.d_N) - fade * unknown_N;

  const double dt2 = 0.5 * dt * dt;
  const double kept = std::exp(-fade * dt);
  const Matrix3 turn_d = kept * so3_exp(w_d * dt);
  const Matrix3 turn_B = so3_exp(input.w_NB_B * dt);
  MotionState next;
  next.x.p_NB = p_NB + v_NB * dt + a_NB * dt2;
  next.x.R_NB = orthonormalized(R_NB * turn_B);
  next.x.v_NB = v_NB + a_NB * dt + jerk * dt2;
  next.d_N = turn_d * state.d_N;
  next.b_N = kept * state.b_N;

  if (F != nullptr) {
    const Matrix3 I = Matrix3::Identity();
    // The jerk's derivatives through a, v, d and b.
    const Matrix3 J_p = A_v * A_p;
    Matrix3 J_v = A_v * A_v + A_p;
    const Matrix3 J_b = A_v - fade * I;
    const Matrix3 J_d = J_b + hat(w_d);
    Matrix3 B = I;  // what b acts along
    B.col(2) = input.lift_N;
    if (model.drag) {
      B = (-v_NB).asDiagonal();
      J_v.diagonal() += fade * state.b_N;
    }
    F->setZero();
    F->block<3, 3>(0, 0) = I + A_p * dt2;
    F->block<3, 3>(0, 6) = I * dt + A_v * dt2;
    F->block<3, 3>(0, 9) = I * dt2;
    F->block<3, 3>(0, 12) = B * dt2;
    F->block<3, 3>(3, 3) = turn_B.transpose();
    F->block<3, 3>(6, 0) = A_p * dt + J_p * dt2;
    F->block<3, 3>(6, 6) = I + A_v * dt + J_v * dt2;
    F->block<3, 3>(6, 9) = I * dt + J_d * dt2;
    F->block<3, 3>(6, 12) = (I * dt + J_b * dt2) * B;
    if (model.drag) F->block<3, 3>(6, 12).diagonal() -= a_NB * dt2;
    F->block<3, 3>(9, 9) = turn_d;
    F->block<3, 3>(12, 12) = kept * I;
    if (model.force == ProcessModel::hover) {
      const Matrix3 a_R = -R_NB * hat(hover_B);
      const Matrix3 jerk_R = A_v * a_R - R_NB * hat(hover_rate_B);
      F->block<3, 3>(0, 3) = a_R * dt2;
      F->block<3, 3>(6, 3) = a_R * dt + jerk_R * dt2;
    }
    if (model.drag) {
      const Vector3 d_B = R_NB.transpose() * state.d_N;
      const Matrix3 hat_d = hat(d_B);
      F->block<3, 3>(6, 3) += dt2 * R_NB * hat_d * hat(input.w_NB_B);
      F->block<3, 3>(9, 3) = kept * R_NB * (turn_B * hat_d - hat(turn_B * d_B));
    }
  }
  return next;
}

Matrix15 process_covariance(const ProcessNoise& noise, Seconds dt, const Vector3& z_N,
                            bool drag) {
  // Integrals of the chains d -> v -> p and b -> v -> p; the turn of the axes, the
  // fading within dt and what drag has changed by its end are left out.
  const double qa = noise.acceleration * noise.acceleration;
  const double qb = noise.bias * noise.bias;
  const double qr = noise.rate * noise.rate;
  const double dt2 = dt * dt, dt3 = dt2 * dt;
  const double p_1 = dt3 / 6, v_1 = dt2 / 2;
  Matrix15 Q = Matrix15::Zero();
  for (int i = 0; i < 3; ++i) {
    const double wind = i < 2 ? noise.disturbance : noise.updraught;
    const double qd = wind * wind;
    const double q = drag ? qd : qd + qb;
    const double pp = qa * dt3 / 3 + q * dt3 * dt2 / 20;
    const double pv = qa * dt2 / 2 + q * dt2 * dt2 / 8;
    const double vv = qa * dt + q * dt3 / 3;
    Q(i, i) = pp;
    Q(3 + i, 3 + i) = qr * dt;
    Q(6 + i, 6 + i) = vv;
    Q(9 + i, 9 + i) = qd * dt;
    Q(i, 6 + i) = Q(6 + i, i) = pv;
    Q(i, 9 + i) = Q(9 + i, i) = qd * p_1;
    Q(6 + i, 9 + i) = Q(9 + i, 6 + i) = qd * v_1;
    Q(12 + i, 12 + i) = qb * dt;
    if (drag) continue;
    Q(i, 12 + i) = Q(12 + i, i) = qb * p_1;
    Q(6 + i, 12 + i) = Q(12 + i, 6 + i) = qb * v_1;
  }
  if (noise.thrust > 0) {
    const Matrix3 A = noise.thrust * noise.thrust * z_N * z_N.transpose();
    const auto both = [&](int row, int column, double share) {
      Q.block<3, 3>(row, column) += share * A;
      if (row != column) Q.block<3, 3>(column, row) += share * A;
    };
    both(0, 0, dt3 * dt2 / 20);
    both(0, 6, dt2 * dt2 / 8);
    both(6, 6, dt3 / 3);
    const int at = drag ? 9 : 12;
    both(0, at, p_1);
    both(6, at, v_1);
    both(at, at, dt);
  }
  return Q;
}

MotionState boxplus(const MotionState& state, const Vector15& d) {
  return {boxplus(state.x, Vector9(d.head<9>())), state.d_N + d.segment<3>(9),
          state.b_N + d.tail<3>()};
}

Vector15 boxminus(const MotionState& a, const MotionState& b) {
  Vector15 d;
  d << boxminus(a.x, b.x), a.d_N - b.d_N, a.b_N - b.b_N;
  return d;
}

}  // namespace alight
