#pragma once
#include <deque>

#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/rig.h"
#include "alight/geometry/sensor_events.h"
#include "alight/sim/attitude_loop.h"
#include "alight/sim/autopilot_belief.h"
#include "alight/sim/scenario.h"

namespace alight {

/// The firmware's settings; defaults as PX4 1.16 has them or was measured to behave.
struct AutopilotConfig {
  AttitudeLoopConfig attitude;
  AutopilotBeliefConfig belief;
  double hover_share = 0.5;  ///< MPC_THR_HOVER to begin with; learnt while its own
                             ///< velocity loop flies.
  double arming_s = 0.3;
  double loss_s = 0.3;  ///< COM_OF_LOSS_T: set-points older than this are lost.
  LinkLossAction loss_action = LinkLossAction::land;  ///< COM_OBL_RC_ACT and its like
  double velocity_p = 1.8;  ///< MPC_XY_VEL_P_ACC and so on, 1/s
  double velocity_i = 0.4;  ///< 1/s^2
  double velocity_d = 0.2;
  double velocity_p_z = 4;
  double velocity_i_z = 2;
  double tilt_max_deg = 35;      ///< In velocity and landing modes.
  double land_speed_m_s = 0.42;  ///< MPC_LAND_SPEED, 0.7 unless set (docs/faults.md)
  double descend_speed_m_s = 0.5;
  double land_jerk_m_s3 = 4;          ///< MPC_JERK_AUTO: the sink speed it asks for
  double land_acceleration_m_s2 = 3;  ///< changes smoothly; MPC_ACC_DOWN_MAX.
  double land_disarm_s = 2;           ///< From touch to motors off.
  double idle = 0.05;                 ///< Motor share on the ground, armed.
};

/// A flight controller in the manner of PX4 1.16, as seen through its set-points and
/// its telemetry: attitude and thrust, or velocity, acceleration and heading, are
/// followed by a cascade that ends at the motors. When set-points stop it lands by
/// itself, braking over the ground by the pose it was sent, blind once that is a second
/// old, and disarms some time after touch. Flown without that pose it levels and
/// descends, and its motors go on turning; LinkLossAction says what else it may do.
class Autopilot {
 public:
  Autopilot(const AutopilotConfig& config, const DroneSpec& drone, Rng rng);

  void receive(const Setpoint& setpoint, Time sent, Time now);
  void receive(const ExternalPose& pose, Time now) { belief_.fuse(pose, now); }
  void receive(AutopilotOrder order, Time now);

  /// The safety pilot's switch: it holds its place, deaf to set-points.
  void hold(bool on) { held_ = on; }
  /// It will not arm.
  void refuse(bool on) { refuses_ = on; }
  /// Its estimator starts anew, off by `turn` rad and `v_I` m/s.
  void reset(double turn, const Vector3& v_I) { belief_.reset(turn, v_I); }

  /// What its sensors feel.
  struct Sensed {
    Matrix3 R_IF = Matrix3::Identity();
    Vector3 w_F = Vector3::Zero();  ///< rad/s
    Vector3 f_F = Vector3::Zero();  ///< m/s^2
    double climb = 0;               ///< m/s
    double battery = 1;
  };
  /// One step of `dt` s. @returns the motor commands.
  RotorShares step(const Sensed& sensed, Time now, Seconds dt);

  bool motors_running() const { return armed_; }
  AutopilotMode mode() const { return mode_; }
  const AutopilotBelief& belief() const { return belief_; }
  /// What it tells: its belief at `now`, with the gyros' noise.
  AutopilotTelemetry telemetry(Time now);

 private:
  struct Queued {
    Setpoint setpoint;
    Time in_force;
  };
  void choose_mode(Time now);
  void disarm();
  RotorShares follow(const Setpoint& setpoint, Time now, Seconds dt);
  RotorShares follow_velocity(const Vector3& v_I, const Vector3& a_I, double yaw,
                              bool blind, Seconds dt);
  RotorShares without_setpoints(Time now, Seconds dt);
  RotorShares land(double speed, bool disarms, Time now, Seconds dt);
  RotorShares idle();

  AutopilotConfig config_;
  AttitudeLoop attitude_;
  AutopilotBelief belief_;
  Rng rng_;
  double hover_share_;

  bool armed_ = false;
  Time arming_until_ = 0;
  bool arming_ = false;
  bool told_to_land_ = false;
  bool held_ = false;
  bool refuses_ = false;
  bool on_ground_ = true;  ///< When it was left alone.
  AutopilotMode mode_ = AutopilotMode::manual;

  std::deque<Queued> queue_;  ///< Received, not yet in force.
  Setpoint setpoint_;
  Time newest_sent_ = 0;
  Time last_received_ = 0;
  bool any_received_ = false;

  Vector3 integral_ = Vector3::Zero();  ///< m/s^2
  double thrust_ = 0;                   ///< Last collective, share.
  double thrust_felt_ = 0;              ///< The same behind the motors' lag.
  double motor_tau_;
  double alone_yaw_ = 0;   ///< Kept while no set-points are followed.
  double height_off_ = 0;  ///< From where it holds its place, m.
  double land_v_ = 0;      ///< Climb speed asked for while it lands, m/s,
  double land_a_ = 0;      ///< and its rate of change.
  Seconds still_for_ = 0;
  Sensed sensed_;
};

}  // namespace alight
