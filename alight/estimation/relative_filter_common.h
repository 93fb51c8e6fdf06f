#pragma once
#include <Eigen/Core>

#include "alight/base/time.h"

namespace alight {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Pictures so far apart show a movement that goes on as it did.
inline constexpr Seconds kGoesOnAlike = 0.05;
// Pictures in which it is told how a drone moves, less and less.
inline constexpr double kCarriedFor = 60;
// Mean square of the sums of corrections of what pushes the drone, as a rule.
inline constexpr double kTrendUsual = 0.45;

}  // namespace alight
