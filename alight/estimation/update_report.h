#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/geometry/led_frame.h"

namespace alight {

/// What the filter made of one observation.
struct ObservationReport {
  std::uint16_t leds = 0;
  Vector2 uv = Vector2::Zero();
  Vector2 residual_px = Vector2::Zero();  ///< Measured less predicted after the update.
  double variance_px2 = 0;                ///< Of both coordinates together, as claimed.
  bool alone = true;                      ///< Not one of lights that run together.
  double nis = 0;  ///< Of the innovation, 2 degrees of freedom; before the update.
};

/// What the filter made of one picture.
struct UpdateReport {
  int iterations = 0;
  bool converged = false;    ///< The last step was below the tolerance.
  int used = 0;              ///< Observations that took part.
  int gated = 0;             ///< Too improbable.
  int malformed = 0;         ///< NaN, no covariance, unknown LED.
  bool contradicts = false;  ///< They fit worse than they may be off, even so.
  double moved = 0;  ///< Squared Mahalanobis distance of the pose from the prediction.
  double reprojection_px = 0;  ///< Root mean square distance, used ones, after.
  FixedVector<ObservationReport, kMaxLeds> seen;  ///< Those used.
  FixedVector<RefusedBlob, kMaxRefused>
      refused;  ///< Those not: gated, off_constellation.
};

}  // namespace alight
