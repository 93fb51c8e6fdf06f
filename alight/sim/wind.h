#pragma once
#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/so3.h"
#include "alight/sim/scenario.h"

namespace alight {

/// Air over the ground: a steady wind and Dryden gusts in the low-altitude form of
/// MIL-F-8785C, which at 10 ft have a sd of 0.196 (along, across) and 0.1 (up) of the
/// mean. Below 10 ft, where that model ends, its values there are kept.
class Wind {
 public:
  Wind(const WindScenario& config, Rng rng);

  /// One step of `dt` s for air passing at `airspeed` m/s (at least 0.5 is taken).
  /// @returns the air's velocity in I, m/s.
  Vector3 step(Seconds dt, double airspeed);

  const Vector3& mean() const { return mean_; }
  /// Unit vector the wind blows towards; along +x of I from 180 deg when calm.
  const Vector3& direction() const { return direction_; }

 private:
  Vector3 direction_, across_;
  Vector3 mean_;
  double sd_along_ = 0;
  double sd_up_ = 0;
  double along_ = 0;
  double across_state_[2] = {0, 0};
  double up_state_[2] = {0, 0};
  Rng rng_;
};

}  // namespace alight
