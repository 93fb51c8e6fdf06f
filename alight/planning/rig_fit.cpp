#include "alight/planning/rig_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "alight/planning/corridor.h"

namespace alight {
namespace {

constexpr double kLeastTilt = 4;          // deg; with less no platform may turn
constexpr double kTurned = 10 * kDegree;  // of a heading that is not the end's yet
// Of the touch-down space's height, m: over the landing gear, over the drone's radius.
constexpr double kAboveGear = 0.15, kOver = 0.1;
// Where a landing may begin: so many sizes of the drone from the lens at least, and
// with room, m, for a drone that is not quite there.
constexpr double kNearest = 2.5, kStartRoom = 0.08;
constexpr double kStep = 1 * kDegree;

/// How far inside the picture a drone is that stands on the pad, at the edge where that
/// is least: m at the drone, and as an angle about the lens.
struct Room {
  double m = 1e9;
  double rad = 0;
  std::size_t edge = 0;
};

Room room_at(const PlannerConfig& config, const Rig& rig, const Vector3& p_NB,
             double tilt_deg) {
  const Vector3 arm = p_NB - rig.camera.X_NC.translation();
  const YawRange yaw{config.end_yaw - kTurned, config.end_yaw + kTurned};
  const double angle = (tilt_deg + config.attitude_spare_deg) * kDegree;
  const auto planes = view_planes(rig.camera, config.view_border_px);
  Room least;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const Vector3& n = planes[i].n;
    const double m = -n.dot(arm) - led_support(rig.leds, n, yaw, angle);
    if (m < least.m) least = {m, std::asin(std::clamp(m / arm.norm(), -1.0, 1.0)), i};
  }
  return least;
}

Room room_at_end(const PlannerConfig& config, const Rig& rig, double tilt_deg) {
  return room_at(config, rig, landing_end(config, rig).p_NB, tilt_deg);
}

/// Whether there is a place, on the camera's optical axis or above it, to begin a
/// landing from.
bool start_in_view(const PlannerConfig& config, const Rig& rig, double tilt_deg) {
  const Pose& X_NC = rig.camera.X_NC;
  const double unit =
      std::max(X_NC.translation().head<2>().norm(), kNearest * rig.drone.size_m);
  const double lowest = config.touch_down_height_m + config.dilation_m;
  for (const double distance : {2 * unit, 3 * unit, 4 * unit}) {
    for (double up = 0; up < kPi / 2; up += kStep) {
      // y of the lens points down.
      const Vector3 place =
          X_NC * Vector3(distance * Vector3(0, -std::sin(up), std::cos(up)));
      if (place.z() < lowest) continue;
      if (room_at(config, rig, place, tilt_deg).m >= kStartRoom) return true;
    }
  }
  return false;
}

}  // namespace

double room_in_view(const PlannerConfig& config, const Rig& rig, const Vector3& p_NB) {
  return room_at(config, rig, p_NB, config.tilt_max_deg).m;
}

PlannerConfig fitted_to(PlannerConfig config, const Rig& rig) {
  if (config.profile == Profile::paper) return config;
  config.touch_down_height_m =
      std::max({config.touch_down_height_m, rig.drone.gear_height_m + kAboveGear,
                drone_radius(rig) + kOver});
  double tilt = std::min(config.tilt_max_deg, rig.drone.tilt_max_deg);
  while (tilt > kLeastTilt &&
         (room_at_end(config, rig, tilt).m < 0 || !start_in_view(config, rig, tilt))) {
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
  const Room room = room_at_end(config, rig, kLeastTilt);
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
