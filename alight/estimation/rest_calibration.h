#pragma once
#include <span>

#include "alight/base/result.h"
#include "alight/estimation/led_information.h"
#include "alight/geometry/rig.h"

namespace alight {

/// What is not known of a rig, and of how a drone stands on its pad; standard
/// deviations, all constant while it stands there.
struct RestCalibrationConfig {
  double led_sd_m = 0.002;  ///< Each coordinate of each LED.
  double mount_position_sd_m = 0.005;
  double mount_rotation_sd_deg = 1;
  double focal_sd_share = 0.005;
  double principal_sd_px = 3;
  double pixel_sd_px = 0.15;  ///< Of an LED's mean image.
  // How it stands: anywhere near the middle, upright, on its feet.
  double place_sd_m = 0.06;     ///< x and y
  double height_sd_m = 0.003;   ///< Of the gear height.
  double tilt_sd_deg = 3;       ///< LED frame against the feet, roll and pitch.
  double heading_sd_deg = 10;   ///< About z of N.
  double chi2_max_per_led = 6;  ///< Beyond, it does not stand there.

  Result<void> validate() const;
};

/// The rig as the drone at rest shows it to be.
struct RestFit {
  Camera camera;
  Constellation leds;
  LedCovariance led_cov;         ///< What is still not known of them.
  Pose X_NB = Pose::Identity();  ///< Where it stands.
  double rms_before_px = 0;      ///< Of the best pose with the rig as written.
  double rms_px = 0;             ///< With the rig as found.
  double chi2 = 0;               ///< Of images and of all that was taken for known.
};

/// A drone on its pad stands upright and at gear height, which makes it a target to
/// measure by: the most probable pose, LED positions, camera mount and lens together
/// (maximum a posteriori, Gauss-Newton), from the images of its LEDs. What one place
/// cannot tell stays as written. No allocation.
///
/// @param X_NB_rest  Where it is expected to stand; its x, y and heading by place_sd_m
///                   and heading_sd_deg.
/// @returns too_few_points (fewer than 4 observations, or one of an LED the rig does
///          not have), degenerate (the drone does not stand there, or the rig is worse
///          than the config says), no_convergence.
Result<RestFit> calibrate_at_rest(const RestCalibrationConfig& config,
                                  const Camera& camera, const Constellation& leds,
                                  std::span<const LedObservation> seen,
                                  const Pose& X_NB_rest);

}  // namespace alight
