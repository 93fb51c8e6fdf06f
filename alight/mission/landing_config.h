#pragma once
#include "alight/control/attitude_controller.h"
#include "alight/control/pid_controller.h"
#include "alight/mission/link_monitor.h"
#include "alight/mission/mission_config.h"
#include "alight/mission/relative_estimator.h"
#include "alight/platform/platform_tracker.h"

namespace alight {

/// What the autopilot is sent.
enum class ControlInterface : std::uint8_t {
  attitude,  ///< Attitude and thrust.
  motion,    ///< Velocity and acceleration that make the autopilot do the same.
  velocity   ///< Velocity (the paper's `pid`).
};

/// All settings of LandingSystem.
struct LandingConfig {
  RelativeEstimatorConfig estimator;
  PlatformTrackerConfig platform;
  LinkMonitorConfig link;
  MissionConfig mission;
  ControlInterface interface = ControlInterface::attitude;
  DroneResponseConfig response;
  AttitudeControllerConfig attitude;
  PidControllerConfig pid;

  bool delay_compensation = true;   ///< Acts for when a set-point takes effect.
  bool dead_reckoning = true;       ///< Unseen, the drone is where its own velocity has
                                    ///< taken it (DeadReckoning).
  double event_age_max_s = 0.5;     ///< Older events are counted and refused.
  double heading_smoothing = 0.05;  ///< Share of the newest heading difference.
  // The odometry's share in the pose the autopilot is sent.
  double odometry_position_sd_m = 0.02;
  double odometry_rotation_sd_deg = 1;
  double odometry_velocity_sd_m_s = 0.05;
  /// So well the drone's velocity must be known (sd in any direction) for that pose to
  /// be sent: the autopilot would lean against a drift that there is not.
  double external_velocity_sd_max_m_s = 0.3;
  /// From the floor, in the air: the first such pose goes out once the drone is no
  /// faster than this over the ground, or after `first_pose_wait_s`.
  double first_pose_speed_max_m_s = 0.6;
  double first_pose_wait_s = 2.5;

  Result<void> validate() const;

  static LandingConfig standard(const Rig& rig);
  /// The paper's method: its estimator, its PID, its end at 0.14 m with a cut of
  /// thrust.
  static LandingConfig paper(const Rig& rig);
};

}  // namespace alight
