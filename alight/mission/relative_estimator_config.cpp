#include "alight/mission/relative_estimator.h"

namespace alight {
Result<void> RelativeEstimatorConfig::validate() const {
  if (auto good = blobs.validate(); !good) return good;
  if (auto good = finder.validate(); !good) return good;
  if (auto good = tracker.validate(); !good) return good;
  if (auto good = resolver.validate(); !good) return good;
  if (auto good = filter.validate(); !good) return good;
  if (auto good = rest.validate(); !good) return good;
  if (auto good = learner.validate(); !good) return good;
  if (auto good = errors.validate(); !good) return good;
  if (!(prediction_step_ms >= 1 && prediction_step_ms <= 50)) {
    return fail(Fault::invalid_config, "prediction_step_ms must lie in [1, 50]");
  }
  if (frozen_pictures < 0 || frozen_pictures == 1) {
    return fail(Fault::invalid_config, "frozen_pictures must be 0 or at least 2");
  }
  if (misses_before_search < 1) {
    return fail(Fault::invalid_config, "misses_before_search must be at least 1");
  }
  if (!(forget_after_s > 0 && reprojection_max_px > 0 && search_gate_m >= 0)) {
    return fail(
        Fault::invalid_config,
        "forget_after_s, reprojection_max_px and search_gate_m must be positive");
  }
  if (!(reach_m >= 0 && reach_m_s >= 0)) {
    return fail(Fault::invalid_config, "reach_m and reach_m_s must not be negative");
  }
  if (!(told_sd_m >= 0 && told_sd_deg >= 0 && coast_s >= 0)) {
    return fail(Fault::invalid_config,
                "told_sd_m, told_sd_deg and coast_s must not be negative");
  }
  if (!(reckoned_sd_m_s > 0 && found_sd_m_s > 0)) {
    return fail(Fault::invalid_config,
                "reckoned_sd_m_s and found_sd_m_s must be positive");
  }
  if (!(placed_sd_px > 0 && placed_sds > 0)) {
    return fail(Fault::invalid_config, "placed_sd_px and placed_sds must be positive");
  }
  return {};
}

RelativeEstimatorConfig RelativeEstimatorConfig::paper() {
  RelativeEstimatorConfig config;
  config.blobs.smooth = true;
  config.blobs.depth_threshold_m = 2.5;  // the effective landing distance
  config.blobs.grey_threshold = 150;     // its initialization bears no mirror image
  config.blobs.dim_threshold = 0;
  config.finder.profile = LedFinderConfig::Profile::paper;
  config.tracker.profile = LedTrackerConfig::Profile::paper;
  config.filter = RelativeFilterConfig::paper();
  config.reprojection_max_px = 10;
  config.calibrate_at_rest = false;
  config.learn_led_errors = false;
  config.tell_apart = false;
  config.learn_gamma = false;
  config.heed_noise = false;
  config.keep_rivals = false;
  config.search_lean_deg = 180;
  config.reach_m_s = 0;
  return config;
}

RelativeEstimatorConfig RelativeEstimatorConfig::camera_only() {
  RelativeEstimatorConfig config;
  config.prediction_step_ms = 50;  // nothing happens between pictures
  config.frozen_pictures = 2;
  config.told_when_it_rests = false;
  config.search_lean_deg = 180;
  config.reach_m_s = 0;
  config.filter = RelativeFilterConfig::camera_only();
  config.found_sd_m_s = 0.7;        // drones before a camera reach 1.8 m/s
  config.learn_led_errors = false;  // how far they are off, is to be learnt, too
  config.learn_leds = true;
  config.tell_led_frame = true;
  // Three of them lie within the limits of a wrong pose, 0.15 m and 15 deg.
  config.coast_s = 0.15;  // lamps hide a drone that passes them for as long
  config.told_sd_m = 0.05;
  config.told_sd_deg = 5;
  config.suppose_gamma_after = 4;
  config.learn_leds_from_m = 0.0008;  // what noise may feign, seen from 3 m, is less
  return config;
}

}  // namespace alight
