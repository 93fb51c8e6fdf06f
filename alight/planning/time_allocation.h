#pragma once
#include <vector>

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

/// Durations to try, per segment, ascending.
using TimeSamples = std::array<std::vector<Seconds>, kSegments>;
/// Evenly over the range, the paper's.
TimeSamples even_samples(const PlannerConfig& config, const TimeRange& range);
/// By equal ratios from very short to far longer than the range.
TimeSamples wide_samples(const TimeRange& range);

/// Whether the heading gets from start to end in `T` s at no more than `rate` rad/s
/// seen from I, over the platform of `request`.
bool heading_fits(const PlanRequest& request, const FlatState& start,
                  const FlatState& end, Seconds T, double rate);

struct Allocation {
  std::array<Seconds, kSegments> best{0, 0};
  int tried = 0;
  int feasible = 0;
  QpOutcome::Kind failure = QpOutcome::Kind::fixed_row;
  RowId blame;  ///< Of the last such sample, if none is feasible,
  std::array<Seconds, kSegments> blamed{0, 0};  ///< and its durations.
};

/// What every sample of the durations has in common.
struct AllocationTask {
  const PlannerConfig& config;
  FlatState start, end;
  bool keep_jerk = false;
  double heading_rate = 0;  ///< rad/s, the most; 0: headings are not looked at (paper).
  const PlanRequest* request = nullptr;  ///< Whose platform turns (heading_rate > 0).
  const Corridor& corridor;
  const DynamicLimitRows& limits;
  bool any = false;  ///< The first that is feasible will do.
};

/// Steps 1 to 3 of "On Time Allocation": every pair of durations is solved; the least
/// jerk cost + time_weight * duration wins, the first of equals.
Allocation allocate_time(const AllocationTask& task, const TimeSamples& samples,
                         LandingQp& qp);

}  // namespace alight
