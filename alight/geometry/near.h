#pragma once
#include "alight/geometry/pose.h"
#include "alight/geometry/so3.h"

namespace alight {

/// Whether two poses of one body, of the same frames, are less than `distance` (m) and
/// `turn` (rad) apart.
inline bool near(const Pose& a, const Pose& b, double distance, double turn) {
  return (a.translation() - b.translation()).norm() < distance &&
         so3_log(a.linear().transpose() * b.linear()).norm() < turn;
}

}  // namespace alight
