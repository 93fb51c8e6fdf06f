#pragma once
#include "alight/geometry/so3.h"

namespace alight {

/// Flat outputs in N and their derivatives seen from N (paper, eqn:MP_traj): what a
/// trajectory says of one instant and what the controller is asked to follow.
struct FlatState {
  Vector3 p_NB = Vector3::Zero();  ///< m
  Vector3 v_NB = Vector3::Zero();  ///< m/s
  Vector3 a_NB = Vector3::Zero();  ///< m/s^2
  Vector3 j_NB = Vector3::Zero();  ///< m/s^3
  double yaw = 0;                  ///< Heading of B in N, rad
  double yaw_rate = 0;             ///< rad/s
  double yaw_acceleration = 0;     ///< rad/s^2
};

}  // namespace alight
