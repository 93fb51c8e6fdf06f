#include "alight/sim/camera_config.h"

#include <cmath>
#include <sstream>
#include <string>

namespace alight {
namespace {

Result<void> within(const char* field, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  std::ostringstream detail;
  detail << "camera." << field << " is " << value << ", must be in [" << low << ", "
         << high << "]";
  return fail(Fault::invalid_config, detail.str());
}

}  // namespace

Result<void> CameraSimConfig::validate() const {
  struct Bound {
    const char* field;
    double value, low, high;
  };
  const Bound bounds[] = {
      {"exposure_ms", exposure_ms, 0, 100},
      {"noise", noise, 0, 20},
      {"dark_level", dark_level, 0, 128},
      {"read_noise_sd", read_noise_sd, 0, 20},
      {"psf_sd_px", psf_sd_px, 0.3, 10},
      {"led_diameter_mm", led_diameter_mm, 0, 50},
      {"led_peak_at_1m", led_peak_at_1m, 0, 1e6},
      {"led_peak_max", led_peak_max, 1, 1e6},
      {"led_half_power_deg", led_half_power_deg, 5, 85},
      {"led_brightness_spread", led_brightness_spread, 0, 2},
      {"halo", halo, 0, 1},
      {"halo_sd_px", halo_sd_px, 0.3, 20},
      {"lights", static_cast<double>(lights), 0, 1000},
      {"room_radius_m", room_radius_m, 3, 100},
      {"pad_reflectance", pad_reflectance, 0, 1},
      {"jpeg", static_cast<double>(jpeg), 0, 100},
      {"depth_noise", depth_noise, 0, 1},
      {"depth_hole_share", depth_hole_share, 0, 1},
      {"depth_offset_ms", depth_offset_ms, -15, 15},
  };
  for (const Bound& b : bounds) {
    if (auto ok = within(b.field, b.value, b.low, b.high); !ok) return ok;
  }
  return {};
}

}  // namespace alight
