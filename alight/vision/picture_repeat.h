#pragma once
#include <cstdint>
#include <span>

#include "alight/base/fixed_vector.h"
#include "alight/geometry/image.h"
#include "alight/geometry/led_frame.h"
#include "alight/geometry/pose.h"

namespace alight {

/// Tells whether a camera repeats its picture to the last bit, which no sensor that
/// still looks does: its noise makes every row another. Compares some rows of the
/// picture and all around the places where LEDs were, so that pictures without noise
/// are told apart, too.
///
/// No allocation.
class PictureRepeat {
 public:
  /// @returns how many pictures in a row are alike by now; 1 when this is another.
  int look(const ImageView& picture);
  /// Where LEDs were found in the picture just looked at, px; empty: nowhere, and next
  /// time more rows are compared. @pre leds_px are finite.
  void found(const ImageView& picture, std::span<const Vector2> leds_px);

 private:
  std::uint64_t there(const ImageView& picture) const;

  int alike_ = 0;
  std::uint64_t rows_ = 0;             // fingerprint of the last picture's rows,
  FixedVector<Roi, kMaxLeds> places_;  // what else of it is compared,
  int step_ = 1;                       // of this every so many rows,
  std::uint64_t there_ = 0;            // and its fingerprint
};

}  // namespace alight
