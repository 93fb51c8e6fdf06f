#pragma once
#include "alight/geometry/rig.h"

namespace alight::test {

/// The authors' rig, camera and LEDs turned about the pad's middle by `angle`.
inline Rig turned_rig(double angle) {
  Rig rig = alan_rig();
  const Matrix3 turn = from_rpy(0, 0, angle);
  rig.camera.X_NC = make_pose(turn, Vector3::Zero()) * rig.camera.X_NC;
  for (Led& led : rig.leds.leds) led.p_BL = turn * led.p_BL;
  return rig;
}

}  // namespace alight::test
