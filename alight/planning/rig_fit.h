#pragma once
#include <array>

#include "alight/planning/corridor.h"

namespace alight {

/// `config` as the rig allows it. Standard profile:
///   tilt_max_deg         so little that on the pad, and somewhere to begin from, every
///                        LED stays in the picture, leaning and turned by up to 10 deg;
///                        4 at the least
///   touch_down_height_m  above the drone's radius and its landing gear
PlannerConfig fitted_to(PlannerConfig config, const Rig& rig);

/// How a drone that is turned by up to 10 deg is seen.
class LandingView {
 public:
  LandingView(const PlannerConfig& config, const Rig& rig);

  /// How far inside the picture, `view_border_px` from the edge where that is least,
  /// every LED of a drone at p_NB stays, leaning by up to `tilt_deg`.
  struct Room {
    double m = 1e9;        ///< At the drone; less than 0: it does not.
    double rad = 0;        ///< The same about the lens.
    std::size_t edge = 0;  ///< Of view_planes.
  };
  Room room(const Vector3& p_NB, double tilt_deg) const;

 private:
  Constellation leds_;
  Vector3 p_NC_;
  std::array<ViewPlane, 4> planes_;
  YawRange yaw_;
  double spare_deg_;
};

/// So many sizes away from the lens a drone is in view.
inline constexpr double kSizesAway = 2.5;
/// From the lens to the pad, level, or that, if it is more. m
double view_unit_m(const Rig& rig);

/// Above the pad, where both spaces of a landing overlap: it may begin. m
double lowest_start_m(const PlannerConfig& config);

/// So far from the lens, `up` rad above its optical axis, in N.
Vector3 above_axis(const Camera& camera, double distance, double up);
/// Steps of `up` in which a place is looked for, rad.
inline constexpr double kUpStep = 1 * kDegree;

/// Whether a drone that stands on the pad can be seen to land: every LED above the pad
/// and in the picture, `view_border_px` from its edge, while it leans by the least that
/// a landing takes.
/// @returns invalid_config: which LED, or by how much they are beyond which edge, and
///          what to turn.
Result<void> check_view_of_pad(const PlannerConfig& config, const Rig& rig);

}  // namespace alight
