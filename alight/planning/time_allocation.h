#pragma once
#include "alight/planning/landing_qp.h"

namespace alight {

/// Least and greatest duration per segment.
struct TimeRange {
  std::array<Seconds, kSegments> shortest{};
  std::array<Seconds, kSegments> longest{};
};

/// Best and worst case of the velocity limits over the straight way from the start to
/// the end, cut at the height where the spaces meet.
TimeRange time_range(const PlannerConfig& config, const Rig& rig,
                     const PlanRequest& request, const FlatState& end);

struct Allocation {
  std::array<Seconds, kSegments> best{0, 0};
  int tried = 0;
  int feasible = 0;
  QpOutcome::Kind failure = QpOutcome::Kind::fixed_row;
  RowId blame;  ///< Of the last such sample, if none is feasible.
};

/// Steps 1 to 3 of "On Time Allocation": every pair of durations is solved under the
/// tightened limits; the least jerk cost + time_weight * duration wins, the first of
/// equals.
Allocation allocate_time(const PlannerConfig& config, const TimeRange& range,
                         const FlatState& start, const FlatState& end,
                         const Corridor& corridor, const DynamicLimitRows& tightened,
                         LandingQp& qp);

}  // namespace alight
