#pragma once
#include <span>
#include <vector>

#include "alight/calibration/led_adjustment.h"
#include "alight/calibration/light_tracks.h"

namespace alight {

/// Where the LEDs are, roughly, and which light is which.
struct LedGuess {
  Constellation leds;
  double cost = 0;    ///< -2 log likelihood, prior included,
  double margin = 0;  ///< and by how much it beats the next best naming of its lights.
  int pictures = 0;   ///< Of the stretch of flight it comes from,
  int lights = 0;     ///< and lights that were followed through all of it.
};

/// LEDs that are off by a good part of their distance from each other are mistaken for
/// each other in single pictures. So the lights that can be followed through a stretch
/// of flight are first fitted whatever their names: their motion gives their shape
/// (adjust_leds). Then those names are taken under which that shape lies nearest to the
/// written one, colours respected.
///
/// @returns too_few_points: no stretch shows enough of the shape.
Result<LedGuess> guess_leds(const LedAdjustmentConfig& config, const Camera& camera,
                            const Constellation& written,
                            std::span<const LightTrack> tracks);

/// `found` with those LEDs of one colour renamed that so lie nearer to the written ones
/// when it is laid over them. Those without a colour are of one.
Constellation named_nearest(const Constellation& found, const Constellation& written);

}  // namespace alight
