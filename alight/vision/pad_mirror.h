#pragma once
#include "alight/geometry/camera.h"

namespace alight {

/// The pad's surface as a level mirror, z = 0 of N: over a glossy pad an LED has a
/// twin, as far below as the LED is above, dimmer, and of its colour.
class PadMirror {
 public:
  /// @param pad_size_m  Side of the pad; 0: nothing mirrors.
  PadMirror(const Camera& camera, double pad_size_m)
      : camera_(camera), half_(pad_size_m / 2) {}

  /// Whether the pad shows something at `uv` (px), seen from the lens.
  bool shows(const Vector2& uv) const;

  /// Whether what it shows at `uv` may be a light that is itself seen at `light_uv`:
  /// up to half a metre above the pad, a mount 1 deg off allowed for.
  bool may_mirror(const Vector2& light_uv, const Vector2& uv) const;

 private:
  /// The pad's point that is seen nearest to q, a point of its plane.
  Vector3 nearest_on_pad(const Vector3& q) const;
  Vector3 point_on_pad(const Vector3& ray_N) const;

  Camera camera_;
  double half_ = 0;  // m
};

}  // namespace alight
