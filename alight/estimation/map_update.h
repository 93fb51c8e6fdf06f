#pragma once
#include <Eigen/Core>
#include <cstdint>

#include "alight/base/fixed_vector.h"
#include "alight/base/result.h"
#include "alight/estimation/motion_model.h"
#include "alight/geometry/rig.h"

namespace alight {

/// One LED's image, or that of several in one blob, within a measurement.
struct MeasuredImage {
  std::uint16_t leds = 0;
  Vector2 uv = Vector2::Zero();
  double depth_m = 0;
  double depth_variance = 0;  ///< m^2; 0: no depth
};

/// Images with their common noise, ready for the update: one, or those of a
/// OverlappingLeds.
struct PictureMeasurement {
  PictureMeasurement() {}  // Leaves the room for information as it is: it is large.

  FixedVector<MeasuredImage, kMaxGroup> images;
  /// px^-2, of what is drawn anew in each picture; need not be of full rank.
  GroupMatrix information = Matrix2::Identity();
  /// Standard deviation of the residual, constant errors included, over that by
  /// `information`: widens Huber's limit, not the weight.
  double slack = 1;
};
using PictureMeasurements = FixedVector<PictureMeasurement, kMaxLeds>;

struct MapUpdateOptions {
  int max_iterations = 5;
  double tolerance = 1e-3;
  double huber_sd = 0;           ///< 0: quadratic
  double velocity_variance = 0;  ///< 0: no velocity measurement
  Vector3 v_NB = Vector3::Zero();
};

/// Bias of the state by each LED's displacement: 15 x 3n.
using LedBias = Eigen::Matrix<double, 15, Eigen::Dynamic, 0, 15, 3 * kMaxLeds>;

struct MapUpdate {
  int iterations = 0;
  bool converged = false;
  double moved = 0;  ///< |x [-] x_prior|^2_P of the measured part.
};

/// The maximum a posteriori state for one picture (paper, eqn:IEKF_GN):
///   min |x [-] x_prior|^2_P + |V(x) - v|^2_Rv + sum |h_i(x) - uv_i|^2_Ri
/// by Gauss-Newton with step halving, then P by Joseph's form at the solution with
/// H, S and K as in the paper (written with K = A^-1 H' R^-1, A the information, which
/// is the same K without inverting S). P is that of the tangent at the solution.
///
/// Only the measured part (p, R, or p, R, v with a velocity measurement) is iterated;
/// the others follow by their correlation with it, exactly as in the full system.
/// `bias`, unless null, goes along: the filter's response to displaced LEDs.
///
/// @returns no_convergence, with nothing changed, when an LED lies behind the lens, P
/// is
///          not positive definite or the cost does not fall.
Result<MapUpdate> map_update(const Camera& camera, const Constellation& leds,
                             const PictureMeasurements& measurements,
                             const MapUpdateOptions& options, MotionState& state,
                             Matrix15& P, LedBias* bias);

/// Depth of an observation's LEDs along the optical axis, mean, m; `J` by the tangent
/// of X_NB.
double predicted_depth(const Camera& camera, const Pose& X_NB,
                       const Constellation& leds, std::uint16_t which,
                       Eigen::Matrix<double, 1, 6>* J = nullptr);

}  // namespace alight
