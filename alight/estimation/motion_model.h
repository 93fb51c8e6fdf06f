#pragma once
#include <Eigen/Core>
#include <cstdint>

#include "alight/base/time.h"
#include "alight/geometry/platform_state.h"
#include "alight/geometry/relative_state.h"

namespace alight {

using Vector12 = Eigen::Matrix<double, 12, 1>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

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
};

/// The state with what the model does not know: d_N, the acceleration by wind, drag,
/// thrust error and tilt error, in N, m/s^2. Tangent: (p, R, v, d), R on the right.
struct MotionState {
  RelativeState x;
  Vector3 d_N = Vector3::Zero();
};

/// Spectral densities of the white noise that drives the model (continuous time).
struct ProcessNoise {
  double rate = 0.2;          ///< of w_NB_B, rad/s per sqrt(Hz)
  double acceleration = 0.3;  ///< of v_NB', m/s^2 per sqrt(Hz)
  double disturbance = 1.0;   ///< random walk of d_N, m/s^3 per sqrt(Hz)
};

/// Carries a state over `dt` s (may be negative):
///   p' = v,  R' = R hat(w_NB_B),  d' = -w_IN x d   (d is constant in I)
///   v' = f_N + d + R_NI g - a_IN - 2 w x v - w x (w x p) - alpha x p
/// with f_N by `model`. The paper's eqn:RSE_predict1 is `hover` with d = 0, a platform
/// at rest and w_NB_B = 0. Second order in dt (the paper: first); at 10 ms and the
/// rates of a landing the rest is below a micrometre, at 50 ms below a tenth of a
/// millimetre. `F`, when given, receives the derivative by the tangent.
MotionState extrapolate(const MotionState& state, const PredictionInput& input,
                        Seconds dt, ProcessModel model = ProcessModel::set_points,
                        Matrix12* F = nullptr);

/// As above for the relative state alone, the disturbance given.
RelativeState extrapolate(const RelativeState& x, const Vector3& d_N,
                          const PredictionInput& input, Seconds dt,
                          ProcessModel model = ProcessModel::set_points);

/// Covariance that `noise` adds over `dt` s >= 0.
Matrix12 process_covariance(const ProcessNoise& noise, Seconds dt);

/// x [+] d and a [-] b with the disturbance.
MotionState boxplus(const MotionState& state, const Vector12& d);
Vector12 boxminus(const MotionState& a, const MotionState& b);

}  // namespace alight
