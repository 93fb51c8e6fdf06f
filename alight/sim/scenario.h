#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/pose_log.h"
#include "alight/sim/fault.h"

namespace alight {

/// The world of one simulated landing (CONTRACT: Scenario), in the units of the file.
/// Reading YAML is `run`'s. Every seed draws its own world inside these ranges.

enum class PlatformKind : std::uint8_t {
  still,
  straight,
  circle,
  block,
  eight,
  recorded,
  boat
};
const char* to_string(PlatformKind kind);
std::optional<PlatformKind> platform_kind(std::string_view name);

enum class StartPlace : std::uint8_t { pad, floor };
const char* to_string(StartPlace place);
std::optional<StartPlace> start_place(std::string_view name);

enum class Gusts : std::uint8_t { none, dryden };
const char* to_string(Gusts gusts);
std::optional<Gusts> gusts_kind(std::string_view name);

enum class AutopilotInterface : std::uint8_t { attitude, velocity };
const char* to_string(AutopilotInterface interface);
std::optional<AutopilotInterface> autopilot_interface(std::string_view name);

/// An irregular sea and the hull in it (seaway.h). Amplitudes are significant ones: the
/// mean of the highest third, twice the standard deviation. The pad sits above and
/// behind the point about which the hull turns, which lies in the mean water surface.
struct SeaScenario {
  double heave_m = 0.1;
  double roll_deg = 4;
  double pitch_deg = 3;
  double period_s = 6;  ///< Of the spectrum's peak.
  double gamma = 3.3;   ///< How peaked; 1: a fully developed sea.
  double pad_above_m = 3;
  double pad_aft_m = 2;
};

struct PlatformScenario {
  PlatformKind kind = PlatformKind::circle;
  double speed_m_s = 0.9;
  double radius_m = 1.5;
  double side_m = 3;
  double corner_radius_m = 0.5;  ///< 0: corners turned in place
  double brake_m_s2 = 2;  ///< When it is wished to be slower; it speeds up at 0.6.
  double yaw_rate_max_deg_s = 60;  ///< The vehicle slows down for what asks for more.
  SeaScenario sea;                 ///< boat
  std::string file;                ///< recorded: where the drive stands (README.md),
  std::string file_text;           ///< what stands there,
  PoseLog drive;                   ///< and what it says: X_IN.
};

struct StartScenario {
  StartPlace place = StartPlace::pad;
  bool platform_moving = true;  ///< Drives from the start, else when told to.
};

struct WindScenario {
  double mean_m_s = 0;
  double from_deg = 0;  ///< Where it blows from: 0 along +x of I, 90 along +y.
  Gusts gusts = Gusts::none;
};

struct RadioScenario {
  double latency_ms = 40;  ///< One way, mean.
  double jitter_ms = 15;   ///< sd; order is kept.
  double loss = 0.02;      ///< Mean share of packets, lost in bursts (Gilbert-Elliott).
  double burst_ms = 0;     ///< Length of stalls, about one a second; 0: none.
  int queue = 32;          ///< Packets that may wait, both directions together.
};

/// Read by the camera's renderer.
struct CameraScenario {
  int lights = 40;  ///< Fixed in the room.
  double pad_reflectance = 0.2;
  int jpeg = 0;        ///< Quality; 0: not compressed.
  double noise = 1.0;  ///< Times that of a usual sensor.
  double gamma = 0;    ///< Rig::gamma of the camera that looks; 0: as the rig says.
  double depth_offset_ms =
      15;  ///< Depth against colour, drawn uniformly within +- this.
};

struct OdometryScenario {
  double rate_hz = 50;
  double latency_ms = 30;
  double scale_error = 0.02;       ///< Drawn uniformly within +- this.
  double yaw_rate_bias_deg_s = 1;  ///< Drawn uniformly within +- this.
  double slip = 0.02;              ///< Sideways and yaw slip in turns, share, likewise.
  double imu_rate_hz = 0;          ///< Platform IMU; 0: there is none.
};

/// What the autopilot does when set-points stop coming.
enum class LinkLossAction : std::uint8_t {
  land,     ///< Brakes over the ground, lands and disarms; needs the external pose,
  descend,  ///< without which it comes to this: level, sinking, motors never stopped.
  drift     ///< Level at hover thrust, for ever.
};
const char* to_string(LinkLossAction action);

struct AutopilotScenario {
  AutopilotInterface interface = AutopilotInterface::attitude;
  double heading_drift_deg_min = 10;  ///< Within +-; without external pose only.
  double tilt_error_deg = 1;          ///< Of its belief, up to.
  bool external_pose = true;  ///< Fuses the pose the ground sends; else IMU only:
                              ///< heading off by any angle.
  double link_loss_ms =
      300;  ///< Without set-points (COM_OF_LOSS_T); then it does this:
  LinkLossAction link_loss = LinkLossAction::land;
  double blind_after_ms = 2000;  ///< Of the last external pose (EKF2_NOAID_TOUT).
  double land_speed_m_s = 0.42;  ///< With which it lands by itself (MPC_LAND_SPEED).
  double hover_error = 0.03;     ///< Of its hover thrust, uniform within +- this share.
};

struct RigErrorScenario {
  double led_mm = 2;         ///< sd of each LED's place, each axis.
  double led_frame_deg = 5;  ///< LED frame against IMU, each axis uniform within +-.
  double mount_mm = 5;       ///< sd, each axis.
  double mount_deg = 1;      ///< sd, each axis.
  double focal = 0.005;      ///< sd, share.
  double principal_px = 3;   ///< sd, each axis.
  double mass = 0.1;         ///< Uniform within +- this share.
  double com_mm = 5;         ///< Centre of mass, each axis uniform within +-: a battery
                             ///< of a quarter of the weight strapped on 2 cm off.
  double thrust = 0.1;       ///< Maximum thrust, uniform within +- this share.
};

struct Scenario {
  PlatformScenario platform;
  StartScenario start;
  WindScenario wind;
  RadioScenario radio;
  CameraScenario camera;
  OdometryScenario odometry;
  AutopilotScenario autopilot;
  RigErrorScenario rig_error;
  double planner_delay_ms = 15;
  std::vector<FaultScenario> faults;

  /// Names the first field that is out of range, its value and its bounds.
  Result<void> validate() const;
};

/// No rig errors, radio, odometry, autopilot and wind without fault: for tests and
/// tables.
Scenario perfect_world(Scenario scenario);

}  // namespace alight
