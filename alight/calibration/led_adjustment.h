#pragma once
#include <Eigen/Core>
#include <span>
#include <vector>

#include "alight/base/result.h"
#include "alight/calibration/observed_frame.h"
#include "alight/geometry/rig.h"

namespace alight {

/// A distance between two LEDs, measured with a ruler or calliper.
struct LedDistance {
  int i = 0;
  int j = 0;
  double distance_m = 0;
  double sd_m = 0.0002;
};

struct LedAdjustmentConfig {
  double led_sd_m = 0.003;   ///< Of each coordinate as written: the prior.
  double pixel_sd_px = 0.1;  ///< Added to the blobs' own, for what they leave out.
  double huber_sd = 2;       ///< Residuals beyond weigh less,
  double reject_sd = 5;      ///< and beyond this nothing.
  // An LED's image may lie off by a constant that no picture shows (how its light
  // spreads, what the threshold cuts off); for the uncertainty alone:
  double bias_sd_px = 0.02;
  double bias_sd_share = 0.1;  ///< Plus this share of the residuals' sd.
  std::vector<LedDistance> distances;
  bool use_depth = false;
  double depth_sd_m = 0.01;            ///< Together with
  double depth_sd_share = 0.01;        ///< this share of the depth,
  double depth_scale_sd_share = 0.01;  ///< and a scale that all depths have in common.
};

struct LedAdjustment {
  Constellation leds;
  std::vector<Pose> poses;  ///< X_NB of each frame.
  std::vector<double>
      rms_px;              ///< Of each frame, over what was not rejected; NaN: none.
  double noise_scale = 1;  ///< How much larger residuals are than their covariances.
  int observations = 0;    ///< That were not rejected,
  int rejected = 0;        ///< and that were.
  double depth_scale = 1;  ///< Measured depth over true, as found.

  /// Of the coordinates of all LEDs (3 n x 3 n), m^2, in what the pictures can tell:
  /// the constellation's rigid motion in B is taken out of it. Formal covariance and
  /// the one that successive residuals of like sign leave, whichever is larger, and
  /// what a constant bias of each LED's image does.
  Eigen::MatrixXd cov_shape;
  /// sd of the coordinates with the size taken out, too: of the shape alone.
  Eigen::VectorXd form_sd_m;
  /// Of that rigid motion, which comes from the prior alone: sd of the shift (m),
  /// covariance of the turn about x, y and z of B through the middle of the LEDs.
  Vector3 shift_sd_m = Vector3::Zero();
  Matrix3 turn_cov_rad2 = Matrix3::Zero();
  double scale_sd = 0;  ///< Of the size, relative.
};

/// LED positions and the poses of all frames together, the most probable given the
/// images of the LEDs, the positions written down (normal, led_sd_m), distances and
/// depths: Levenberg-Marquardt with the poses eliminated (Triggs et al. 2000, "Bundle
/// adjustment"), Huber weights, outliers rejected.
///
/// The pictures cannot tell where the constellation as a whole sits in B. Equal and
/// independent priors of all coordinates put it where the sum of squares of the LEDs'
/// displacements from `nominal` is least: no shift of their middle, no turn on average.
///
/// @param start  LED positions to begin with.
/// @returns too_few_points (fewer unknowns measured than there are), no_convergence.
Result<LedAdjustment> adjust_leds(const LedAdjustmentConfig& config,
                                  const Camera& camera, const Constellation& nominal,
                                  const Constellation& start,
                                  std::span<const ObservedFrame> frames);

/// Rigid motion of a constellation: six directions of 3 n coordinates, orthonormal.
Eigen::MatrixXd rigid_motions(const Constellation& leds);

}  // namespace alight
