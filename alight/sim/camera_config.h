#pragma once
#include <array>

#include "alight/base/result.h"
#include "alight/geometry/led_frame.h"
#include "alight/geometry/rig.h"

namespace alight {

/// How the simulated camera sees (scenario: camera). Counts are 8-bit grey levels.
struct CameraSimConfig {
  double exposure_ms = 0;      ///< 0: as the rig says. Brightness is linear in it.
  double noise = 1;            ///< Scale of read and shot noise; 0 is none.
  double shot_noise = 1;       ///< Scale of shot noise alone, on top of `noise`.
  double dark_level = 4;       ///< Mean of the unlit picture, counts.
  double read_noise_sd = 1.5;  ///< Counts, at noise 1.

  double psf_sd_px = 0.8;  ///< Of a point.
  double led_diameter_mm = 4;
  double led_peak_at_1m = 1200;  ///< Of a point LED seen head on from 1 m, 2 ms.
  double led_peak_max = 2000;    ///< What the camera's own settings hold it down to.
  Vector3 led_axis_B = Vector3::UnitX();  ///< Where LEDs shine brightest (leds_face).
  double led_half_power_deg = 60;         ///< Off that axis.
  double led_brightness_spread = 0.15;    ///< sd of the logarithm, drawn per LED.
  /// Factor on the brightness of each LED; 0 is a dead one.
  std::array<double, kMaxLeds> led_gain = all_leds(1);
  double halo = 0.04;  ///< Height of the coloured halo, share of the core.
  double halo_sd_px = 2.4;
  bool hidden_by_body = true;  ///< Hull, arms and propellers hide LEDs.

  int lights = 40;               ///< Bright pieces of ceiling lights in the room.
  double room_radius_m = 10;     ///< The lights lie within it of the origin of I.
  double pad_reflectance = 0.2;  ///< Of the pad at grazing angles; 0 is matt.
  /// White paper of a tag on the drone, lit by the room alone, at 2 ms; counts.
  double tag_white = 45;
  int jpeg = 0;  ///< Quality 1 to 100; 0 is uncompressed.

  double depth_noise = 0.0063;     ///< sd of depth is this times z^2, m.
  double depth_hole_share = 0.25;  ///< Of LED patches without depth.
  double depth_offset_ms = 0;      ///< Capture of depth after mid-exposure of colour;
                                   ///< who samples the scene applies it.

  /// Names the first field out of range, its value and its bounds.
  Result<void> validate() const;

  static constexpr std::array<double, kMaxLeds> all_leds(double gain) {
    std::array<double, kMaxLeds> gains{};
    gains.fill(gain);
    return gains;
  }
};

/// Where LEDs of a drone face that was built for this rig: level, from the pad's middle
/// to the lens; +x where that stands above it. In B, of a drone that stands as it
/// lands.
Vector3 leds_face(const Rig& rig);

}  // namespace alight
