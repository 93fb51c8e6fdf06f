#pragma once
#include <array>
#include <optional>

#include "alight/geometry/led_frame.h"

namespace alight {

/// Where the LEDs of a drone at rest are seen: the mean of their images, by LED.
///
/// What rests does not move. An LED that is seen elsewhere in a picture or two has been
/// mistaken there; one that stays elsewhere was another light before, and begins anew.
class RestImages {
 public:
  void forget() { leds_.fill({}); }

  /// LED `led` is seen at `uv`, px.
  void add(int led, const Vector2& uv);

  /// From at least so many pictures.
  std::optional<Vector2> mean(int led, int pictures) const;

 private:
  struct Led {
    Vector2 sum = Vector2::Zero();
    int count = 0;
    int elsewhere = 0;  // pictures in a row
  };
  std::array<Led, kMaxLeds> leds_{};
};

}  // namespace alight
