#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "alight/base/fixed_vector.h"
#include "alight/geometry/platform_state.h"
#include "alight/geometry/rig.h"
#include "alight/geometry/trajectory.h"
#include "alight/planning/platform_forecast.h"

namespace alight {

enum class Profile : std::uint8_t { standard, paper };

/// What the mission asks of the planner. Everything in N at time `start`.
struct PlanRequest {
  std::uint32_t id = 0;
  Time start = 0;          ///< When the trajectory will be in force.
  FlatState from;          ///< Reference at `start`.
  PlatformState platform;  ///< Predicted at `start`; kept turning at w, speed along N,
  PlatformForecast forecast;  ///< unless this says how it goes on (standard profile).
  /// Keep these segment times and solve once (the paper's "online solving"); both zero:
  /// sample the time allocation.
  std::array<Seconds, kSegments> durations{0, 0};
  /// Not a landing but the way back from one: out of the touch-down space to rest in
  /// the rear one (standard profile). The result's trajectory is the escape's.
  bool way_back = false;
  bool keep_jerk = false;  ///< The start's jerk holds too: a trajectory taken over.
  /// Where an escape ends, at rest; else in the rear space where the landing starts, or
  /// in the middle of the view.
  bool has_return = false;
  Vector3 return_to = Vector3::Zero();
};

enum class PlanStatus : std::uint8_t { solved, infeasible, invalid_request };

/// One constraint of a trajectory and how far inside it the trajectory stays, checked
/// by code that is not the solver. Negative: violated.
struct CertificateEntry {
  const char* constraint = "";  ///< Static text, e.g. "view_upper", "speed".
  double margin = 0;            ///< m, m/s or m/s^2, as the constraint has it.
};

/// The way back to the rear space, at rest there.
struct Escape {
  bool exists = false;
  Seconds from = 0;     ///< s after the landing's start that it leaves the trajectory,
  double height_m = 0;  ///< at this height of the origin of B above the pad.
  Trajectory trajectory;
  double margin = 0;  ///< The least of its certificate.
};

/// Bounded and free of allocation, so that it can travel as an event.
struct PlanResult {
  std::uint32_t id = 0;
  PlanStatus status = PlanStatus::infeasible;
  const char* reason = "";  ///< Static text: which bound failed, for people.
  Time start = 0;
  Trajectory trajectory;
  double cost = 0;       ///< Of the QP as solved, without its constant.
  double jerk_cost = 0;  ///< m^2/s^5, eqn:MP_COST
  int tried = 0;         ///< Time samples tried,
  int feasible = 0;      ///< of which feasible.
  FixedVector<CertificateEntry, 32> certificate;
  /// From the latest instant of the trajectory that has one: from any state before it a
  /// way back is to go on to there. Its height is the commit height. Standard profile.
  Escape escape;

  bool ok() const { return status == PlanStatus::solved; }
};

}  // namespace alight
