#pragma once
#include <limits>

#include "alight/geometry/platform_state.h"
#include "alight/geometry/relative_state.h"
#include "alight/mission/landing_io.h"
#include "alight/mission/link_monitor.h"
#include "alight/mission/sight_watch.h"

namespace alight {

/// s; how far ahead the touch-down is looked at.
inline constexpr Seconds kTouchAhead = 0.4;
/// s; longer than any gap that a healthy camera and radio leave.
inline constexpr Seconds kFreshSight = 0.15;

/// What the mission knows when it decides.
struct MissionInput {
  Time now = 0;
  OperatorWish wish = OperatorWish::none;  ///< The newest, since the last step.

  bool telemetry_heard = false;
  bool armed = false;
  AutopilotMode mode = AutopilotMode::manual;
  double battery = 1;
  Time told = 0;  ///< When the newest telemetry was captured,
  double climb =
      std::numeric_limits<double>::quiet_NaN();  ///< and what it told of dz/dt, m/s;
                                                 ///< NaN: nothing.
  bool stands_on_floor = false;  ///< Landed beside the platform, its motors running.

  const LinkMonitor* link = nullptr;
  bool platform_ready = false;  ///< Odometry is fresh.

  bool estimate_valid = false;  ///< There is a state, if only a predicted one.
  RelativeState x;              ///< At now.
  RelativeState x_seen;         ///< At the last picture.
  Time seen = 0;                ///< When that was captured.
  Time motion_known = 0;        ///< Until then pictures or the autopilot tell it.
  Seconds acts_in = 0;          ///< From now to when an attitude sent now acts.
  Seconds thrust_acts_in = 0;   ///< Likewise of thrust.
  double z_acted = 0;           ///< Height in N when thrust that is sent now acts, m.
  double miss_sd_m = 0;         ///< As `miss_sd`, of x taken to the pad.
  Blindness blindness = Blindness::leds;  ///< Why nothing newer is seen.
  bool picture_repeats = false;           ///< It equals the one before to the last bit.
  bool computer_was_late = false;         ///< The brain was not run for a while.
  Time woke = 0;                          ///< When it ran again after the last stall.
  PlatformState platform;                 ///< At now.
  /// Specific force in N that keeps the drone at rest over the pad's middle, as
  /// predicted for kTouchAhead from now.
  Vector3 f_touch_N = Vector3(0, 0, kGravity);
  /// The same for `Mission::touches_in` from now, or when it leans most about then.
  Vector3 f_end_N = f_touch_N;
  /// What accelerates a drone that is level and at rest over the ground, in N, m/s^2:
  /// wind above all.
  Vector3 push_N = Vector3::Zero();
  double deck_swing = 0;  ///< sd with which the deck's tilt changes it, m/s^2.

  const PlanArrival* plan = nullptr;  ///< Arrived since the last step.
};

/// How long ago the drone was seen.
inline Seconds unseen(const MissionInput& in) { return to_seconds(in.now - in.seen); }

inline bool in_sight(const MissionInput& in, Seconds within = kFreshSight) {
  return in.estimate_valid && unseen(in) < within;
}

}  // namespace alight
