#include "alight/mission/ablation.h"

namespace alight {

const char* to_string(Part part) {
  switch (part) {
    case Part::replanning:
      return "replanning";
    case Part::escape:
      return "escape";
    case Part::feed_forward:
      return "feed_forward";
    case Part::delay_compensation:
      return "delay_compensation";
    case Part::platform_prediction:
      return "platform_prediction";
    case Part::calibration:
      return "calibration";
  }
  return "unknown";
}

LandingConfig without(Part part, LandingConfig config) {
  switch (part) {
    case Part::replanning:
      config.mission.replan_every_s = 0;
      break;
    case Part::escape:
      config.mission.way_back = false;
      break;
    case Part::feed_forward:
      config.attitude.feed_forward = false;
      break;
    case Part::delay_compensation:
      config.delay_compensation = false;
      break;
    case Part::platform_prediction:
      config.platform.carry_forward = false;
      config.mission.plan_with_turns = false;
      break;
    case Part::calibration:
      config.estimator.calibrate_at_rest = false;
      break;
  }
  return config;
}

}  // namespace alight
