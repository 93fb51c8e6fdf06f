#pragma once
#include <optional>

#include "alight/planning/planner.h"

namespace alight {

/// What a plan anew is made from. Everything as predicted for `in_force`.
struct Replan {
  Time in_force = 0;  ///< When the new trajectory is to take over.
  PlatformState platform{};
  PlatformForecast forecast{};
  /// Sample the durations (31 x 31 QPs); else one QP over what is left of them.
  bool sweep = false;
};

/// The request that carries a certified landing on: from its own state at `in_force`,
/// up to the third derivative, heading included, with an escape to where it had one to.
/// Nothing if the landing has not begun by then or has less than 0.3 s to go: it then
/// goes on as it is.
std::optional<PlanRequest> replan_request(const PlanResult& current,
                                          const Replan& replan);

/// Whether `fresh`, which arrived at `now`, takes over from `current`: certified, not
/// late, no detour of half as long again as what is left, and continuous with it up to
/// the third derivative. If not, the last certified trajectory goes on, unchanged.
bool takes_over(const PlanResult& current, const PlanResult& fresh, Time now);

/// Both and the plan between them: what is in force afterwards, for a result at `now`.
PlanResult replanned(const Planner& planner, const PlanResult& current,
                     const Replan& replan, Time now);

}  // namespace alight
