#include "alight/planning/replan.h"

#include <cmath>

namespace alight {
namespace {

constexpr Seconds kLeastLeft = 0.3;    ///< A landing nearer to its end is left alone.
constexpr Seconds kLeastFirst = 0.05;  ///< The joint is kept if it is further away.

// A landing that would last longer than so many times what is left of it is a detour,
// about or above the pad that it was nearly on.
constexpr double kDetour = 1.5;
// What a solver leaves of a jump.
constexpr double kSamePlace = 1e-6;  ///< m, m/s, m/s^2, rad, rad/s
constexpr double kSameJerk = 1e-3;   ///< m/s^3

}  // namespace

std::optional<PlanRequest> replan_request(const PlanResult& current,
                                          const Replan& replan) {
  if (!current.ok()) return std::nullopt;
  const Trajectory& trajectory = current.trajectory;
  const Seconds gone = to_seconds(replan.in_force - current.start);
  const Seconds left = trajectory.duration() - gone;
  if (gone < 0 || left < kLeastLeft) return std::nullopt;

  PlanRequest request;
  request.start = replan.in_force;
  request.from = trajectory.at(gone);
  request.keep_jerk = true;
  request.platform = replan.platform;
  request.forecast = replan.forecast;
  if (current.escape.exists) {
    const Trajectory& back = current.escape.trajectory;
    request.has_return = true;
    request.return_to = back.at(back.duration()).p_NB;
  }
  if (replan.sweep) return request;
  const Seconds first = trajectory.durations[0] - gone;
  if (first > kLeastFirst) {
    request.durations = {first, trajectory.durations[1]};
  } else {
    request.durations = {left / 2, left / 2};
  }
  return request;
}

bool takes_over(const PlanResult& current, const PlanResult& fresh, Time now) {
  if (!fresh.ok() || now > fresh.start) return false;
  const Seconds gone = to_seconds(fresh.start - current.start);
  if (gone < 0 || gone > current.trajectory.duration()) return false;
  const Seconds left = current.trajectory.duration() - gone;
  if (fresh.trajectory.duration() > kDetour * left) return false;
  const FlatState a = current.trajectory.at(gone);
  const FlatState b = fresh.trajectory.at(0);
  const double jump = (a.p_NB - b.p_NB).norm() + (a.v_NB - b.v_NB).norm() +
                      (a.a_NB - b.a_NB).norm() + std::abs(wrap_angle(a.yaw - b.yaw)) +
                      std::abs(a.yaw_rate - b.yaw_rate);
  return jump < kSamePlace && (a.j_NB - b.j_NB).norm() < kSameJerk;
}

PlanResult replanned(const Planner& planner, const PlanResult& current,
                     const Replan& replan, Time now) {
  const auto request = replan_request(current, replan);
  if (!request) return current;
  const PlanResult fresh = planner.plan(*request);
  return takes_over(current, fresh, now) ? fresh : current;
}

}  // namespace alight
