#pragma once
#include <Eigen/Geometry>
#include <cstdint>

#include "alight/base/time.h"
#include "alight/geometry/relative_state.h"

namespace alight {

/// What goes to the autopilot, in I.
struct Setpoint {
  enum class Kind : std::uint8_t {
    none,      ///< Nothing is sent.
    attitude,  ///< q_IB, thrust
    velocity,  ///< v_IB, a_IB, yaw, yaw rate
  };
  Kind kind = Kind::none;

  Eigen::Quaterniond q_IB = Eigen::Quaterniond::Identity();
  double thrust = 0;  ///< Collective, share of the maximum, 0 to 1.

  Vector3 v_IB = Vector3::Zero();  ///< m/s
  Vector3 a_IB = Vector3::Zero();  ///< m/s^2, added to the autopilot's own
  double yaw = 0;                  ///< rad
  double yaw_rate = 0;             ///< rad/s
};

/// Orders beside the stream of set-points.
enum class AutopilotOrder : std::uint8_t {
  none,
  arm,
  disarm,  ///< On the ground: motors stop.
  land,    ///< The autopilot's own landing mode.
};

/// X_IB for the autopilot's own estimator.
struct ExternalPose {
  Time captured = 0;
  Pose X_IB = Pose::Identity();
  Vector3 v_IB = Vector3::Zero();             ///< m/s, in I
  Covariance9 cov = Covariance9::Identity();  ///< [p, R, v], with the odometry's share
  std::uint32_t resets = 0;  ///< Counts jumps of the odometry: a reset, not motion.
};

}  // namespace alight
