#pragma once
#include "alight/geometry/led_frame.h"
#include "alight/geometry/pose.h"

namespace alight {

/// What one picture of a flight says of the LEDs, and the pose it was seen from.
struct ObservedFrame {
  Time t = 0;
  Pose X_NB = Pose::Identity();
  FixedVector<LedObservation, kMaxLeds> seen;
};

}  // namespace alight
