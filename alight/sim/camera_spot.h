#pragma once
#include <array>
#include <vector>

#include "alight/base/fixed_vector.h"
#include "alight/base/rng.h"
#include "alight/sim/camera_config.h"
#include "alight/sim/camera_renderer.h"

namespace alight {

/// The image of one source of light before the sensor: a Gaussian drawn along a path.
struct Spot {
  FixedVector<Vector2, kMaxInstants> path;  ///< px, passed at an even pace.
  double sd_px = 1;
  double flux = 0;  ///< Sum over the pixels of the strongest channel, counts.
  double halo = 0;  ///< Height of the halo, share of the core's.
  std::array<float, 3> bgr{1, 1, 1};  ///< Share of each channel, the strongest is 1.
};

/// Blue, green and red of an LED's light as the sensor answers to it, strongest 1.
std::array<float, 3> sensor_response(LedColor color);

/// Adds spots to a picture: integrated over each pixel, with shot noise, cut at 255, so
/// that a bright core turns white and its halo keeps the colour.
class SpotPainter {
 public:
  SpotPainter(const CameraSimConfig& config, Rng rng);

  /// `rng` decides the shot noise.
  void paint(const Spot& spot, Rng& rng, ColorBuffer& out);

 private:
  struct Box {
    int u0, v0, u1, v1;  // half-open
    int width() const { return u1 - u0; }
  };
  void accumulate(const Spot& spot, double sd, double flux, const Box& box);
  void expose(const std::array<float, 3>& bgr, const Box& box, Rng& rng,
              ColorBuffer& out) const;

  double halo_sd_px_;
  float shot_;                 // sd of the noise of 1 count
  std::vector<float> normal_;  // standard normal numbers
  std::vector<float> light_;   // of the box, counts of the strongest channel
  std::vector<float> across_, down_;
};

}  // namespace alight
