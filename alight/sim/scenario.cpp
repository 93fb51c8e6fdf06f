#include "alight/sim/scenario.h"

#include <algorithm>
#include <array>
#include <string>

#include "alight/base/bounds.h"
#include "alight/geometry/rig.h"

namespace alight {
namespace {

template <class Enum, std::size_t N>
struct Names {
  std::array<const char*, N> text;

  const char* of(Enum value) const { return text[static_cast<std::size_t>(value)]; }
  std::optional<Enum> find(std::string_view name) const {
    for (std::size_t k = 0; k < N; ++k) {
      if (name == text[k]) return static_cast<Enum>(k);
    }
    return std::nullopt;
  }
};

constexpr Names<PlatformKind, 7> kPlatforms{
    {"still", "straight", "circle", "block", "eight", "recorded", "boat"}};
constexpr Names<StartPlace, 2> kPlaces{{"pad", "floor"}};
constexpr Names<Gusts, 2> kGusts{{"none", "dryden"}};
constexpr Names<AutopilotInterface, 2> kInterfaces{{"attitude", "velocity"}};
constexpr Names<LinkLossAction, 3> kLossActions{{"land", "descend", "drift"}};

}  // namespace

const char* to_string(PlatformKind kind) { return kPlatforms.of(kind); }
const char* to_string(StartPlace place) { return kPlaces.of(place); }
const char* to_string(Gusts gusts) { return kGusts.of(gusts); }
const char* to_string(AutopilotInterface kind) { return kInterfaces.of(kind); }
const char* to_string(LinkLossAction action) { return kLossActions.of(action); }
std::optional<PlatformKind> platform_kind(std::string_view name) {
  return kPlatforms.find(name);
}
std::optional<StartPlace> start_place(std::string_view name) {
  return kPlaces.find(name);
}
std::optional<Gusts> gusts_kind(std::string_view name) { return kGusts.find(name); }
std::optional<AutopilotInterface> autopilot_interface(std::string_view name) {
  return kInterfaces.find(name);
}
Result<void> Scenario::validate() const {
  FirstComplaint check;
  const bool recorded = platform.kind == PlatformKind::recorded;
  check.that(!recorded || !platform.drive.empty(),
             "platform.file is missing: kind recorded takes its drive from there");
  check.that(recorded || platform.file.empty(),
             "platform.file is for kind recorded alone");
  check.range("platform.speed_m_s", platform.speed_m_s, 0, 20);
  check.range("platform.radius_m", platform.radius_m, 0.3, 1000);
  check.range("platform.side_m", platform.side_m, 0.5, 1000);
  check.range("platform.corner_radius_m", platform.corner_radius_m, 0,
              platform.side_m / 2);
  check.range("platform.brake_m_s2", platform.brake_m_s2, 0.1, 20);
  check.range("platform.yaw_rate_max_deg_s", platform.yaw_rate_max_deg_s, 1, 360);
  check.range("platform.sea.heave_m", platform.sea.heave_m, 0, 5);
  check.range("platform.sea.roll_deg", platform.sea.roll_deg, 0, 45);
  check.range("platform.sea.pitch_deg", platform.sea.pitch_deg, 0, 45);
  check.range("platform.sea.period_s", platform.sea.period_s, 1, 60);
  check.range("platform.sea.gamma", platform.sea.gamma, 1, 10);
  check.range("platform.sea.pad_above_m", platform.sea.pad_above_m, 0, 30);
  check.range("platform.sea.pad_aft_m", platform.sea.pad_aft_m, -30, 30);
  if (platform.kind == PlatformKind::boat) {
    // What lies at z = 0 is as hard as a floor to what touches it.
    check.range("platform.sea.heave_m", platform.sea.heave_m, 0,
                std::max(0.0, (platform.sea.pad_above_m - 0.5) / 2));
    check.that(start.place == StartPlace::pad,
               "start.place: a boat has no floor to start from, must be pad");
  }
  check.range("wind.mean_m_s", wind.mean_m_s, 0, 30);
  check.range("wind.from_deg", wind.from_deg, -360, 360);
  check.range("radio.latency_ms", radio.latency_ms, 0, 2000);
  check.range("radio.jitter_ms", radio.jitter_ms, 0, 1000);
  check.range("radio.loss", radio.loss, 0, 1);
  check.range("radio.burst_ms", radio.burst_ms, 0, 5000);
  check.range("radio.queue", radio.queue, 1, 256);
  check.range("camera.lights", camera.lights, 0, 1000);
  check.range("camera.pad_reflectance", camera.pad_reflectance, 0, 1);
  check.range("camera.jpeg", camera.jpeg, 0, 100);
  check.range("camera.noise", camera.noise, 0, 20);
  if (camera.gamma != 0) {
    check.range("camera.gamma", camera.gamma, Rig::kGammaLeast, Rig::kGammaMost);
  }
  check.range("camera.depth_offset_ms", camera.depth_offset_ms, 0, 15);
  check.range("odometry.rate_hz", odometry.rate_hz, 1, 500);
  check.range("odometry.latency_ms", odometry.latency_ms, 0, 500);
  check.range("odometry.scale_error", odometry.scale_error, 0, 0.5);
  check.range("odometry.yaw_rate_bias_deg_s", odometry.yaw_rate_bias_deg_s, 0, 90);
  check.range("odometry.slip", odometry.slip, 0, 0.5);
  check.range("odometry.imu_rate_hz", odometry.imu_rate_hz, 0, 500);
  check.range("autopilot.heading_drift_deg_min", autopilot.heading_drift_deg_min, 0,
              360);
  check.range("autopilot.link_loss_ms", autopilot.link_loss_ms, 10, 10'000);
  check.range("autopilot.blind_after_ms", autopilot.blind_after_ms, 100, 10'000);
  check.range("autopilot.land_speed_m_s", autopilot.land_speed_m_s, 0.1, 5);
  check.range("autopilot.hover_error", autopilot.hover_error, 0, 0.5);
  check.range("autopilot.tilt_error_deg", autopilot.tilt_error_deg, 0, 20);
  check.range("rig_error.led_mm", rig_error.led_mm, 0, 50);
  check.range("rig_error.led_frame_deg", rig_error.led_frame_deg, 0, 30);
  check.range("rig_error.mount_mm", rig_error.mount_mm, 0, 200);
  check.range("rig_error.mount_deg", rig_error.mount_deg, 0, 20);
  check.range("rig_error.focal", rig_error.focal, 0, 0.2);
  check.range("rig_error.principal_px", rig_error.principal_px, 0, 100);
  check.range("rig_error.mass", rig_error.mass, 0, 0.5);
  check.range("rig_error.com_mm", rig_error.com_mm, 0, 50);
  check.range("rig_error.thrust", rig_error.thrust, 0, 0.5);
  check.range("planner_delay_ms", planner_delay_ms, 0, 5000);
  for (std::size_t k = 0; k < faults.size(); ++k) {
    const std::string name = "faults[" + std::to_string(k) + "].";
    check_fault(faults[k], name, check);
    const bool drives = faults[k].kind == FaultKind::pad_start ||
                        faults[k].kind == FaultKind::pad_stop ||
                        faults[k].kind == FaultKind::pad_turn;
    check.that(!recorded || !drives,
               name + "kind: a recorded drive goes as it was recorded");
  }
  return check.result();
}

Scenario perfect_world(Scenario scenario) {
  scenario.wind = {};
  scenario.radio = {.latency_ms = 0, .jitter_ms = 0, .loss = 0, .burst_ms = 0};
  scenario.camera.depth_offset_ms = 0;
  scenario.odometry.latency_ms = 0;
  scenario.odometry.scale_error = 0;
  scenario.odometry.yaw_rate_bias_deg_s = 0;
  scenario.odometry.slip = 0;
  scenario.autopilot.heading_drift_deg_min = 0;
  scenario.autopilot.tilt_error_deg = 0;
  scenario.autopilot.hover_error = 0;
  scenario.rig_error = {.led_mm = 0,
                        .led_frame_deg = 0,
                        .mount_mm = 0,
                        .mount_deg = 0,
                        .focal = 0,
                        .principal_px = 0,
                        .mass = 0,
                        .com_mm = 0,
                        .thrust = 0};
  scenario.faults.clear();
  return scenario;
}

}  // namespace alight
