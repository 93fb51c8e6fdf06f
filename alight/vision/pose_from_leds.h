#pragma once
#include <limits>
#include <span>

#include "alight/base/result.h"
#include "alight/geometry/rig.h"

namespace alight {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using ObservationSpan = std::span<const LedObservation>;

/// A pose and how well it explains the picture.
struct PoseFit {
  Pose X_NB = Pose::Identity();
  Matrix6 cov =
      Matrix6::Identity();  ///< Of (dp_NB, dR in B), from the observations' own.
  double rms_px = 0;        ///< Root mean square distance to the observations.
  double chi2 = 0;          ///< Sum of r' cov^-1 r.
  /// The other minimum, if one was looked for and found (a few points that are nearly
  /// flat or far look alike from two sides).
  Pose X_NB_runner_up = Pose::Identity();
  double runner_up_rms_px = std::numeric_limits<double>::infinity();
};

/// Levenberg-Marquardt on the reprojection error (paper, eqn:RSE_Rreproj), weighted by
/// the observations' covariances, from a start.
///
/// @param prior_information  Of (dp_NB, dR in B) about X_NB_0; nullptr for none.
/// @returns too_few_points (fewer than 3 observations without a prior), degenerate (the
///          points do not decide the pose, or lie behind the lens), no_convergence.
Result<PoseFit> refine_pose(const Camera& camera, const Constellation& leds,
                            ObservationSpan seen, const Pose& X_NB_0,
                            const Matrix6* prior_information = nullptr,
                            int iterations_max = 20);

/// Pose from correspondences, at least 4 observations. Without a prior: three-point
/// starts from several triples, each refined before it is compared. Fills in the
/// runner-up.
Result<PoseFit> solve_pnp(const Camera& camera, const Constellation& leds,
                          ObservationSpan seen, const Pose* X_NB_prior = nullptr);

/// Starts from three correspondences: scaled orthographic projection about the ray to
/// their middle, whose two answers mirror each other (Alter 1994). Good to some degrees
/// for a body much smaller than its distance; to be refined.
struct ThreePointPoses {
  Pose X_CB[2] = {Pose::Identity(), Pose::Identity()};
  int count = 0;  ///< 0 when the LEDs stand in a line.
};
ThreePointPoses three_point_poses(const Intrinsics& lens, const Vector3 p_BL[3],
                                  const Vector2 uv[3]);

}  // namespace alight
