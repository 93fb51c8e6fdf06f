#include "alight/sim/camera_config.h"

#include "alight/base/bounds.h"

namespace alight {
namespace {

constexpr double kBeside = 0.01;  // m; a lens nearer than that stands above the pad

}  // namespace

Result<void> CameraSimConfig::validate() const {
  for (const double gain : led_gain) {
    if (auto good = check_bounds({{"camera.led_gain", gain, 0, 100}}); !good)
      return good;
  }
  return check_bounds({{"camera.exposure_ms", exposure_ms, 0, 100},
                       {"camera.noise", noise, 0, 20},
                       {"camera.shot_noise", shot_noise, 0, 20},
                       {"camera.dark_level", dark_level, 0, 128},
                       {"camera.tag_white", tag_white, 0, 255},
                       {"camera.read_noise_sd", read_noise_sd, 0, 20},
                       {"camera.psf_sd_px", psf_sd_px, 0.3, 10},
                       {"camera.led_diameter_mm", led_diameter_mm, 0, 50},
                       {"camera.led_peak_at_1m", led_peak_at_1m, 0, 1e6},
                       {"camera.led_peak_max", led_peak_max, 1, 1e6},
                       {"camera.led_half_power_deg", led_half_power_deg, 5, 85},
                       {"camera.led_brightness_spread", led_brightness_spread, 0, 2},
                       {"camera.halo", halo, 0, 1},
                       {"camera.halo_sd_px", halo_sd_px, 0.3, 20},
                       {"camera.lights", static_cast<double>(lights), 0, 1000},
                       {"camera.room_radius_m", room_radius_m, 3, 100},
                       {"camera.pad_reflectance", pad_reflectance, 0, 1},
                       {"camera.jpeg", static_cast<double>(jpeg), 0, 100},
                       {"camera.depth_noise", depth_noise, 0, 1},
                       {"camera.depth_hole_share", depth_hole_share, 0, 1},
                       {"camera.depth_offset_ms", depth_offset_ms, -15, 15}});
}

Vector3 leds_face(const Rig& rig) {
  Vector3 level = rig.camera.X_NC.translation();
  level.z() = 0;
  return level.norm() > kBeside ? Vector3(level.normalized()) : Vector3::UnitX();
}

}  // namespace alight
