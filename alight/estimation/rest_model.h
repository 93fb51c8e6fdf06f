#pragma once
#include <optional>
#include <span>

#include "alight/estimation/rest_calibration.h"

namespace alight {

/// A drone at rest before the camera: all that its LEDs' images depend on.
struct Rest {
  Pose X_NB;
  Camera camera;
  Constellation leds;
};

/// Pose (6), mount (6), focal length (1), principal point (2), three for each LED.
inline constexpr int kRestPose = 0, kRestMount = 6, kRestFocal = 12,
                     kRestPrincipal = 13, kRestLeds = 15;
inline constexpr int kRestMost = kRestLeds + 3 * kMaxLeds;
using RestUnknowns = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kRestMost, 1>;
using RestInformation =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kRestMost, kRestMost>;
using RestRow = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kRestMost>;

RestUnknowns standard_deviations(const RestCalibrationConfig& config, int leds);

/// The rig and pose that lie `x` away, in physical units, from what was expected.
Rest moved(const Rest& from, const RestUnknowns& x);

/// Image of an observation's LEDs, and its derivative by the unknowns, at
/// `rest` = moved(.., x); empty if one is behind the lens.
std::optional<Vector2> rest_image(const Rest& rest, const RestUnknowns& x,
                                  std::uint16_t which, RestRow& J);

/// The most probable unknowns.
struct RestMap {
  RestUnknowns x;  ///< Physical units.
  double chi2 = 0;
  double rms_px = 0;
  RestInformation A;  ///< In units of the standard deviations.
};

/// Gauss-Newton from what was expected, `sd` about it; empty if it does not converge.
std::optional<RestMap> fit_rest(const Rest& expected,
                                std::span<const LedObservation> seen,
                                double pixel_sd_px, const RestUnknowns& sd);

}  // namespace alight
