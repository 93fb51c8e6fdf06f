#pragma once
#include <array>
#include <optional>
#include <span>

#include "alight/geometry/rig.h"
#include "alight/vision/blob.h"

namespace alight {

/// Where the LEDs' images are expected.
struct LedImages {
  std::array<Vector2, kMaxLeds> uv;  ///< px; only where `in_front`.
  std::array<bool, kMaxLeds> in_front{};
  int count = 0;
  double size_px = 0;  ///< Largest distance of an image from the middle of all.
  Vector2 middle = Vector2::Zero();
};

LedImages led_images(const Camera& camera, const Constellation& leds, const Pose& X_NB);

/// Which blob shows which LED; -1: none. A blob that shows several stands at each.
struct Assignment {
  std::array<int, kMaxLeds> blob;
  int blobs = 0;  ///< Different blobs in use.
  int leds = 0;   ///< LEDs seen.

  Assignment() { blob.fill(-1); }
  bool operator==(const Assignment& other) const { return blob == other.blob; }
};

struct MatchRule {
  double tolerance_px = 3;
  double merge_px = 5;
  bool use_color = true;
  bool white_is_any = true;  ///< A washed-out LED may look white; such a blob is taken
                             ///< only where no coloured one is as near.
};

/// How much larger than LEDs' images usually are one may be, three of them run together
/// allowed for; what is larger is a lamp.
inline constexpr double kLargestImage = 4;

/// Whether a blob of color `seen` may show an LED of color `led`.
inline bool colors_agree(LedColor seen, LedColor led, bool white_is_any) {
  return seen == led || seen == LedColor::none || led == LedColor::none ||
         (white_is_any && seen == LedColor::white);
}

/// One blob to one LED, nearest pairs first; then LEDs left over join a blob in reach
/// that already shows their neighbour, where its place and shape speak for both.
/// `candidates` are indices into `blobs`.
Assignment match_leds(const LedImages& images, const Constellation& leds,
                      BlobSpan blobs, std::span<const int> candidates,
                      const MatchRule& rule);

/// The observations of an assignment, in the order of their first LED. A merged one
/// gets the uncertainty of not knowing which LED is brighter: `imbalance` is the sd of
/// the weight that shifts between them.
FixedVector<LedObservation, kMaxLeds> observations(const Assignment& assignment,
                                                   const LedImages& images,
                                                   BlobSpan blobs, double imbalance);

}  // namespace alight
