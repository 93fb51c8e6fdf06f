#include "alight/mission/pace.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace alight {

Pace::Reading Pace::at(Time t) const {
  const Seconds passed = to_seconds(t - since_);
  const double change = goal_ - rate_;
  const Seconds changing = std::abs(change) / kSlew;
  const double slope = std::copysign(kSlew, change);
  if (passed < changing && passed > 0) {
    return {s_ + passed * (rate_ + 0.5 * slope * passed), rate_ + slope * passed,
            slope};
  }
  if (passed <= 0) return {s_ + passed * rate_, rate_, 0};
  const Seconds reached = changing * (rate_ + 0.5 * slope * changing);
  return {s_ + reached + goal_ * (passed - changing), goal_, 0};
}

void Pace::aim(Time now, double rate) {
  assert(rate >= 0 && rate <= 1);
  const Reading here = at(now);
  since_ = now;
  s_ = here.s;
  rate_ = std::clamp(here.rate, 0.0, 1.0);
  goal_ = rate;
}

}  // namespace alight
