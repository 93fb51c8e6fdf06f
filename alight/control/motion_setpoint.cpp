#include "alight/control/motion_setpoint.h"

#include <cassert>

#include "alight/geometry/so3.h"

namespace alight {

Setpoint as_motion(const Setpoint& attitude, const OwnMotion& own, double yaw_rate,
                   const DroneResponseConfig& response) {
  assert(attitude.kind == Setpoint::Kind::attitude);
  const Matrix3 R_IB = attitude.q_IB.toRotationMatrix();
  const double thrust = attitude.thrust * response.thrust_to_weight * kGravity;
  Setpoint out;
  out.kind = Setpoint::Kind::velocity;
  out.v_IB = own.v_IB;
  out.a_IB = thrust * R_IB.col(2) - kGravity * Vector3::UnitZ();
  out.a_IB.head<2>() += response.velocity_damping * own.a_IB.head<2>();
  out.yaw = yaw_of(R_IB);
  out.yaw_rate = yaw_rate;
  return out;
}

}  // namespace alight
