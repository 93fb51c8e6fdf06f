#pragma once
#include "alight/geometry/drone_response.h"
#include "alight/geometry/setpoint.h"

namespace alight {

/// What the autopilot will believe of its own motion when a set-point takes effect, in
/// its inertial frame.
struct OwnMotion {
  Vector3 v_IB = Vector3::Zero();  ///< m/s
  Vector3 a_IB = Vector3::Zero();  ///< m/s^2, without weight
};

/// The velocity set-point with which an autopilot that takes no attitudes does what
/// `attitude` asks: its own velocity, so that its velocity loop is at rest, and the
/// acceleration of that thrust in that direction, with what its damping takes away of
/// it. Its loop is PX4's (DroneResponseConfig::velocity_damping); how much thrust
/// carries the drone it knows by itself.
///
/// @pre attitude.kind is attitude.
Setpoint as_motion(const Setpoint& attitude, const OwnMotion& own, double yaw_rate,
                   const DroneResponseConfig& response);

}  // namespace alight
