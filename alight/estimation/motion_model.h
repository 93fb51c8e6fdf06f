#pragma once
#include <Eigen/Core>
#include <cstdint>

#include "alight/base/time.h"
#include "alight/geometry/platform_state.h"
#include "alight/geometry/relative_state.h"

namespace alight {

using Vector15 = Eigen::Matrix<double, 15, 1>;
using Matrix15 = Eigen::Matrix<double, 15, 15>;

/// Where the drone's specific force (thrust over mass) is taken from.
enum class ProcessModel : std::uint8_t {
  hover,       ///< R_NB (0, 0, g): hover thrust along z of B (paper, eqn:RSE_predict1).
  set_points,  ///< PredictionInput::f_N: what the autopilot was told to do.
};

/// What is known of the motion during one interval, constant over it.
struct PredictionInput {
  PlatformState platform;            ///< Motion of N: frame terms and gravity.
  Vector3 f_N = Vector3::Zero();     ///< Expected specific force on B, in N, m/s^2.
  Vector3 w_NB_B = Vector3::Zero();  ///< Expected rate of B against N, in B, rad/s.
  /// Thrust per weight, in N: what b's z acts along. A drone that is heavier or whose
  /// rotors give less than supposed lacks a share of its thrust, wherever that points.
  Vector3 lift_N = Vector3::UnitZ();
};

/// How a state goes on by itself.
struct MotionModel {
  ProcessModel force = ProcessModel::set_points;
  /// d and b fade with this time constant, s (infinity: never). It bounds what cannot
  /// be told while N does not turn: their difference.
  Seconds memory_s = 30;
  /// b is the drone's drag instead: it slows v_NB by a share of itself, 1/s along each
  /// axis of N. What else changes is then all in d, ProcessNoise::thrust too: thrust
  /// that differs from what the model supposes, most of it, so that d turns with B.
  bool drag = false;
};

/// The state with the acceleration that the model does not know, in N, m/s^2, in two
/// parts that only the turn of N tells apart: d is constant in I (wind), b constant in
/// N (drag of a drone that keeps station, tilt error). The z of b is a share of the
/// thrust instead, times g: it acts along PredictionInput::lift_N.
/// Tangent: (p, R, v, d, b), R on the right.
struct MotionState {
  RelativeState x;
  Vector3 d_N = Vector3::Zero();
  Vector3 b_N = Vector3::Zero();

  /// Unless MotionModel::drag.
  Vector3 disturbance_N(const Vector3& lift_N = Vector3::UnitZ()) const {
    return d_N + Vector3(b_N.x(), b_N.y(), 0) + b_N.z() * lift_N;
  }
};

/// Spectral densities of the white noise that drives the model (continuous time).
struct ProcessNoise {
  double rate = 0.1;  ///< of w_NB_B, rad/s per sqrt(Hz)
  /// of v_NB', m/s^2 per sqrt(Hz); over the random walks' it is the shortest time
  /// constant, s, in which these can follow.
  double acceleration = 0.1;
  double disturbance = 1.7;  ///< random walk of d_N, m/s^3 per sqrt(Hz),
  double updraught = 0.3;    ///< of its z: wind blows along the ground
  /// random walk of b_N, m/s^3 per sqrt(Hz); of a drag, 1/s^2 per sqrt(Hz)
  double bias = 0.9;
  double thrust = 1.7;  ///< and besides along z of B, where thrust changes
  /// random walk of the rate of turn that w_NB_B lacks, rad/s^2 per sqrt(Hz); 0: it is
  /// not estimated.
  double turn = 0;
};

/// Carries a state over `dt` s (may be negative):
///   p' = v,  R' = R hat(w_NB_B),  d' = -w_IN x d - d / tau,  b' = -b / tau
///   v' = f_N + d + (b_x, b_y, 0) + b_z lift_N + R_NI g - a_IN - 2 w x v - w x (w x p)
///   - alpha x p
/// or with -b v (by axis) for the two terms of b and d' = (R w_NB_B) x d - d / tau, as
/// MotionModel::drag says; with f_N and tau by `model`. The paper's eqn:RSE_predict1 is
/// `hover` with d = b = 0, a platform at rest and w_NB_B = 0. Second order in dt (the
/// paper: first); at 10 ms and the rates of a landing the rest is below a micrometre,
/// at 50 ms below a tenth of a millimetre. `F`, when given, receives the derivative by
/// the tangent.
MotionState extrapolate(const MotionState& state, const PredictionInput& input,
                        Seconds dt, const MotionModel& model = {},
                        Matrix15* F = nullptr);

/// Covariance that `noise` adds over `dt` s >= 0, short against MotionModel::memory_s.
/// `z_N` is z of B in N. ProcessNoise::turn is not in it.
Matrix15 process_covariance(const ProcessNoise& noise, Seconds dt,
                            const Vector3& z_N = Vector3::UnitZ(), bool drag = false);

/// x [+] d and a [-] b with the disturbances.
MotionState boxplus(const MotionState& state, const Vector15& d);
Vector15 boxminus(const MotionState& a, const MotionState& b);

}  // namespace alight
