#include "alight/mission/miss.h"

#include <algorithm>
#include <cmath>

namespace alight {

double miss_sd(const Covariance9& cov) {
  const Vector3 variance = cov.diagonal().head<3>() +
                           2 * kMissAhead * cov.block<3, 3>(0, 6).diagonal() +
                           kMissAhead * kMissAhead * cov.diagonal().tail<3>();
  return std::sqrt(std::max(0.0, variance.maxCoeff()));
}

}  // namespace alight
