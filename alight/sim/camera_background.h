#pragma once
#include <cstdint>
#include <vector>

#include "alight/base/rng.h"
#include "alight/sim/camera_config.h"
#include "alight/sim/camera_renderer.h"

namespace alight {

/// The unlit picture: dark level and read noise, and what a stereo camera says of a
/// dark room. Both come from strips drawn once; each row of each frame starts at a
/// place of its own in them, so a frame costs no more than copying it.
class Background {
 public:
  Background(const CameraSimConfig& config, int width, int height, Rng rng);

  /// Overwrites every pixel. `rng` decides this frame's noise.
  void fill(Rng rng, ColorBuffer& out) const;
  void fill(Rng rng, DepthBuffer& out) const;

 private:
  int width_, height_;
  std::vector<std::uint8_t> color_;   // one strip of pixels, blue green red
  std::vector<std::uint16_t> depth_;  // rows of depth_width_
  int depth_width_;
};

}  // namespace alight
