#pragma once
#include "alight/vision/pose_from_leds.h"

namespace alight {

/// Gauss-Newton on the reprojection error from a start, observations weighted down
/// where they are more than `huber_px` off (Huber 1964), so that a wrong pair does not
/// carry the others away.
///
/// @param sd_px  Of an observation, each axis: what `cov` of the answer follows from.
/// @returns as refine_pose; `rms_px` is of all observations, weighted or not.
Result<PoseFit> robust_fit(const Camera& camera, const Constellation& leds,
                           ObservationSpan seen, const Pose& X_NB_0, double sd_px,
                           double huber_px);

}  // namespace alight
