#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/led_frame.h"
#include "alight/geometry/pose.h"
#include "alight/geometry/so3.h"
#include "alight/sim/fault.h"

namespace alight {

struct ColorBuffer;
struct DepthBuffer;

/// What is wrong with one picture.
struct PictureTrouble {
  bool any = false;
  std::array<double, kMaxLeds> led_gain{};  ///< Share of its brightness; if any.
  double exposure_factor = 1;
  double noise_counts = 0;
  double glare_counts = 0;
  double covered_share = 0;
  std::optional<Pose> X_NB_other;  ///< Of another drone with the same LEDs.
  double depth_factor = 1;
};

/// What the scenario's faults do to pictures, of which the seed decides the details.
class CameraFaults {
 public:
  CameraFaults(std::vector<FaultScenario> faults, Rng rng);

  /// Of picture `index`, taken at `t`.
  PictureTrouble at(Time t, std::uint64_t index) const;

 private:
  std::vector<FaultScenario> faults_;
  Rng rng_;
};

/// Spoils pixels, where light has been drawn and before they are compressed: glare,
/// noise, and what hides a part of the picture, from one of its four sides. Brightness,
/// of LEDs and of all, is drawn with the light.
class PictureSpoiler {
 public:
  explicit PictureSpoiler(Rng rng);

  /// The unlit level grows with the exposure. @pre Before light is drawn.
  static void expose(const PictureTrouble& trouble, ColorBuffer& color);
  /// `rng` decides this picture's noise.
  void spoil(const PictureTrouble& trouble, Rng rng, ColorBuffer& color);
  void spoil(const PictureTrouble& trouble, DepthBuffer& depth) const;

 private:
  struct Box {
    int u0, v0, u1, v1;  // half-open
  };
  Box covered(double share, int width, int height) const;
  void add_glare(double counts, ColorBuffer& color);
  void add_noise(double counts, Rng rng, ColorBuffer& color) const;

  Vector2 glare_;  // share of the picture's sides
  int side_;
  std::vector<float> normal_;
  std::vector<float> across_;
};

}  // namespace alight
