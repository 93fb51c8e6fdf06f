#pragma once
#include <array>

#include "alight/geometry/led_frame.h"

namespace alight {

/// Tells lights that something covers in part: they are dimmer than they were, and the
/// others are not. What is left of such a light is not where the light is.
class LightShare {
 public:
  LightShare() { share_.fill(1); }

  /// How bright the images of LEDs are, grey levels; 0: not seen.
  using Heights = std::array<double, kMaxLeds>;

  /// What share of each LED's light a picture shows, 1 where nothing speaks against.
  /// @param range_m  Of the drone from the lens, as far as it is known.
  void look(const Heights& heights, double range_m);

  /// Of the picture looked at last. By how much a light of the spread `sd_px` may seem
  /// displaced for want of the rest of it, px; 0 for one that is whole.
  double displaced_px(int led, double sd_px) const;
  /// None of its lights is cut.
  bool whole() const;

  /// The lights looked at last are those of the LEDs: they are what the next are held
  /// against.
  void learn();

 private:
  static constexpr double kSteady = 0.06;  // of its light; nobody's shines so evenly

  /// It misses more of its light than it does by chance.
  bool cut(double share) const;

  Heights usual_{};         // those last learnt; 0: not known
  Heights now_{};           // those looked at, and
  Heights share_;           // what share of it each shows
  double range_m_ = 0;      // of them; 0: not known
  double range_now_m_ = 0;  // of those looked at
  double change_ = 1;       // of all lights, from those to these
  double unsteady_ = kSteady;
};

}  // namespace alight
