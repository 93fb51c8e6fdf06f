#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "alight/geometry/rig.h"

namespace alight {

/// LED `led` is seen as light `light`.
struct LedMatch {
  int led = 0;
  int light = 0;
};
using LedMatches = FixedVector<LedMatch, kMaxLeds>;

/// Images of lights, px, and the directions they are seen in.
struct Lights {
  std::vector<Vector2> uv;
  std::vector<Vector3> rays;

  int size() const { return static_cast<int>(uv.size()); }
};

struct LedVotingConfig {
  /// A projected LED and a light this near to each other belong together, px.
  double back_projection_px = 3;
  /// Share of the LEDs not used for the pose that must find a light.
  double certainty = 0.75;
  /// Share of the poses, each from three correspondences, that must agree with the
  /// others.
  double valid_share = 0.7;
};

/// Which light is which LED, without a prior and without colours: poses from every
/// three lights with every three LEDs (P3P), each of which votes for the pairs that it
/// brings together (Faessler et al. 2014, correspondence search).
class LedVoting {
 public:
  LedVoting(const LedVotingConfig& config, const Intrinsics& lens,
            const Constellation& leds);

  /// The pairs with most votes, no LED and no light twice; at least 4 that agree with
  /// one pose, or none.
  LedMatches search(const Lights& lights);

  /// Whether correspondences agree: of the poses from three of them, enough bring the
  /// other LEDs onto their lights. The best pose goes to `X_CB`.
  bool agree(const Lights& lights, const LedMatches& matches, Pose& X_CB) const;

 private:
  void vote(const Lights& lights, const Pose& X_CB, const int led[3],
            const int light[3]);

  LedVotingConfig config_;
  Intrinsics lens_;
  Constellation leds_;
  std::vector<std::uint32_t> votes_;  // row: LED, column: light
};

}  // namespace alight
