#pragma once
#include <string>
#include <vector>

#include "alight/geometry/rig.h"

namespace alight {

/// Where a constellation must do.
struct ConstellationUse {
  double range_m = 2.5;      ///< From the lens, at which it must still be told.
  double led_sd_m = 0.002;   ///< How well LED positions are known, per axis.
  double tilt_max_deg = 35;  ///< Of the drone, in flight.
  bool one_sided = true;     ///< A drone that turns its LEDs away is not seen.
  bool use_color = true;
};

/// What a person should know of the LEDs they wrote down, in whole sentences that name
/// LEDs by their place in the rig file, from 0, and say what to move.
struct ConstellationReport {
  std::string refusal;  ///< Empty: a pose can be told. Else why none ever can.
  std::vector<std::string> warnings;
};

/// Looks for LEDs in a line, that look alike from several sides (where colours and
/// gravity do not tell), in a plane, too close together, or too few to lose one.
ConstellationReport check_constellation(const Constellation& leds,
                                        const Intrinsics& lens,
                                        const ConstellationUse& use = {});

}  // namespace alight
