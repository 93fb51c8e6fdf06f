#pragma once
#include "alight/base/result.h"
#include "alight/geometry/drone_response.h"
#include "alight/geometry/flat_state.h"
#include "alight/geometry/platform_state.h"
#include "alight/geometry/relative_state.h"
#include "alight/geometry/rig.h"

namespace alight {

/// Gains of the default controller. The feedback is on position, velocity and, because
/// the attitude loop is as slow as the position loop, on the modelled specific force.
/// Chosen by control/loop_margins.h; docs/control.md has the numbers.
struct AttitudeControllerConfig {
  double kp = 6;      ///< 1/s^2, horizontal
  double kv = 5;      ///< 1/s
  double ka = 2.45;   ///< on the specific force
  double kp_z = 5.5;  ///< 1/s^2
  double kv_z = 5.6;  ///< 1/s
  double ka_z = 1.5;  ///< on the vertical specific force

  double disturbance_lag_s = 0.2;  ///< Low-pass on d_N before it is countered.

  double drag_per_s = 0.3;   ///< Air resistance by speed over ground, fed forward.
  bool feed_forward = true;  ///< What reference and platform ask for; without it only
                             ///< weight and disturbance are countered.

  double error_max_m = 0.6;             ///< Position errors act as if no larger,
  double velocity_error_max_m_s = 1.5;  ///< nor velocity errors.
  double disturbance_max_m_s2 = 4;      ///< Bound on what is believed of d_N.
  double thrust_min = 0.08;             ///< Share of the maximum
  double thrust_max = 0.95;
  double yaw_step_max_deg =
      25;  ///< Commanded heading leads the model's by at most this.

  Result<void> validate() const;
};

/// Everything at the time the next set-point takes effect,
/// t_eff = now + link delay + the autopilot's dead time.
struct AttitudeInput {
  /// s; over which the wished specific force is differentiated.
  static constexpr Seconds kLater = 0.01;

  PlatformState platform;
  PlatformState platform_later;    ///< As predicted for `kLater` after that.
  RelativeState state;             ///< Estimate carried forward to t_eff.
  DroneResponse::Sample response;  ///< The model's attitude and thrust at t_eff,
  double autopilot_heading = 0;    ///< in the autopilot's frame, in which I's x axis
                                   ///< has this heading, rad.
  Vector3 d_N = Vector3::Zero();   ///< Disturbance fixed in I (wind), m/s^2, and
  Vector3 b_N = Vector3::Zero();   ///< fixed in N (drag, tilt), its z a share of the
                                   ///< thrust times g: the estimator's (MotionState).
  FlatState reference;
  double tilt_limit_rad = 35 * kDegree;  ///< Shrinks as the link ages.
};

struct AttitudeOutput {
  Setpoint setpoint;
  Vector3 p_error_N = Vector3::Zero();  ///< reference - estimate, m
  Vector3 v_error_N = Vector3::Zero();  ///< m/s
  Vector3 f_wish_N = Vector3::Zero();   ///< Specific force wished before limits.
  bool limited = false;                 ///< Tilt or thrust was cut.
  bool invalid = false;  ///< Input was not finite: level, hover thrust, heading kept.
};

/// Specific force, in N, that keeps to `reference` under the disturbance `d_N`.
Vector3 wished_force_N(const PlatformState& platform, const FlatState& reference,
                       const Vector3& d_N, double drag_per_s);

/// Attitude and thrust from the estimate, the reference and the motion of the platform
/// (paper, sec:MP_control: the onboard attitude controller tracks this).
///
///   f   = (a_ref_I + drag v_ref_I - d - g) / (1 + b_z / g),    the force that keeps to
///         the reference, by drones that lift as supposed,
///   u   = f + (2 zeta / omega) f' + kp e_p + kv e_v + ka (f - f_m)
///
/// u over |u| is body z, its vertical part over the model's cos(tilt) the thrust. d is
/// the estimator's disturbance, low-passed: the integral action.
class AttitudeController {
 public:
  /// Error names field, value and bounds.
  static Result<AttitudeController> create(const AttitudeControllerConfig& config,
                                           const DroneResponseConfig& response,
                                           const DroneSpec& drone);

  /// `dt` s since the last step. Without a first step or after `reset` the disturbance
  /// is believed at once.
  AttitudeOutput step(const AttitudeInput& in, Seconds dt);
  void reset() { has_d_ = false; }

  const AttitudeControllerConfig& config() const { return config_; }

 private:
  AttitudeController(const AttitudeControllerConfig&, const DroneResponseConfig&,
                     const DroneSpec&);
  AttitudeControllerConfig config_;
  DroneResponseConfig response_;
  double tilt_max_ = 0;            // rad
  double thrust_full_ = 0;         // m/s^2 at share 1
  Vector3 d_A_ = Vector3::Zero();  // low-passed, in the autopilot's frame
  Vector3 b_N_ = Vector3::Zero();  // low-passed, in N
  bool has_d_ = false;
};

}  // namespace alight
