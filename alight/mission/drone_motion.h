#pragma once
#include "alight/geometry/drone_response.h"
#include "alight/mission/relative_estimator.h"
#include "alight/platform/platform_tracker.h"

namespace alight {

/// What moves the drone, as the ground knows it: the set-points already sent, the
/// platform's motion, and whether the ground still carries it.
class DroneMotion final : public MotionSource {
 public:
  DroneMotion(const DroneResponse& response, const PlatformTracker& platform,
              double drag_per_s)
      : response_(response), platform_(platform), drag_per_s_(drag_per_s) {}

  PredictionInput at(Time t, const RelativeState& x) const override;

  bool on_ground = true;
  double autopilot_heading = 0;  ///< Heading of I's x axis in the autopilot's frame.

 private:
  const DroneResponse& response_;
  const PlatformTracker& platform_;
  double drag_per_s_;
};

}  // namespace alight
