#include "alight/sim/fault.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace alight {
namespace {

using F = FaultScenario;
using P = FaultParameter;

constexpr double kLastLed = 15;  // kMaxLeds - 1; World holds it against the rig

constexpr P kLed{"led", &F::led, 0, kLastLed, true};
constexpr P kLate{"late_ms", &F::late_ms, 0, 1000};
constexpr P kJump{"jump_m", &F::jump_m, -10, 10};

constexpr std::array kLedDead{kLed};
constexpr std::array kLedFlicker{kLed, P{"lit_share", &F::lit_share, 0, 1}};
constexpr std::array kLedDim{kLed, P{"brightness", &F::brightness, 0, 10}};
constexpr std::array kLateAlone{kLate};
constexpr std::array kNoise{P{"noise_counts", &F::noise_counts, 0, 100}};
constexpr std::array kGlare{P{"glare_counts", &F::glare_counts, 0, 1000}};
constexpr std::array kExposure{P{"exposure_factor", &F::exposure_factor, 0.01, 100}};
constexpr std::array kCover{P{"covered_share", &F::covered_share, 0, 1}};
constexpr std::array kOther{P{"other_x_m", &F::other_x_m, -20, 20},
                            P{"other_y_m", &F::other_y_m, -20, 20},
                            P{"other_z_m", &F::other_z_m, -20, 20}};
constexpr std::array kDepth{P{"depth_factor", &F::depth_factor, 0.1, 10}};
constexpr std::array kJumpAlone{kJump};
constexpr std::array kDrift{P{"drift_m_s", &F::drift_m_s, -5, 5},
                            P{"drift_deg_s", &F::drift_deg_s, -90, 90}};
constexpr std::array kReset{P{"turn_deg", &F::turn_deg, -180, 180},
                            P{"reset_m_s", &F::reset_m_s, 0, 10}};
constexpr std::array kBattery{P{"charge", &F::charge, 0, 1}};
constexpr std::array kGust{P{"gust_m_s", &F::gust_m_s, -30, 30}};
constexpr std::array kPadStart{P{"pad_m_s", &F::pad_m_s, 0, 20}};
constexpr std::array kPadTurn{P{"pad_deg_s", &F::pad_deg_s, -180, 180}};

struct Kind {
  const char* name;
  std::span<const P> parameters;
};

// In the order of FaultKind.
constexpr std::array<Kind, kFaultKinds> kKinds{{
    {"led_dead", kLedDead},
    {"led_flicker", kLedFlicker},
    {"led_dim", kLedDim},
    {"camera_out", {}},
    {"camera_late", kLateAlone},
    {"camera_repeat", {}},
    {"camera_freeze", {}},
    {"camera_noise", kNoise},
    {"camera_glare", kGlare},
    {"camera_exposure", kExposure},
    {"camera_occlusion", kCover},
    {"other_drone", kOther},
    {"depth_out", {}},
    {"depth_wrong", kDepth},
    {"radio_stall", {}},
    {"radio_out", {}},
    {"uplink_out", {}},
    {"telemetry_out", {}},
    {"odometry_out", {}},
    {"odometry_jump", kJumpAlone},
    {"odometry_shift", kJumpAlone},
    {"odometry_drift", kDrift},
    {"autopilot_reset", kReset},
    {"autopilot_mode", {}},
    {"autopilot_refuse", {}},
    {"battery_low", kBattery},
    {"computer_stall", {}},
    {"planner_late", kLateAlone},
    {"operator_hold", {}},
    {"operator_abort", {}},
    {"gust", kGust},
    {"pad_start", kPadStart},
    {"pad_stop", {}},
    {"pad_turn", kPadTurn},
}};
static_assert(static_cast<int>(FaultKind::pad_turn) == kFaultKinds - 1);

const Kind& of(FaultKind kind) { return kKinds[static_cast<std::size_t>(kind)]; }

}  // namespace

const char* to_string(FaultKind kind) { return of(kind).name; }

std::optional<FaultKind> fault_kind(std::string_view name) {
  const auto found = std::find_if(kKinds.begin(), kKinds.end(),
                                  [&](const Kind& k) { return name == k.name; });
  if (found == kKinds.end()) return std::nullopt;
  return static_cast<FaultKind>(found - kKinds.begin());
}

std::span<const FaultParameter> fault_parameters(FaultKind kind) {
  return of(kind).parameters;
}

void check_fault(const FaultScenario& fault, const std::string& name,
                 FirstComplaint& check) {
  check.range(name + "at_s", fault.at_s, 0, 3600);
  check.range(name + "for_s", fault.for_s, 0, 3600);
  for (const FaultParameter& p : fault_parameters(fault.kind)) {
    const double value = fault.*p.value;
    check.range(name + p.name, value, p.low, p.high);
    check.that(!p.whole || value == std::floor(value),
               name + p.name + " must be a whole number");
  }
}

const FaultScenario* active_fault(const std::vector<FaultScenario>& faults,
                                  FaultKind kind, Time t) {
  for (const FaultScenario& f : faults) {
    if (f.kind == kind && f.on(t)) return &f;
  }
  return nullptr;
}

}  // namespace alight
