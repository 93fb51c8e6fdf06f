#include "alight/planning/planner.h"

#include <algorithm>
#include <cmath>

#include "alight/planning/certificate.h"
#include "alight/planning/planner_setting.h"
#include "alight/planning/rig_fit.h"

namespace alight {
namespace {

const char* reason(const QpOutcome::Kind kind, const RowId& row,
                   const Corridor& corridor, const DynamicLimitRows& limits) {
  if (kind == QpOutcome::Kind::no_convergence) return "the solver did not converge";
  if (kind == QpOutcome::Kind::yaw_rate) return cannot_be_met(Constraint::yaw_rate);
  const Constraint meaning = row_meaning(row, corridor, limits);
  if (kind == QpOutcome::Kind::infeasible) return cannot_be_met(meaning);
  return row.segment == 0 ? start_outside(meaning) : end_outside(meaning);
}

/// Control points that the boundary states decide, whatever the rest of the curve.
Fixed fixed_points(const Reduction& reduction, bool keep_jerk) {
  Fixed fixed;
  const Eigen::Index first = keep_jerk ? 4 : 3;
  for (Eigen::Index i = 0; i < first; ++i) {
    fixed[0].push_back(reduction.m0[0].row(i).transpose());
  }
  for (Eigen::Index i = kControlPoints - 3; i < kControlPoints; ++i) {
    fixed[1].push_back(reduction.m0[1].row(i).transpose());
  }
  return fixed;
}

}  // namespace

Trajectory make_trajectory(const QpOutcome& outcome,
                           const std::array<Seconds, kSegments>& T,
                           const FlatState& start, const FlatState& end) {
  Trajectory trajectory;
  trajectory.durations = T;
  trajectory.yaw_start = start.yaw;
  trajectory.yaw_end = end.yaw;
  trajectory.yaw_rate_start = start.yaw_rate;
  trajectory.yaw_acceleration_start = start.yaw_acceleration;
  for (std::size_t s = 0; s < kSegments; ++s) {
    for (std::size_t i = 0; i < kControlPoints; ++i) {
      trajectory.c[s][i] = outcome.c[s].row(static_cast<Eigen::Index>(i)).transpose();
    }
  }
  return trajectory;
}

DynamicLimitRows Planner::Setting::limits_of(const PlanRequest& request,
                                             double factor) const {
  DynamicLimitRows limits =
      make_limits(config, rig, polyhedron, request.platform, factor, request.forecast);
  const double margin = std::sqrt(3.0) * config.free_space_margin_m;
  limits.reach = std::max(request.from.p_NB.norm(), end.p_NB.norm()) + margin;
  return limits;
}

AllocationTask Planner::Setting::allocation_task(const PlanRequest& request,
                                                 const FlatState& start,
                                                 const FlatState& goal,
                                                 const Corridor& corridor,
                                                 const DynamicLimitRows& limits) const {
  AllocationTask task{.config = config,
                      .start = start,
                      .end = goal,
                      .keep_jerk = request.keep_jerk,
                      .corridor = corridor,
                      .limits = limits};
  if (config.profile == Profile::paper) return task;
  task.heading_rate = heading_rate_max(config, rig.drone);
  task.request = &request;
  return task;
}

bool Planner::Setting::run_from(Beginning beginning, const PlanRequest& request,
                                LandingQp& qp, PlanResult& result,
                                PlanDetails* details) const {
  const auto refused = [&](const char* why) {
    result.reason = why;
    return false;
  };
  // The corridor (eqn:MP_KINE) and the relative dynamic limits (eqn:MP_dynconstr).
  const FlatState& from = request.from;
  Corridor corridor = build_corridor(config, rig, from, end, beginning);
  const DynamicLimitRows limits = limits_of(request, 1);
  if (details != nullptr) {
    details->halfspaces.assign(corridor.planes.begin(), corridor.planes.end());
  }
  if (corridor.full) return refused("too many obstacles");
  for (const HalfSpace& plane : corridor.planes) {
    const bool first = plane.segment == 0;
    if (plane.a.dot(first ? from.p_NB : end.p_NB) <= plane.b + 1e-7) continue;
    return refused(first ? start_outside(plane.meaning) : end_outside(plane.meaning));
  }

  // Time allocation under tightened limits, unless the times are given. Where those
  // leave no way the full ones may, and where no likely time does another one may.
  std::array<Seconds, kSegments> T = request.durations;
  if (T[0] == 0) {
    const TimeRange range = time_range(config, rig, request, end);
    const DynamicLimitRows tightened = limits_of(request, config.tightening);
    const AllocationTask tight =
        allocation_task(request, from, end, corridor, tightened);
    const AllocationTask full = allocation_task(request, from, end, corridor, limits);
    const TimeSamples even = even_samples(config, range);
    const auto attempt = [&](const AllocationTask& task, const TimeSamples& samples) {
      const Allocation found = allocate_time(task, samples, qp);
      result.tried += found.tried;
      result.feasible = found.feasible;
      return found;
    };
    Allocation allocation = attempt(tight, even);
    if (allocation.feasible == 0) allocation = attempt(full, even);
    if (allocation.feasible == 0) {
      const Allocation wide = attempt(full, wide_samples(range));
      if (wide.feasible > 0) allocation = wide;
    }
    if (details != nullptr) {
      details->samples = even;
      details->wide_samples = wide_samples(range);
    }
    T = allocation.feasible > 0 ? allocation.best : allocation.blamed;
    if (allocation.feasible == 0) {
      if (details != nullptr) {
        details->best = T;
        collect_qp(request, T, corridor, limits, {}, {}, *details);
      }
      return refused(reason(allocation.failure, allocation.blame, corridor, limits));
    }
  } else {
    const AllocationTask task = allocation_task(request, from, end, corridor, limits);
    result.tried = 1;
    if (task.heading_rate > 0 &&
        !heading_fits(request, from, end, T[0] + T[1], task.heading_rate)) {
      return refused(cannot_be_met(Constraint::yaw_rate));
    }
  }

  // The online solve; away from the picture's edges, if there is a way.
  const Reduction reduction(from, end, T, request.keep_jerk);
  QpOutcome outcome;
  if (add_view_wishes(config, rig, from, fixed_points(reduction, request.keep_jerk),
                      corridor)) {
    outcome = qp.solve(reduction, corridor, limits);
  }
  if (!outcome.solved()) {
    corridor.planes.truncate(corridor.hard);
    outcome = qp.solve(reduction, corridor, limits);
  }
  if (request.durations[0] != 0) result.feasible = outcome.solved() ? 1 : 0;
  if (details != nullptr) {
    details->best = T;
    details->halfspaces.assign(corridor.planes.begin(), corridor.planes.end());
    collect_qp(request, T, corridor, limits, outcome, qp.active(), *details);
  }
  if (!outcome.solved()) {
    return refused(reason(outcome.kind, outcome.blame, corridor, limits));
  }
  result.trajectory = make_trajectory(outcome, T, from, end);
  result.jerk_cost = outcome.jerk_cost;
  result.cost = outcome.jerk_cost - reduction.k / std::pow(reduction.h, 5);

  // The solver is not believed.
  result.certificate =
      certify({config, rig, request, end, &corridor}, result.trajectory);
  const CertificateEntry* least = weakest(result.certificate);
  if (least == nullptr || !(least->margin >= kViolated)) {
    return refused(least == nullptr ? "no certificate" : least->constraint);
  }
  result.status = PlanStatus::solved;
  result.reason = "";
  return true;
}

PlanResult Planner::Setting::run(const PlanRequest& request,
                                 PlanDetails* details) const {
  PlanResult result;
  result.id = request.id;
  result.start = request.start;
  if (const char* what = complaint(request)) {
    result.status = PlanStatus::invalid_request;
    result.reason = what;
    return result;
  }
  LandingQp qp;
  bool first = true;
  for (const Beginning beginning : beginnings(config, rig, request.from, end)) {
    PlanResult attempt = result;
    PlanDetails told;
    const bool solved =
        run_from(beginning, request, qp, attempt, details != nullptr ? &told : nullptr);
    if (!first && !solved) continue;  // The likelier space's reason is the one to tell.
    if (solved && config.profile == Profile::standard) {
      attempt.escape = latest_escape(request, attempt.trajectory, beginning, qp);
    }
    result = attempt;
    if (details != nullptr) *details = std::move(told);
    if (solved) break;
    first = false;
    result.id = request.id;
  }
  return result;
}

Planner::Planner(std::shared_ptr<const Setting> setting)
    : setting_(std::move(setting)) {}

const PlannerConfig& Planner::config() const { return setting_->config; }

Result<Planner> Planner::create(const PlannerConfig& config, const Rig& rig) {
  if (const auto valid = config.validate(); !valid) return fail(valid.error());
  if (const auto valid = rig.validate(); !valid) return fail(valid.error());
  auto setting = std::make_shared<Setting>();
  setting->config = fitted_to(config, rig);
  setting->rig = rig;
  setting->polyhedron = make_polyhedron(config.profile);
  setting->end = landing_end(config, rig);
  return Planner(std::move(setting));
}

PlanResult Planner::plan(const PlanRequest& request) const {
  if (!request.way_back) return setting_->run(request, nullptr);
  PlanResult result;
  result.id = request.id;
  result.start = request.start;
  result.escape = escape(request);
  result.trajectory = result.escape.trajectory;
  result.status = result.escape.exists ? PlanStatus::solved : PlanStatus::infeasible;
  result.reason = result.escape.exists ? "" : "no certified way back from here";
  return result;
}

PlanResult plan(const Planner& planner, const PlanRequest& request) {
  return planner.plan(request);
}

}  // namespace alight
