#include <sstream>

#include "alight/vision/led_finder.h"

namespace alight {

Result<void> LedFinderConfig::validate() const {
  const auto out = [](const char* name, double value, const char* bounds) {
    std::ostringstream text;
    text << "finder." << name << " is " << value << ", must lie in " << bounds;
    return fail(Fault::invalid_config, text.str());
  };
  if (!(range_min_m >= 0.05 && range_min_m <= 100)) {
    return out("range_min_m", range_min_m, "[0.05, 100]");
  }
  if (!(range_max_m > range_min_m && range_max_m <= 1000)) {
    return out("range_max_m", range_max_m, "(range_min_m, 1000]");
  }
  if (!(tilt_max_deg >= 1 && tilt_max_deg <= 180)) {
    return out("tilt_max_deg", tilt_max_deg, "[1, 180]");
  }
  if (!(tilt_sd_deg > 0 && tilt_sd_deg <= 1e4)) {
    return out("tilt_sd_deg", tilt_sd_deg, "(0, 1e4]");
  }
  if (!(facing_max_deg >= 1 && facing_max_deg <= 180)) {
    return out("facing_max_deg", facing_max_deg, "[1, 180]");
  }
  if (!(attitude_sd_max_deg > 0 && attitude_sd_max_deg <= 180)) {
    return out("attitude_sd_max_deg", attitude_sd_max_deg, "(0, 180]");
  }
  if (!(rms_max_px > 0 && rms_max_px <= 50)) {
    return out("rms_max_px", rms_max_px, "(0, 50]");
  }
  if (!(led_sd_m >= 0 && led_sd_m <= 0.1)) return out("led_sd_m", led_sd_m, "[0, 0.1]");
  if (!(centroid_sd_px > 0 && centroid_sd_px <= 20)) {
    return out("centroid_sd_px", centroid_sd_px, "(0, 20]");
  }
  if (!(merge_px >= 0 && merge_px <= 50)) return out("merge_px", merge_px, "[0, 50]");
  if (!(missing_cost >= 0 && missing_cost <= 1e4)) {
    return out("missing_cost", missing_cost, "[0, 1e4]");
  }
  if (!(mirror_cost >= 0 && mirror_cost <= 1e4)) {
    return out("mirror_cost", mirror_cost, "[0, 1e4]");
  }
  if (!(brightness_sd > 0 && brightness_sd <= 1e4)) {
    return out("brightness_sd", brightness_sd, "(0, 1e4]");
  }
  if (!(runner_up_margin >= 0 && runner_up_margin <= 1e4)) {
    return out("runner_up_margin", runner_up_margin, "[0, 1e4]");
  }
  if (!(false_alarms_max > 0 && false_alarms_max <= 1e6)) {
    return out("false_alarms_max", false_alarms_max, "(0, 1e6]");
  }
  if (work_max < 1) return out("work_max", work_max, "[1, 2^31)");
  if (!(mad_limit_m > 0 && mad_limit_m <= 10)) {
    return out("mad_limit_m", mad_limit_m, "(0, 10]");
  }
  return {};
}

}  // namespace alight
