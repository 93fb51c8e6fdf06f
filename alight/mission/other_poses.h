#pragma once
#include "alight/vision/led_finder.h"

namespace alight {

/// Another way to read the lights that were taken for certain LEDs.
struct OtherPose {
  FixedVector<LedObservation, kMaxLeds> seen;
  PoseFit fit;
};
using OtherPoses = FixedVector<OtherPose, 12>;

/// What lights, each taken for one LED, may be besides: one, two or three of them other
/// LEDs of their colours, or all of them the same LEDs seen from the other side of the
/// line of sight. Poses where a drone can be that fit to `rms_max_px`, the best ones
/// first, without X_NB as it is.
///
/// A search: some milliseconds where no colour helps.
void find_other_poses(const Camera& camera, const Constellation& leds, bool use_color,
                      const LedFinder& plausible, ObservationSpan seen,
                      const Pose& X_NB, double rms_max_px, OtherPoses& out);

/// The same LEDs in the same lights, on the far side of the minimum between: the pose
/// into which a body that is flat, or far, may be mirrored. empty: it comes back to
/// X_NB, or there is none.
std::optional<PoseFit> mirrored_pose(const Camera& camera, const Constellation& leds,
                                     ObservationSpan seen, const Pose& X_NB);

}  // namespace alight
