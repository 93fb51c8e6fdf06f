#include "alight/mission/pace.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace alight {

Pace::Reading Pace::at(Time t) const {
  const Seconds passed = to_seconds(t - since_);
  if (passed > 0) {
    const double left = (rate_ - goal_) * std::exp(-passed / kTau);
    return {s_ + goal_ * passed + kTau * (rate_ - goal_ - left), goal_ + left,
            -left / kTau};
  }
  // As it went on before, from within its bounds.
  const double since_bound = slope_before_ > 0 ? rate_ : rate_ - 1;
  const Seconds changed =
      slope_before_ == 0 ? 0 : std::max(passed, -since_bound / slope_before_);
  const double rate = rate_ + slope_before_ * changed;
  return {s_ + passed * rate - 0.5 * slope_before_ * changed * changed, rate,
          changed == passed ? slope_before_ : 0};
}

void Pace::aim(Time from, double rate) {
  assert(rate >= 0 && rate <= 1);
  const Reading here = at(from);
  since_ = from;
  s_ = here.s;
  slope_before_ = here.slope;
  rate_ = std::clamp(here.rate, 0.0, 1.0);
  goal_ = rate;
}

}  // namespace alight
