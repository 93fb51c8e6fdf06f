#include "alight/estimation/relative_filter_config.h"

#include <cmath>
#include <sstream>

namespace alight {
namespace {

struct Range {
  const char* field;
  double value;
  double low;
  double high;
};

}  // namespace

Result<void> RelativeFilterConfig::validate() const {
  const Range ranges[] = {
      {"noise.rate", noise.rate, 0, 100},
      {"noise.acceleration", noise.acceleration, 0, 1000},
      {"noise.disturbance", noise.disturbance, 0, 1000},
      {"noise.updraught", noise.updraught, 0, 1000},
      {"noise.bias", noise.bias, 0, 1000},
      {"noise.thrust", noise.thrust, 0, 1000},
      {"noise.turn", noise.turn, 0, 1000},
      {"disturbance_memory_s", disturbance_memory_s, 1, 1e6},
      {"disturbance_sd", disturbance_sd, 1e-6, 100},
      {"updraught_sd", updraught_sd, 1e-6, 100},
      {"bias_sd", bias_sd, 1e-6, 100},
      {"lift_sd", lift_sd, 1e-6, 100},
      {"variance_per_frame", variance_per_frame, 0, 100},
      {"pixel_sd_px", pixel_sd_px, 0, 100},
      {"led_position_sd_m", led_position_sd_m, 0, 0.1},
      {"led_supposed_sd_m", led_supposed_sd_m, 0, 0.1},
      {"led_white_share", led_white_share, 0, 1},
      {"led_aspect_sd_m", led_aspect_sd_m, 0, 0.1},
      {"depth_sd_m", depth_sd_m, 1e-6, 10},
      {"depth_sd_share", depth_sd_share, 0, 1},
      {"mount_position_sd_m", mount_position_sd_m, 0, 1},
      {"mount_rotation_sd_rad", mount_rotation_sd_rad, 0, 1},
      {"focal_sd_share", focal_sd_share, 0, 1},
      {"velocity_variance", velocity_variance, 0, 1e6},
      {"velocity_alpha", velocity_alpha, 0, 1},
      {"max_iterations", static_cast<double>(max_iterations), 1, 100},
      {"tolerance", tolerance, 1e-12, 1},
      {"min_observations", static_cast<double>(min_observations), 1, kMaxLeds},
      {"gate_chi2", gate_chi2, 0, 1e6},
      {"huber_sd", huber_sd, 0, 1e6},
  };
  for (const Range& r : ranges) {
    if (r.value >= r.low && r.value <= r.high) continue;
    std::ostringstream detail;
    detail << "estimation." << r.field << ": " << r.value << " is outside [" << r.low
           << ", " << r.high << "]";
    return fail(Fault::invalid_config, detail.str());
  }
  if (!use_observation_cov && pixel_sd_px < 1e-3) {
    return fail(
        Fault::invalid_config,
        "estimation.pixel_sd_px: at least 0.001 when use_observation_cov is off");
  }
  if (variance_per_frame <= 0 && (noise.rate <= 0 || noise.acceleration <= 0)) {
    return fail(Fault::invalid_config,
                "estimation.noise: rate and acceleration must be positive when "
                "variance_per_frame is 0");
  }
  return {};
}

RelativeFilterConfig RelativeFilterConfig::paper() {
  RelativeFilterConfig c;
  c.model = ProcessModel::hover;
  c.platform_motion = false;
  c.estimate_disturbance = false;
  c.noise = {.rate = 0,
             .acceleration = 0,
             .disturbance = 0,
             .updraught = 0,
             .bias = 0,
             .thrust = 0};
  c.variance_per_frame = 0.016;
  c.use_observation_cov = false;
  c.pixel_sd_px = std::sqrt(0.008);
  c.velocity_variance = 0.016;
  c.velocity_alpha = 0.04;
  c.max_iterations = 25;
  c.tolerance = 0.01;
  c.min_observations = 4;
  c.gate_chi2 = 0;
  c.huber_sd = 0;
  return c.with_perfect_rig();
}

RelativeFilterConfig RelativeFilterConfig::camera_only() {
  RelativeFilterConfig c;
  c.model = ProcessModel::hover;
  // A drone's force lies along z of B, so that its attitude tells of its acceleration;
  // how large it is, and how fast the drone turns, changes within tenths of a second,
  // its drag and what pushes it aside hardly.
  c.estimate_drag = true;
  c.noise = {.rate = 0.006,
             .acceleration = 0.006,
             .disturbance = 0.2,
             .updraught = 0.2,
             .bias = 0.01,
             .thrust = 5,
             .turn = 2};
  c.updraught_sd = c.disturbance_sd;
  c.bias_sd = c.lift_sd = 0.2;
  c.pixel_sd_px = 0.005;
  // The pose against the camera: where that stands, its pictures do not tell.
  c = c.with_perfect_rig();
  c.learn_from_residuals = true;
  c.led_aspect_sd_m = 0;
  return c;
}

RelativeFilterConfig RelativeFilterConfig::with_perfect_rig() const {
  RelativeFilterConfig c = *this;
  c.led_position_sd_m = 0;
  c.mount_position_sd_m = 0;
  c.mount_rotation_sd_rad = 0;
  c.focal_sd_share = 0;
  return c;
}

}  // namespace alight
