#include "alight/mission/pace.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace alight {

Pace::Turn Pace::carried(const Turn& turn, Time t) {
  const Seconds passed = to_seconds(t - turn.since);
  const double x = passed / kTau, faded = std::exp(-x);
  const double wish = turn.wish - turn.goal, rate = turn.rate - turn.goal;
  Turn then = turn;
  then.since = t;
  then.wish = turn.goal + wish * faded;
  then.rate = turn.goal + (rate + x * wish) * faded;
  then.s = turn.s + turn.goal * passed +
           kTau * ((rate + wish) * (1 - faded) - wish * x * faded);
  return then;
}

Pace::Reading Pace::at(Time t) const {
  const Turn* turn = turns_.end() - 1;
  while (turn != turns_.begin() && turn->since > t) --turn;
  if (t < turn->since) {
    // Before the first: as it began.
    return {turn->s + turn->rate * to_seconds(t - turn->since), turn->rate, 0, 0, 0};
  }
  const Turn here = carried(*turn, t);
  const double slope = (here.wish - here.rate) / kTau;
  const double curve = ((here.goal - here.wish) / kTau - slope) / kTau;
  return {here.s, here.rate, slope, curve, kTau * (here.rate + here.wish)};
}

void Pace::aim(Time from, double rate) {
  assert(rate >= 0 && rate <= 1);
  while (turns_.size() > 1 && turns_.back().since >= from) {
    turns_.truncate(turns_.size() - 1);
  }
  if (turns_.back().goal == rate) return;
  Turn next = carried(turns_.back(), std::max(from, turns_.back().since));
  next.goal = rate;
  if (next.since == turns_.back().since) {
    turns_.back() = next;
    return;
  }
  if (turns_.full()) turns_.erase(0);
  turns_.push_back(next);
}

}  // namespace alight
