#pragma once
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/pose_log.h"

namespace alight {

/// An estimate and the truth of the same instant.
struct PosePair {
  Time t = 0;
  Pose estimate = Pose::Identity();
  Pose truth = Pose::Identity();
};
using PosePairs = std::vector<PosePair>;

/// Pairs every estimate with the truth nearest in time, no further than `max_dt` s
/// away; each truth serves once. @pre both in order of time.
PosePairs associate(const PoseLog& estimate, const PoseLog& truth, Seconds max_dt);

/// Pairs row i with row i; invalid_input when the lengths differ.
Result<PosePairs> associate_rows(const PoseLog& estimate, const PoseLog& truth);

/// The rigid motion X that brings the estimated positions onto the true ones in least
/// squares, truth ~ X * estimate (Umeyama 1991, without scale). too_few_points below 3,
/// degenerate when they lie on one line.
Result<Pose> fit_se3(const PosePairs& pairs);

/// `pairs` with the estimates moved by X.
PosePairs moved(const PosePairs& pairs, const Pose& X);

/// The mean of rotations that are close together: the R that the Log(R' R_i) sum to
/// zero for, by iteration from the first. degenerate if it does not settle.
Result<Matrix3> mean_rotation(const std::vector<Matrix3>& rotations);

/// How far estimates are from the truth. The paper's ATE of one run is the RMSE here;
/// of several runs, the mean of theirs (its formula averages over i = 1..N outside the
/// root).
struct PathError {
  int count = 0;
  double position_rmse_m = 0;
  double position_fitted_rmse_m = 0;  ///< After fit_se3; NaN where no fit is possible.
  double position_p95_m = 0;
  double position_max_m = 0;
  double rotation_rmse_rad = 0;           ///< Of the angle of R_truth' R_estimate.
  double rotation_mean_out_rmse_rad = 0;  ///< After taking out their mean rotation.
  double rotation_max_rad = 0;
  double success = 0;  ///< Share within 0.15 m and 15 deg (CONTRACT: tracked).
};

/// too_few_points when empty.
Result<PathError> path_error(const PosePairs& pairs);

}  // namespace alight
