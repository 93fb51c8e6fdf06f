#pragma once
#include "alight/geometry/trajectory.h"

namespace alight {

constexpr double kSink = 0.25;  // m/s

/// Straight down at kSink over the pad's middle, for 2 s, to the gear's height.
inline Trajectory sinking_landing(double gear_height) {
  Trajectory trajectory;
  trajectory.durations = {1, 1};
  for (std::size_t s = 0; s < kSegments; ++s) {
    for (std::size_t i = 0; i < kControlPoints; ++i) {
      const double share = static_cast<double>(i) / (kControlPoints - 1);
      const double t = static_cast<double>(s) + share;
      trajectory.c[s][i] = Vector3(0, 0, gear_height + kSink * (2 - t));
    }
  }
  return trajectory;
}

}  // namespace alight
