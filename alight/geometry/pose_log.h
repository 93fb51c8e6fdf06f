#pragma once
#include <utility>
#include <vector>

#include "alight/base/time.h"
#include "alight/geometry/pose.h"

namespace alight {

/// Poses with their times, in order of time: what io reads and writes, eval compares.
using PoseLog = std::vector<std::pair<Time, Pose>>;

}  // namespace alight
