#pragma once
#include "alight/estimation/map_update.h"

namespace alight {

/// Of the coordinates of all LEDs, m^2: 3 n x 3 n.
using LedCovariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0,
                                    3 * kMaxLeds, 3 * kMaxLeds>;
/// Displacements of all LEDs in B, m: 3 n.
using LedVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3 * kMaxLeds, 1>;

/// What a picture tells of the displacement d of the LEDs from where the filter takes
/// them: its log likelihood is d' vector - d' matrix d / 2.
struct LedInformation {
  LedCovariance matrix;  ///< m^-2
  LedVector vector;      ///< m^-1
};

/// The second stage of a filter whose first takes the LEDs for exact (Friedland 1969,
/// "Treatment of bias in recursive filtering"): with G = dh/dLEDs - H bias the image's
/// response to the LEDs through the picture and through the prediction,
///   matrix = G' S^-1 G,  vector = G' S^-1 innovation,
/// written by the posterior so that measurements need not be of full rank.
///
/// @param X_NB       After the update, and
/// @param cov        its covariance, LEDs taken for exact.
/// @param bias       Before the update.
/// @returns false when an LED lies behind the lens.
bool tell_of_leds(const Camera& camera, const Constellation& leds,
                  const PictureMeasurements& measurements, double huber_sd,
                  const Pose& X_NB, const Eigen::Matrix<double, 6, 6>& cov,
                  const LedBias& bias, LedInformation& out);

}  // namespace alight
