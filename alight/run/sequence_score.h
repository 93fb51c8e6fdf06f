#pragma once
#include <cstdint>
#include <vector>

#include "alight/base/result.h"
#include "alight/mission/landing_config.h"
#include "alight/run/made_in_bulk.h"
#include "alight/run/sequence.h"

namespace alight {

/// What became of one frame of a sequence, against its truth.
struct FrameScore {
  bool tracked = false;
  bool found = false;  ///< Without a prior.
  double range_m = 0;  ///< Of the drone from the lens, in truth, as is the speed.
  double speed_m_s = 0;
  // Of the estimate, NaN when there is none:
  double position_m = 0;
  double rotation_rad = 0;
  double velocity_m_s = 0;
  double nees_pose = 0;   ///< Squared Mahalanobis distance, 6 degrees of freedom,
  double nees_state = 0;  ///< 9; NaN when the covariance is no covariance.
  double nis_sum = 0;     ///< Over its observations, 2 degrees of freedom each.
  int observations = 0;
  double cpu_us = 0;  ///< Of the thread that ran the estimator.

  /// Beyond 0.15 m or 15 deg.
  bool wrong() const;
  /// Wrong while the covariance says otherwise: pose NEES under 30.
  bool surely_wrong() const;
};

/// A tracked frame against its truth; the CPU time is left 0.
FrameScore score_frame(const FrameReport& report, const RelativeState& truth,
                       const Vector3& p_NC);

/// The estimator over a whole sequence, with nothing known but the pictures.
///
/// @param rig What the estimator is told; may differ from what flies.
/// @param bytes_held Room for pictures that are rendered at a time (made_in_bulk.h).
Result<std::vector<FrameScore>> score_sequence(Sequence& sequence, const Rig& rig,
                                               Profile profile,
                                               std::size_t bytes_held = kBytesHeld);

}  // namespace alight
