#pragma once
#include "alight/base/time.h"
#include "alight/sim/rotors.h"

namespace alight {

/// The firmware's attitude and rate control, and its mixer. From a set-point's arrival
/// to the attitude the drone answers as a second-order lag of `omega` and `zeta` after
/// a dead time: `delay_ms` here and 1 / `pole` of the loop's third pole make up the 40
/// ms that were measured on PX4 1.16.
struct AttitudeLoopConfig {
  double omega_rad_s = 10;
  double zeta = 0.55;
  double pole_rad_s = 80;
  double delay_ms = 27.5;
  double rate_max_rad_s = 3.8;      ///< Roll and pitch,
  double yaw_rate_max_rad_s = 2.0;  ///< and yaw, that an attitude error may ask for.
  double observer_rad_s = 8;        ///< How fast a constant moment is learnt.
};

/// Attitude set-point to motor commands, with the rig file's inertia, thrust and motors
/// (the ones that fly differ, which the disturbance observer has to make up for).
class AttitudeLoop {
 public:
  AttitudeLoop(const AttitudeLoopConfig& config, const DroneSpec& drone);

  /// @param R_IF, w_F  Attitude as the autopilot believes it, and its gyros, rad/s.
  /// @param R_sp       Attitude wanted, in the autopilot's frame.
  /// @param thrust     Collective, share of the maximum.
  RotorShares step(const Matrix3& R_IF, const Vector3& w_F, const Matrix3& R_sp,
                   double thrust, Seconds dt);

  void reset();

 private:
  RotorShares mix(double thrust, const Vector3& acceleration) const;
  Vector3 acceleration_of(const RotorShares& shares) const;

  AttitudeLoopConfig config_;
  RotorLayout layout_;
  Vector3 inertia_;
  double motor_tau_;
  double hover_share_;
  double k_angle_, k_rate_, k_acceleration_;
  RotorShares motors_{};                   ///< As the loop thinks they turn.
  Vector3 w_model_ = Vector3::Zero();      ///< rad/s
  Vector3 disturbance_ = Vector3::Zero();  ///< rad/s^2, learnt
};

}  // namespace alight
