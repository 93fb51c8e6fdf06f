#pragma once
#include "alight/vision/led_matcher.h"

namespace alight {

/// Several LEDs whose images may run together, or one.
struct LedGroup {
  std::uint16_t leds = 0;
  int count = 0;
  Vector2 middle = Vector2::Zero();
  Vector2 stretch = Vector2::Zero();
  double gap_px = 0;  ///< Largest step from one image of the group to its next.
};

using LedGroups = FixedVector<LedGroup, 128>;

/// All groups of up to three whose images could touch.
void led_groups(const LedImages& images, const Constellation& leds, double gap_max_px,
                LedGroups& groups);

/// sd of a blob's stretch, px^2: for its own width, and for the share of the expected
/// one that unequal brightness and a clipped peak change.
double stretch_sd(const Blob& blob, double expected, double image_sd_px);

struct GroupRule {
  double tolerance_px = 3;     ///< Between a blob and the middle of a group.
  double image_sd_px = 0.5;    ///< Of an LED's image, for the stretch.
  double stretch_gate_sd = 4;  ///< A blob has the shape its group would give it.
  double merge_px = 6.5;       ///< Groups: as in MatchRule, more for wide blobs.
  bool use_color = true;
  bool white_is_any = true;
};

/// Room to work in; holds nothing between calls.
struct GroupScratch {
  struct Pair {
    double cost;
    int count;
    std::uint16_t leds;
    int blob;
    std::uint64_t near;  // the blob's bit
  };
  LedGroups groups;
  FixedVector<Pair, 256> pairs;
  FixedVector<int, 64> near;  // one for each bit
};

/// Like match_leds, but place and stretch of a blob are held against each group of LEDs
/// that could have made it: a blob of two LEDs need not lie near either. Best fit
/// first, larger groups before smaller ones that fit alike.
Assignment match_groups(const LedImages& images, const Constellation& leds,
                        BlobSpan blobs, std::span<const int> candidates,
                        const GroupRule& rule, GroupScratch& scratch);

}  // namespace alight
