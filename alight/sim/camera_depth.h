#pragma once
#include <cstdint>
#include <vector>

#include "alight/base/rng.h"
#include "alight/geometry/rig.h"
#include "alight/sim/camera_config.h"
#include "alight/sim/camera_renderer.h"
#include "alight/sim/camera_sight.h"

namespace alight {

/// What a stereo camera says of pad and drone: depth with noise that grows with its
/// square, partly common to a whole surface, and holes where it finds no texture.
class DepthPainter {
 public:
  DepthPainter(const CameraSimConfig& config, const Rig& true_rig, Rng rng);

  /// Draws over the background. `rng` decides this frame's noise; `leds` says which
  /// LEDs are in sight.
  void paint(const Pose& X_NB, const LedView& leds, Rng rng, DepthBuffer& out) const;

 private:
  struct Span {
    int v, u0, u1;
    float mm;
  };
  /// A piece of a row at one depth; `holes` of 256 pixels are unknown.
  void fill(const Span& span, float sd_mm, int holes, Rng& rng, DepthBuffer& out) const;
  void paint_body(const Pose& X_NB, Rng& rng, DepthBuffer& out) const;
  void paint_leds(const Pose& X_NB, const LedView& leds, Rng& rng,
                  DepthBuffer& out) const;
  float sd_mm(double z) const;

  CameraSimConfig config_;
  Rig rig_;
  Lens lens_;
  Pose X_CN_;
  std::vector<Span> pad_;
  std::vector<float> normal_;
  std::vector<std::uint8_t> dice_;
};

}  // namespace alight
