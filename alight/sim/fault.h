#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "alight/base/bounds.h"
#include "alight/base/time.h"

namespace alight {

/// What can go wrong between the true world and the brain, or in the world itself.
enum class FaultKind : std::uint8_t {
  // LEDs, of which `led` names one.
  led_dead,
  led_flicker,  ///< Lit in `lit_share` of the pictures, by chance.
  led_dim,      ///< Of `brightness` of its own.
  // Pictures.
  camera_out,     ///< None is taken.
  camera_late,    ///< By `late_ms`, in order, so that some come in a clump at the end.
  camera_repeat,  ///< Each comes twice, the second time with the next.
  camera_freeze,  ///< The last good one comes again and again, as if new.
  camera_noise,   ///< Of `noise_counts` sd in every pixel, on top of the camera's.
  camera_glare,   ///< A lamp shines into the lens: a veil of `glare_counts` about it.
  camera_exposure,   ///< The automatic sets `exposure_factor` times what it should.
  camera_occlusion,  ///< Something dark hides `covered_share` of the picture.
  other_drone,       ///< One with the same LEDs hovers at `other_x_m` and so on in N.
  depth_out,         ///< Pictures come without depth.
  depth_wrong,       ///< All depth is `depth_factor` times the true one.
  // Radio.
  radio_stall,    ///< Nothing passes; at the end all that was sent arrives at once.
  radio_out,      ///< Nothing passes; what was queued is lost.
  uplink_out,     ///< Only the way to the drone fails.
  telemetry_out,  ///< Only the way from it.
  // Odometry of the platform.
  odometry_out,
  odometry_jump,   ///< The pose jumps ahead by `jump_m` and says so (`resets`).
  odometry_shift,  ///< It jumps likewise and does not say so.
  odometry_drift,  ///< Speed off by `drift_m_s` to the left, turn by `drift_deg_s`.
  // Autopilot.
  autopilot_reset,  ///< Its estimator: heading off by `turn_deg`, speed by `reset_m_s`.
  autopilot_mode,   ///< The safety pilot takes over and lets it hold its place.
  autopilot_refuse,  ///< It does not arm.
  battery_low,       ///< No more than `charge` is left in it, from then on.
  // The platform's computer.
  computer_stall,  ///< The brain does not run; what arrives waits.
  planner_late,    ///< Plans come later by `late_ms`.
  // The operator.
  operator_hold,   ///< Says hold and, at the end, go.
  operator_abort,  ///< Says abort.
  // The world.
  gust,       ///< A blow of `gust_m_s` beside the wind, from the scenario's from_deg.
  pad_start,  ///< The platform drives off, at `pad_m_s`, whatever it was told.
  pad_stop,   ///< It brakes hard and stands.
  pad_turn,   ///< It turns hard at `pad_deg_s`.
};
inline constexpr int kFaultKinds = 34;
const char* to_string(FaultKind kind);
std::optional<FaultKind> fault_kind(std::string_view name);

/// One fault, on in [at_s, at_s + for_s). Each kind reads those of the rest that its
/// name above says (fault_parameters).
struct FaultScenario {
  FaultKind kind = FaultKind::radio_out;
  double at_s = 0;
  double for_s = 1;  ///< Jumps, shifts, resets and a low battery happen at once.

  double led = 0;  ///< As in the rig, from 0.
  double lit_share = 0.5;
  double brightness = 0.15;
  double late_ms = 150;
  double noise_counts = 20;
  double glare_counts = 120;
  double exposure_factor = 8;
  double covered_share = 0.5;
  double other_x_m = -1.2;
  double other_y_m = 0.6;
  double other_z_m = 0.5;
  double depth_factor = 1.5;
  double jump_m = 0.5;
  double drift_m_s = 0.3;
  double drift_deg_s = 0;
  double turn_deg = 30;
  double reset_m_s = 0.5;
  double charge = 0.1;
  double gust_m_s = 4;
  double pad_m_s = 1;
  double pad_deg_s = 60;

  bool on(Time t) const {
    const double t_s = to_seconds(t);
    return t_s >= at_s && t_s < at_s + for_s;
  }
};

/// A parameter that a kind of fault takes, as files name it.
struct FaultParameter {
  const char* name;
  double FaultScenario::*value;
  double low, high;    ///< Ends included.
  bool whole = false;  ///< Must be a whole number.
};
std::span<const FaultParameter> fault_parameters(FaultKind kind);

/// Complains about the first number of `fault` out of its bounds; `name` precedes the
/// field's.
void check_fault(const FaultScenario& fault, const std::string& name,
                 FirstComplaint& check);

/// The first fault of this kind that is on at `t`; null when none is.
const FaultScenario* active_fault(const std::vector<FaultScenario>& faults,
                                  FaultKind kind, Time t);

}  // namespace alight
