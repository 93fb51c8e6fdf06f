#pragma once
#include <optional>
#include <span>
#include <vector>

#include "alight/base/rng.h"
#include "alight/geometry/rig.h"
#include "alight/sim/camera_config.h"
#include "alight/sim/camera_spot.h"

namespace alight {

/// Whether the straight line from `a` to `b` enters the box, ends on its skin excepted.
bool line_meets_box(const Vector3& a, const Vector3& b, const Obstacle& box);

/// Share of an LED's light that the drone's own hull, arms and turning propellers let
/// through towards a point; both in B.
double through_own_body(const DroneSpec& drone, const Vector3& p_BL,
                        const Vector3& p_BP);

/// Projects like the rig's lens, but refuses what lies so far outside the picture that
/// the distortion polynomial would fold it back in.
class Lens {
 public:
  explicit Lens(const Intrinsics& intrinsics);
  std::optional<Vector2> image(const Vector3& p_CP) const;
  const Intrinsics& intrinsics() const { return intrinsics_; }
  double focal_px() const { return 0.5 * (intrinsics_.fx + intrinsics_.fy); }

 private:
  Intrinsics intrinsics_;
  double widest_;  // tangent off the optical axis
};

/// The LEDs as the camera sees them, direct and mirrored in the pad.
class LedView {
 public:
  LedView(const CameraSimConfig& config, const Rig& true_rig, Rng rng);

  /// Appends the images over an exposure. `gain` of each LED's brightness; none: 1.
  void append_spots(const RowScenes& scenes, std::vector<Spot>& out,
                    std::span<const double> gain = {}) const;

  /// Whether light goes straight from LED `i` to the lens.
  bool in_sight(int i, const Pose& X_NB) const;

 private:
  bool hidden_by_platform(const Vector3& p_NA, const Vector3& p_NB) const;
  /// Brightness of the image towards a point, of 1 at 1 m head on.
  double light_towards(int i, const Pose& X_NB, const Vector3& p_NP) const;
  void append_direct(int i, const RowScenes& scenes, std::vector<Spot>& out) const;
  void append_mirrored(int i, const RowScenes& scenes, std::vector<Spot>& out) const;
  /// A spot of an LED at `z` m along the optical axis and `r` m of travel.
  Spot spot_of(int i, double strength, double r, double z, double blur_rad) const;

  CameraSimConfig config_;
  Rig rig_;
  Lens lens_;
  Pose X_CN_;
  std::vector<Obstacle> opaque_;  // in N
  std::vector<double> strength_;  // per LED, about 1
  double exposure_scale_;
  double falloff_;  // exponent of the cosine
};

}  // namespace alight
