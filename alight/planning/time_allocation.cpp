#include "alight/planning/time_allocation.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace alight {

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
  return range;
}

Allocation allocate_time(const PlannerConfig& config, const TimeRange& range,
                         const FlatState& start, const FlatState& end,
                         const Corridor& corridor, const DynamicLimitRows& tightened,
                         LandingQp& qp) {
  Allocation allocation;
  const int n = config.time_samples;
  const auto duration = [&](std::size_t s, int i) {
    const double share = n > 1 ? static_cast<double>(i) / (n - 1) : 1.0;
    return range.shortest[s] + share * (range.longest[s] - range.shortest[s]);
  };
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const std::array<Seconds, kSegments> T{duration(0, i), duration(1, j)};
      const QpOutcome outcome = qp.solve(Reduction(start, end, T), corridor, tightened);
      ++allocation.tried;
      if (!outcome.solved()) {
        // What leaves no way says more than a boundary state that some times forbid.
        const bool more = outcome.kind != QpOutcome::Kind::fixed_row ||
                          allocation.failure == QpOutcome::Kind::fixed_row;
        if (more) {
          allocation.failure = outcome.kind;
          allocation.blame = outcome.blame;
        }
        continue;
      }
      ++allocation.feasible;
      const double cost = outcome.jerk_cost + config.time_weight * (T[0] + T[1]);
      if (cost >= least) continue;
      least = cost;
      allocation.best = T;
    }
  }
  return allocation;
}

}  // namespace alight
