#pragma once
// What the files of LedResolver share.
#include <algorithm>
#include <cmath>

#include "alight/vision/led_resolver.h"

namespace alight {

inline constexpr double kNoiseUsual = PointSpread{}.noise_variance;  // of most cameras
inline constexpr double kNoiseLeast = 0.1, kNoiseMost = 4;  // of chi2 per pixel
/// An LED that has given no light for so many pictures is not looked for in others'
/// light, of which noise would make it, unless far more than the usual chi2 is left.
inline constexpr int kDeadAfter = 30;
// Lights nearer than this that turn out to be so far from where they were expected, or
// so much brighter or dimmer, are taken off anew: px, px and a share.
inline constexpr double kNearPx = 6, kMovedPx = 0.15, kChanged = 0.3;

/// A light that is as large as an LED near the lens, and run together with a lamp: its
/// middle is that of neither.
bool runs_on(const Blob& blob, const Vector2& blur_px);

inline bool is_used(const Assignment& match, int blob) {
  return std::find(match.blob.begin(), match.blob.end(), blob) != match.blob.end();
}

inline RefusedBlob unmatched(const Blob& blob) {
  return {blob.uv, blob.stray ? Refusal::stray : Refusal::no_led_near};
}

/// LEDs whose images touch.
struct LedResolver::Patch {
  Patch() {}  // Leaves the room for a fit as it is: a list of patches is large.

  FixedVector<int, kMaxLeds> members;
  double area_px = 0;    ///< Of the largest of its blobs; 0: none.
  bool unlike = false;   ///< Nothing like its LEDs was found in it.
  unsigned feigned = 0;  ///< Members that only noise shows.
  std::optional<SpotFit> fit;
};

/// A picture with what is known of its lights.
struct LedResolver::Look {
  const ImageView& image;
  BlobSpan blobs;
  const Assignment& match;
  const LedImages& images;
  std::span<const Vector2> blur_px;
  int margin_px;                               ///< Around lamps.
  std::array<LightBeside, kMaxLeds> lights{};  ///< Of the LEDs; height 0: none known.
};

template <class Wanted>
void LedResolver::fit_all(Look& look, Patches& patches, Wanted&& wanted) const {
  const auto expected = look.lights;
  for (Patch& patch : patches) {
    if (wanted(patch)) fit(look, patch);
  }
  const auto changed = [&](std::size_t i) {
    const LightBeside &now = look.lights[i], &then = expected[i];
    return (now.uv - then.uv).norm() > kMovedPx ||
           std::abs(now.height - then.height) > kChanged * now.height;
  };
  for (std::size_t p = 0; p < patches.size(); ++p) {
    Patch& patch = patches[p];
    if (!patch.fit || !wanted(patch)) continue;
    bool again = false;
    // Those before it were known when it was fitted.
    for (std::size_t q = p + 1; q < patches.size(); ++q) {
      for (const int other : patches[q].members) {
        const auto i = static_cast<std::size_t>(other);
        for (const int own : patch.members) {
          const auto k = static_cast<std::size_t>(own);
          again = again || (changed(i) &&
                            (look.lights[i].uv - look.lights[k].uv).norm() < kNearPx);
        }
      }
    }
    if (again) fit(look, patch);
  }
}

template <class Wanted>
LedResolver::Patches LedResolver::fitted(Look& look, Wanted&& wanted) const {
  const auto expected = look.lights;
  bool left_out = false;
  Patches patches = this->patches(look.images, look.blobs, look.match, &left_out);
  fit_all(look, patches, wanted);
  const auto fails = [&](const Patch& p) { return wanted(p) && unexplained(p); };
  if (left_out && std::any_of(patches.begin(), patches.end(), fails)) {
    patches = this->patches(look.images, look.blobs, look.match, nullptr);
    look.lights = expected;
    fit_all(look, patches, wanted);
  }
  return patches;
}

}  // namespace alight
