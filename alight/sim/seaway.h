#pragma once
#include <vector>

#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/so3.h"
#include "alight/sim/scenario.h"

namespace alight {

/// How a hull heaves, rolls and pitches in an irregular sea: the sum of the waves of a
/// JONSWAP spectrum (Hasselmann et al. 1973), long-crested, met from 30 to 60 deg off
/// the bow on a side that is drawn.
///
/// One rigid hull answers one wave in three ways, and so with fixed phases: heave
/// follows the water's height at the hull; pitch and roll follow its slope, a quarter
/// of a period apart from the height, so that the bow is up while the hull rises on a
/// wave. Each answer is an oscillator's (heave and pitch stiff and damped, roll slow
/// and resonant) and is then scaled to the significant amplitude asked for, which holds
/// for the mean over long times; a short stretch has groups and lulls. Periods are
/// those in which the hull meets the waves.
class Seaway {
 public:
  /// A coordinate with its derivatives in time; m or rad, s.
  struct Motion {
    double value = 0, rate = 0, acceleration = 0;
  };
  struct Deck {
    Motion heave;  ///< Up.
    Motion roll;   ///< As in R = Rz(yaw) Ry(pitch) Rx(roll):
    Motion pitch;  ///< bow down is positive.
  };

  Seaway(const SeaScenario& sea, Rng rng);

  Deck at(Seconds t) const;

 private:
  /// Cosine and sine parts of one frequency's share.
  struct Wave {
    double omega;
    Vector3 c, s;  ///< heave, roll, pitch
  };
  std::vector<Wave> waves_;
};

}  // namespace alight
