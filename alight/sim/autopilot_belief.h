#pragma once
#include <array>

#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/setpoint.h"

namespace alight {

/// What the firmware's estimator gets wrong.
struct AutopilotBeliefConfig {
  bool external_pose = true;
  double dead_reckoning_s = 2;  ///< So long after the last pose it has a velocity
                                ///< (EKF2_NOAID_TOUT, 5 unless set; docs/faults.md).
  double tilt_error_deg = 1;    ///< Bound; fixed in the airframe, drawn.
  double heading_drift_deg_min = 10;  ///< Bound, drawn; without external pose only.
  double heading_tau_s = 2;           ///< How slowly the heading follows the pose sent.
  double velocity_tau_s = 0.3;        ///< How slowly the velocity does.
  double velocity_noise_m_s = 0.05;   ///< sd of what it adds, each axis.
  double gravity_pull_per_s = 0.025;  ///< Without external pose, the specific force is
                                      ///< taken for vertical, this much.
};

/// The autopilot's attitude and velocity estimate, in its own inertial frame: that of
/// the external pose, or one of any heading without it.
///
/// Not a filter of its own sensors but the truth plus errors that grow and are
/// corrected as the real one's do. The frame it speaks of is F, the airframe's.
class AutopilotBelief {
 public:
  AutopilotBelief(const AutopilotBeliefConfig& config, Rng rng);

  /// @param f_F Specific force at the IMU, m/s^2. @param climb dz/dt, of a barometer.
  void step(const Matrix3& R_IF, const Vector3& f_F, double climb, Time now,
            Seconds dt);

  void fuse(const ExternalPose& pose, Time now);

  /// Its estimator starts anew, off by `turn` rad and `v_I` m/s from where it was.
  void reset(double turn, const Vector3& v_I);

  Matrix3 R_IF() const { return R_IF_; }
  const Vector3& v_I() const { return v_reported_; }
  const Vector3& a_I() const { return a_I_; }
  /// Velocity is known: a pose has come and is not older than `dead_reckoning_s`.
  bool velocity_valid(Time now) const;

 private:
  /// Turns and pushes all that is believed, of now and of the past.
  void correct(double turn, const Vector3& v_I);

  struct Past {
    Time t = 0;
    double yaw = 0;
    Vector3 v_I = Vector3::Zero();
  };

  AutopilotBeliefConfig config_;
  Rng rng_;
  Vector3 tilt_F_;
  Vector3 pull_I_ = Vector3::Zero();
  double heading_;        ///< Of the belief's frame against I, rad.
  double heading_drift_;  ///< rad/s
  Matrix3 R_IF_ = Matrix3::Identity();
  Vector3 v_I_ = Vector3::Zero();
  Vector3 noise_I_ = Vector3::Zero();
  Vector3 v_reported_ = Vector3::Zero();
  Vector3 a_I_ = Vector3::Zero();

  static constexpr std::size_t kPast = 256;
  std::array<Past, kPast> past_{};
  std::size_t count_ = 0;
  bool aligned_ = false;
  std::uint32_t resets_ = 0;
  Time pose_received_ = 0;
  Time pose_captured_ = 0;
};

}  // namespace alight
