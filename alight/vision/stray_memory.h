#pragma once
#include "alight/geometry/camera.h"
#include "alight/vision/blob.h"
#include "alight/vision/led_matcher.h"

namespace alight {

/// Remembers the lights that were no LEDs while every LED was accounted for, and knows
/// them again as an LED flies past them or leaves the picture among them: a lamp of a
/// row is easily taken for an LED that is near it, and then the next one, and the pose
/// stays behind with the lamps.
///
/// A lamp goes through the picture evenly from one to the next, also as seen from a
/// platform that drives and turns. One that is hidden for a while is expected where it
/// should be by then.
///
/// No allocation.
class StrayMemory {
 public:
  /// The lights that are known again have `stray` set.
  /// @returns `blobs`, or a copy that is valid until the next call.
  BlobSpan mark(BlobSpan blobs, Time t);

  /// Goes on with what was marked in the picture of time `t`, and with the lights that
  /// stand apart from all LEDs.
  /// @param leds  Where the LEDs are, by the pose that the picture gave.
  /// @param sure  Whether the LEDs seen leave no doubt about that pose. Else no light
  ///              is taken up; those that are, are gone on with.
  void remember(BlobSpan blobs, const LedImages& leds, bool sure, Time t);

  void forget() { strays_.clear(); }

 private:
  struct Stray {
    Vector2 uv = Vector2::Zero();   // px, when it was seen last,
    Vector2 way = Vector2::Zero();  // and from there, px/s
    Time seen = 0;
    int pictures = 1;

    Vector2 at(Time t) const { return uv + to_seconds(t - seen) * way; }
    bool known() const;
  };

  FixedVector<Stray, 64> strays_, anew_;
  FixedVector<Blob, kMaxBlobs> marked_;
};

}  // namespace alight
