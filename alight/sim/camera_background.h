#pragma once
#include <memory>

#include "alight/base/rng.h"
#include "alight/sim/camera_config.h"
#include "alight/sim/camera_renderer.h"

namespace alight {

/// The unlit picture: dark level and read noise, and what a stereo camera says of a
/// dark room. Both are drawn once, as lines of pixels longer than a picture; a frame is
/// a window on them, so that it costs nothing but what is drawn over it.
class Background {
 public:
  Background(const CameraSimConfig& config, int width, int height, Rng rng);

  /// A new picture. `rng` decides this frame's noise.
  void fill(Rng rng, ColorBuffer& out) const;
  void fill(Rng rng, DepthBuffer& out) const;

 private:
  int width_, height_;
  std::shared_ptr<const ColorBuffer::Line> color_;
  std::shared_ptr<const DepthBuffer::Line> depth_;
};

}  // namespace alight
