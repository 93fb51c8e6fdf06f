#include "alight/planning/time_allocation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/planning/bernstein.h"

namespace alight {
namespace {

constexpr int kWideSamples = 21;
constexpr Seconds kBriefest = 0.12;
constexpr double kWidest = 2.5;  ///< Times the longest of the likely range.

}  // namespace

TimeRange time_range(const PlannerConfig& config, const Rig& rig,
                     const PlanRequest& request, const FlatState& end) {
  const Vector3& from = request.from.p_NB;
  const double drop = from.z() - end.p_NB.z();
  const double upper = from.z() - config.touch_down_height_m;
  double share = drop > 1e-6 ? std::clamp(upper / drop, 0.1, 0.9) : 0.5;
  const double way = (end.p_NB - from).norm();
  if (config.profile == Profile::standard && way > 1e-6) {
    // The funnel lets the touch-down space reach no farther than this.
    const double height = std::max(0.0, config.touch_down_height_m - end.p_NB.z());
    const double reach =
        config.funnel_radius_m + height / std::tan(config.funnel_slope_deg * kDegree);
    share = std::clamp(1 - reach / way, share, 0.9);
  }
  const double fastest = std::max(rig.limits.speed_m_s - request.platform.v_IN_N.norm(),
                                  2 * config.slowest_m_s);
  TimeRange range;
  for (std::size_t s = 0; s < kSegments; ++s) {
    const double length = way * (s == 0 ? share : 1 - share);
    range.shortest[s] = std::max(config.shortest_s, length / fastest);
    range.longest[s] = std::max(
        {4 * config.shortest_s, 2 * range.shortest[s], length / config.slowest_m_s});
  }
  if (config.profile == Profile::standard) {
    // Time to turn: a quintic's greatest rate is 1.875 times its mean.
    const double turn = std::abs(wrap_angle(end.yaw - request.from.yaw));
    const double rate =
        heading_rate_max(config, rig.drone) - std::abs(request.platform.w_IN_N.z());
    if (rate > 0) range.longest[0] = std::max(range.longest[0], 2.5 * turn / rate);
  }
  return range;
}

TimeSamples even_samples(const PlannerConfig& config, const TimeRange& range) {
  TimeSamples samples;
  const int n = config.time_samples;
  for (std::size_t s = 0; s < kSegments; ++s) {
    for (int i = 0; i < n; ++i) {
      const double share = n > 1 ? static_cast<double>(i) / (n - 1) : 1.0;
      samples[s].push_back(range.shortest[s] +
                           share * (range.longest[s] - range.shortest[s]));
    }
  }
  return samples;
}

TimeSamples wide_samples(const TimeRange& range) {
  TimeSamples samples;
  for (std::size_t s = 0; s < kSegments; ++s) {
    const Seconds longest = kWidest * range.longest[s];
    for (int i = 0; i < kWideSamples; ++i) {
      const double share = static_cast<double>(i) / (kWideSamples - 1);
      samples[s].push_back(kBriefest * std::pow(longest / kBriefest, share));
    }
  }
  return samples;
}

bool heading_fits(const PlanRequest& request, const FlatState& start,
                  const FlatState& end, Seconds T, double rate) {
  double platform_rate = std::abs(request.platform.w_IN_N.z());
  const PlatformForecast& forecast = request.forecast;
  if (!forecast.nodes.empty()) {
    platform_rate = 0;
    const Seconds last = forecast.begin + T + forecast.step;
    for (std::size_t i = 0; i < forecast.nodes.size(); ++i) {
      if (static_cast<double>(i) * forecast.step > last) break;
      platform_rate = std::max(platform_rate, std::abs(forecast.nodes[i].w_IN_N.z()));
    }
  }
  const double turn = wrap_angle(end.yaw - start.yaw);
  if (turn == 0 && start.yaw_rate == 0 && start.yaw_acceleration == 0) {
    return platform_rate <= rate;
  }
  // Control points of the quintic (Trajectory), then of its derivative.
  const double y1 = start.yaw_rate * T / 5;
  const double y2 = 2 * y1 + start.yaw_acceleration * T * T / 20;
  const std::array<double, 6> y{0, y1, y2, turn, turn, turn};
  std::array<double, 5> up, down;
  for (std::size_t i = 0; i < up.size(); ++i) {
    up[i] = 5 / T * (y[i + 1] - y[i]);
    down[i] = -up[i];
  }
  const double most = std::max(bernstein_maximum(up.data(), 5, 1e-3),
                               bernstein_maximum(down.data(), 5, 1e-3));
  return most + platform_rate <= rate;
}

Allocation allocate_time(const AllocationTask& task, const TimeSamples& samples,
                         LandingQp& qp) {
  Allocation allocation;
  // A failure that leaves no way says more than a boundary state that some times
  // forbid.
  const auto fail = [&](QpOutcome::Kind kind, const RowId& blame,
                        const std::array<Seconds, kSegments>& T) {
    const bool more = kind != QpOutcome::Kind::fixed_row ||
                      allocation.failure == QpOutcome::Kind::fixed_row;
    if (!more) return;
    allocation.failure = kind;
    allocation.blame = blame;
    allocation.blamed = T;
  };
  double least = std::numeric_limits<double>::infinity();
  for (const Seconds first : samples[0]) {
    for (const Seconds second : samples[1]) {
      const std::array<Seconds, kSegments> T{first, second};
      ++allocation.tried;
      if (task.heading_rate > 0 && !heading_fits(*task.request, task.start, task.end,
                                                 first + second, task.heading_rate)) {
        fail(QpOutcome::Kind::yaw_rate, {}, T);
        continue;
      }
      const QpOutcome outcome =
          qp.solve(Reduction(task.start, task.end, T, task.keep_jerk), task.corridor,
                   task.limits);
      if (!outcome.solved()) {
        fail(outcome.kind, outcome.blame, T);
        continue;
      }
      ++allocation.feasible;
      const double cost =
          outcome.jerk_cost + task.config.time_weight * (first + second);
      if (cost >= least) continue;
      least = cost;
      allocation.best = T;
      if (task.any) return allocation;
    }
  }
  return allocation;
}

}  // namespace alight
