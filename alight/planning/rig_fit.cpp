#include "alight/planning/rig_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace alight {
namespace {

constexpr double kLeastTilt = 4;          // deg; with less no platform may turn
constexpr double kTurned = 10 * kDegree;  // of a heading that is not the end's yet
// Of the touch-down space's height, m: over the landing gear, over the drone's radius.
constexpr double kAboveGear = 0.15, kOver = 0.1;
// Where a landing begins there is room, m, for a drone that is not quite there.
constexpr double kStartRoom = 0.08;

/// Whether there is a place, on the camera's optical axis or above it, to begin a
/// landing from.
bool start_in_view(const PlannerConfig& config, const Rig& rig, const LandingView& view,
                   double tilt_deg) {
  const double unit = view_unit_m(rig);
  for (const double distance : {2 * unit, 3 * unit, 4 * unit}) {
    for (double up = 0; up < kPi / 2; up += kUpStep) {
      const Vector3 place = above_axis(rig.camera, distance, up);
      if (place.z() < lowest_start_m(config)) continue;
      if (view.room(place, tilt_deg).m >= kStartRoom) return true;
    }
  }
  return false;
}

}  // namespace

LandingView::LandingView(const PlannerConfig& config, const Rig& rig)
    : leds_(rig.leds),
      p_NC_(rig.camera.X_NC.translation()),
      planes_(view_planes(rig.camera, config.view_border_px)),
      yaw_{config.end_yaw - kTurned, config.end_yaw + kTurned},
      spare_deg_(config.attitude_spare_deg) {}

LandingView::Room LandingView::room(const Vector3& p_NB, double tilt_deg) const {
  const Vector3 arm = p_NB - p_NC_;
  const double angle = (tilt_deg + spare_deg_) * kDegree;
  Room least;
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    const Vector3& n = planes_[i].n;
    const double m = -n.dot(arm) - led_support(leds_, n, yaw_, angle);
    if (m < least.m) least = {m, std::asin(std::clamp(m / arm.norm(), -1.0, 1.0)), i};
  }
  return least;
}

double view_unit_m(const Rig& rig) {
  return std::max(rig.camera.X_NC.translation().head<2>().norm(),
                  kSizesAway * rig.drone.size_m);
}

double lowest_start_m(const PlannerConfig& config) {
  return config.touch_down_height_m + config.dilation_m;
}

Vector3 above_axis(const Camera& camera, double distance, double up) {
  // y of the lens points down.
  const Vector3 ray(0, -std::sin(up), std::cos(up));
  return camera.X_NC * Vector3(distance * ray);
}

PlannerConfig fitted_to(PlannerConfig config, const Rig& rig) {
  if (config.profile == Profile::paper) return config;
  config.touch_down_height_m =
      std::max({config.touch_down_height_m, rig.drone.gear_height_m + kAboveGear,
                drone_radius(rig) + kOver});
  const LandingView view(config, rig);
  const Vector3 end = landing_end(config, rig).p_NB;
  double tilt = std::min(config.tilt_max_deg, rig.drone.tilt_max_deg);
  while (tilt > kLeastTilt &&
         (view.room(end, tilt).m < 0 || !start_in_view(config, rig, view, tilt))) {
    tilt -= 1;
  }
  config.tilt_max_deg = std::min(config.tilt_max_deg, std::max(tilt, kLeastTilt));
  return config;
}

Result<void> check_view_of_pad(const PlannerConfig& config, const Rig& rig) {
  if (config.profile == Profile::paper) return {};
  for (int i = 0; i < rig.leds.size(); ++i) {
    const double above = rig.leds.p_BL(i).z() + rig.drone.gear_height_m;
    if (above >= 0) continue;
    std::ostringstream text;
    text << "leds[" << i << "].xyz_m: " << -1e3 * above
         << " mm below the pad that the drone stands on (drone.gear_height_m is "
         << rig.drone.gear_height_m << ")";
    return fail(Fault::invalid_config, text.str());
  }
  const LandingView::Room room =
      LandingView(config, rig).room(landing_end(config, rig).p_NB, kLeastTilt);
  if (room.m >= 0) return {};
  constexpr std::array<std::array<const char*, 2>, 4> kEdges{{
      {"left", "to its left"},
      {"right", "to its right"},
      {"upper", "up"},
      {"lower", "down"},
  }};
  const auto [edge, way] = kEdges[room.edge];
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "camera: of a drone that stands on the "
       << "pad, leaning by " << kLeastTilt << " deg, LEDs are beyond the " << edge
       << " edge of the picture by " << std::max(0.1, -room.rad / kDegree)
       << " deg: turn the camera " << way << " (mount.rpy_deg) or move it farther away "
       << "(mount.xyz_m)";
  return fail(Fault::invalid_config, text.str());
}

}  // namespace alight
