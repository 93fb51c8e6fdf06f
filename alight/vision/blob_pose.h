#pragma once
#include <optional>
#include <span>

#include "alight/vision/group_matcher.h"
#include "alight/vision/pose_from_leds.h"

namespace alight {

/// What one blob says of the LEDs that made it: where their middle is, and how far
/// apart they are.
struct BlobTerm {
  std::uint16_t leds = 0;
  Vector2 uv = Vector2::Zero();
  Matrix2 cov = Matrix2::Identity();
  Vector2 stretch = Vector2::Zero();
  double stretch_sd = 1;  ///< px^2
};

/// The terms of an assignment, with `sd_px` for what the rig file gets wrong. The
/// stretch that all blobs have in common, motion blur, is taken off.
FixedVector<BlobTerm, kMaxLeds> blob_terms(const Assignment& assignment,
                                           const LedImages& images, BlobSpan blobs,
                                           double sd_px);

struct BlobFit {
  Pose X_NB = Pose::Identity();
  Matrix6 information = Matrix6::Zero();  ///< Of (dp_NB, dR in B).
  double chi2_place = 0;
  double chi2_stretch = 0;
  double chi2_tilt = 0;
  double rms_px = 0;

  double cost() const { return chi2_place + chi2_stretch + chi2_tilt; }
};

/// Levenberg-Marquardt as in refine_pose, on the places and stretches of blobs and a
/// prior that B's z axis is `tilt_sd` (rad, per axis) from N's. Few steps, small and
/// fast: for the many poses of a search.
std::optional<BlobFit> fit_blobs(const Camera& camera, const Constellation& leds,
                                 std::span<const BlobTerm> terms, double tilt_sd,
                                 const Pose& X_NB_0, int iterations_max);

}  // namespace alight
