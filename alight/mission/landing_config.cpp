#include "alight/mission/landing_config.h"

namespace alight {

Result<void> LandingConfig::validate() const {
  if (auto good = estimator.validate(); !good) return good;
  if (auto good = platform.validate(); !good) return good;
  if (auto good = mission.validate(); !good) return good;
  if (auto good = response.validate(); !good) return good;
  if (auto good = attitude.validate(); !good) return good;
  if (auto good = pid.validate(); !good) return good;
  if (!(event_age_max_s > 0 && heading_smoothing > 0 && heading_smoothing <= 1)) {
    return fail(Fault::invalid_config,
                "event_age_max_s must be positive, heading_smoothing a share");
  }
  if (!(external_velocity_sd_max_m_s > 0)) {
    return fail(Fault::invalid_config, "external_velocity_sd_max_m_s must be positive");
  }
  if (!(first_pose_speed_max_m_s > 0)) {
    return fail(Fault::invalid_config, "first_pose_speed_max_m_s must be positive");
  }
  if (!(first_pose_wait_s > 0)) {
    return fail(Fault::invalid_config, "first_pose_wait_s must be positive");
  }
  return {};
}

LandingConfig LandingConfig::standard(const Rig& rig) {
  LandingConfig config;
  config.estimator.frozen_pictures = 2;
  config.estimator.finder.pad_hides = true;
  // A search flies on the prediction, for as long as the mission says,
  // and it then takes a second to stop over the ground.
  config.estimator.forget_after_s = config.mission.give_up_s + 1.5;
  config.response.thrust_to_weight = rig.drone.thrust_to_weight;
  config.response.motor_ms = rig.drone.motor_ms;
  config.response.tilt_max_deg = rig.drone.tilt_max_deg;
  return config;
}

LandingConfig LandingConfig::paper(const Rig& rig) {
  LandingConfig config = standard(rig);
  config.estimator = RelativeEstimatorConfig::paper();
  config.dead_reckoning = false;
  config.interface = ControlInterface::velocity;
  config.mission.cut_height_m = 0.14;
  config.mission.wait_error_m = 0;
  config.mission.flare_s = 0;
  config.mission.square_up_s = 0;
  config.mission.quiet_deg = 0;
  config.mission.follow_distance = 2.3;  // farther off LEDs merge, which it cannot bear
  config.mission.rendezvous_distance = 2;
  config.mission.settle_error_m = 0.6;  // its controller trails a moving platform
  config.mission.go_around_error_m = 0.8;
  return config;
}

}  // namespace alight
