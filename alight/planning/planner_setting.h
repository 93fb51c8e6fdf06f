#pragma once
#include "alight/planning/time_allocation.h"

namespace alight {

/// What a planner was made of, and the steps of a plan (planner.cpp, explain.cpp,
/// escape.cpp).
struct Planner::Setting {
  PlannerConfig config;
  Rig rig;
  LimitPolyhedron polyhedron;
  FlatState end;

  /// The one way to a plan; `details` also collects what it was made from.
  PlanResult run(const PlanRequest& request, PlanDetails* details) const;
  /// With a landing that begins in one of the spaces. False: `result` has the reason.
  bool run_from(Beginning beginning, const PlanRequest& request, LandingQp& qp,
                PlanResult& result, PlanDetails* details) const;

  /// From a state `at` s after the request's start to `return_to`, out of the
  /// touch-down space (`low`) or within the rear one.
  Escape escape(const PlanRequest& request, Seconds at, const FlatState& state,
                bool low, bool certified, LandingQp& qp) const;
  PlanRequest with_return(const PlanRequest& request, Beginning beginning) const;
  /// The escape from as late on the trajectory as there is one.
  Escape latest_escape(const PlanRequest& request, const Trajectory& trajectory,
                       Beginning beginning, LandingQp& qp) const;

  DynamicLimitRows limits_of(const PlanRequest& request, double factor) const;
  AllocationTask allocation_task(const PlanRequest& request, const FlatState& start,
                                 const FlatState& goal, const Corridor& corridor,
                                 const DynamicLimitRows& limits) const;

  /// eqn:MP_OPT in full, every row of it.
  void collect_qp(const PlanRequest& request, const std::array<Seconds, kSegments>& T,
                  const Corridor& corridor, const DynamicLimitRows& limits,
                  const QpOutcome& outcome, const std::vector<ActiveRow>& active,
                  PlanDetails& details) const;
};

/// What is wrong with a request's numbers; null if nothing.
const char* complaint(const PlanRequest& request);

/// The curve of a solved QP from `start` to `end`.
Trajectory make_trajectory(const QpOutcome& outcome,
                           const std::array<Seconds, kSegments>& T,
                           const FlatState& start, const FlatState& end);

inline constexpr double kViolated = -1e-6;  ///< Margins below this refuse a trajectory.

}  // namespace alight
