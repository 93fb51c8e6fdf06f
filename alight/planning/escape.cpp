#include <algorithm>
#include <cmath>

#include "alight/planning/certificate.h"
#include "alight/planning/planner_setting.h"

namespace alight {
namespace {

constexpr std::array<Seconds, 7> kFirst{0.15, 0.2, 0.3, 0.45, 0.7, 1.0, 1.5};
constexpr std::array<Seconds, 6> kSecond{0.5, 0.8, 1.2, 1.8, 2.7, 4.0};
constexpr int kInstants = 10;   ///< Tried from the end backwards, over each segment.
constexpr int kBisections = 5;  ///< Between the first that has an escape and the next.
constexpr int kRetreats = 4;    ///< Should its certificate not hold: that much earlier.
constexpr Seconds kRetreat = 0.05;

/// From `at` s on.
PlanRequest later(const PlanRequest& request, Seconds at, const FlatState& state) {
  PlanRequest next = request;
  next.start = request.start + from_seconds(at);
  next.from = state;
  if (request.forecast.nodes.empty()) {
    next.platform = predict(request.platform, at);
  } else {
    next.forecast.begin += at;
  }
  next.keep_jerk = false;
  return next;
}

}  // namespace

Escape Planner::Setting::escape(const PlanRequest& request, Seconds at,
                                const FlatState& state, bool low, bool certified,
                                LandingQp& qp) const {
  Escape escape;
  FlatState goal;
  goal.p_NB = request.return_to;
  goal.yaw = end.yaw;
  const Corridor corridor = build_escape_corridor(config, rig, state, goal, low);
  if (corridor.full) return escape;
  for (const HalfSpace& plane : corridor.planes) {
    const Vector3& p = plane.segment == 0 ? state.p_NB : goal.p_NB;
    if (plane.a.dot(p) > plane.b + 1e-7) return escape;
  }
  const PlanRequest task = later(request, at, state);
  const DynamicLimitRows limits = limits_of(task, 1);
  TimeSamples samples;
  samples[0].assign(kFirst.begin(), kFirst.end());
  samples[1].assign(kSecond.begin(), kSecond.end());
  AllocationTask durations = allocation_task(task, state, goal, corridor, limits);
  durations.any = !certified;
  const Allocation allocation = allocate_time(durations, samples, qp);
  if (allocation.feasible == 0) return escape;
  const QpOutcome outcome =
      qp.solve(Reduction(state, goal, allocation.best), corridor, limits);
  if (!outcome.solved()) return escape;
  escape.trajectory = make_trajectory(outcome, allocation.best, state, goal);
  escape.exists = true;
  escape.from = at;
  escape.height_m = state.p_NB.z();
  if (!certified) return escape;
  const Certificate certificate =
      certify({config, rig, task, goal, &corridor}, escape.trajectory);
  escape.margin = weakest(certificate)->margin;
  escape.exists = escape.margin >= kViolated;
  return escape;
}

Escape Planner::Setting::latest_escape(const PlanRequest& request,
                                       const Trajectory& trajectory,
                                       Beginning beginning, LandingQp& qp) const {
  const PlanRequest task = with_return(request, beginning);
  const auto at = [&](Seconds t, bool certified) {
    const bool low = t >= trajectory.durations[0] || beginning == Beginning::touch_down;
    return escape(task, t, trajectory.at(t), low, certified, qp);
  };
  Seconds none = trajectory.duration();
  Escape found;
  for (int i = 1; i <= 2 * kInstants && !found.exists; ++i) {
    const std::size_t s = i <= kInstants ? 1 : 0;
    const double share =
        1 - static_cast<double>(s == 1 ? i : i - kInstants) / kInstants;
    const Seconds t =
        (s == 1 ? trajectory.durations[0] : 0) + share * trajectory.durations[s];
    found = at(t, false);
    if (!found.exists) none = t;
  }
  if (!found.exists) return {};
  for (int i = 0; i < kBisections; ++i) {
    const Seconds middle = 0.5 * (found.from + none);
    const Escape later_one = at(middle, false);
    if (later_one.exists) {
      found = later_one;
    } else {
      none = middle;
    }
  }
  // The solver is not believed here either.
  for (int i = 0; i < kRetreats; ++i) {
    const Seconds t = std::max(0.0, found.from - i * kRetreat);
    const Escape sure = at(t, true);
    if (sure.exists) return sure;
  }
  return {};
}

PlanRequest Planner::Setting::with_return(const PlanRequest& request,
                                          Beginning beginning) const {
  PlanRequest task = request;
  if (task.has_return) return task;
  task.has_return = true;
  task.return_to = request.from.p_NB;
  if (beginning == Beginning::rear) return task;
  // The middle of the picture, at a distance that has room on all sides.
  for (const double distance : {1.2, 1.0, 1.5, 0.8, 2.0}) {
    FlatState there;
    there.p_NB = rig.camera.X_NC * Vector3(0, 0, distance);
    const Corridor corridor = build_corridor(config, rig, there, end, Beginning::rear);
    const bool inside = std::all_of(
        corridor.planes.begin(), corridor.planes.end(), [&](const HalfSpace& plane) {
          return plane.segment != 0 || plane.a.dot(there.p_NB) <= plane.b;
        });
    if (!inside) continue;
    task.return_to = there.p_NB;
    break;
  }
  return task;
}

Escape Planner::escape(const PlanRequest& request) const {
  if (complaint(request) != nullptr || config().profile == Profile::paper) return {};
  LandingQp qp;
  for (const Beginning space :
       beginnings(config(), setting_->rig, request.from, setting_->end)) {
    const Escape found =
        setting_->escape(setting_->with_return(request, space), 0, request.from,
                         space == Beginning::touch_down, true, qp);
    if (found.exists) return found;
  }
  return {};
}

}  // namespace alight
