#include "alight/mission/miss.h"

#include <algorithm>
#include <cmath>

namespace alight {

double miss_sd(const Covariance9& cov) {
  double worst = 0;
  for (int p = 0, v = 6; p < 3; ++p, ++v) {
    worst = std::max(worst, cov(p, p) + kMissAhead * (cov(p, v) + cov(v, p)) +
                                kMissAhead * kMissAhead * cov(v, v));
  }
  return std::sqrt(worst);
}

}  // namespace alight
