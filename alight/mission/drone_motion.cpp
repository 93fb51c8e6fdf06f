#include "alight/mission/drone_motion.h"

namespace alight {

PredictionInput DroneMotion::at(Time t, const RelativeState& x) const {
  PredictionInput input;
  input.platform = platform_.at(t);
  if (on_ground) {
    // It rests on the platform: whatever force that takes.
    input.f_N =
        inertial_acceleration_N(input.platform, x.p_NB, x.v_NB, Vector3::Zero()) -
        gravity_N(input.platform);
    return input;
  }
  const DroneResponse::Sample sample = response_.at(t);
  const Vector3 f_I = from_rpy(0, 0, -autopilot_heading) * sample.f_I();
  const Vector3 thrust_N = input.platform.X_IN.linear().transpose() * f_I;
  input.lift_N = thrust_N / kGravity;
  input.f_N =
      thrust_N - drag_per_s_ * inertial_velocity_N(input.platform, x.p_NB, x.v_NB);
  input.w_NB_B = sample.w_IB_B - x.R_NB.transpose() * input.platform.w_IN_N;
  return input;
}

}  // namespace alight
