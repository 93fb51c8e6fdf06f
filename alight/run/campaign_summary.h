#pragma once
#include <map>
#include <string>
#include <vector>

#include "alight/eval/statistics.h"
#include "alight/run/campaign.h"

namespace alight {

inline constexpr double kSoftTilt = 5;     // deg
inline constexpr double kSoftSpeed = 0.3;  // m/s

/// How a figure spreads over the landings of a scenario; NaN where none had it.
struct Spread {
  double p50, p95, min, max;
};

/// The landings of one scenario. Touch-down figures are of every landing that touched
/// the pad at all, also of those that did not count as landed.
struct CampaignSummary {
  std::string scenario;
  int runs = 0;
  int landed = 0;
  int crashed = 0;
  int soft = 0;                         ///< Landed, touching within kSoftTilt and
                                        ///< kSoftSpeed of the pad's.
  Interval landed_interval;             ///< Wilson, 95 %
  std::map<std::string, int> outcomes;  ///< All that occurred.
  Spread touchdown_error_m, relative_speed_m_s, tilt_deg, yaw_error_deg;
  Spread touchdown_t_s;
  Spread tracking_rmse_m, follow_rmse_m;
  Spread position_rmse_m, rotation_rmse_deg, velocity_rmse_m_s, tracked_fraction,
      nees_mean;
  Spread realtime_factor;
  double attempts_mean = 0;
  /// p50, p99 and max are the median, the median and the maximum over the landings.
  std::map<std::string, Percentiles> timing_us;
};

/// A summary a scenario, in the order of the options.
std::vector<CampaignSummary> summarize(const CampaignOptions& options,
                                       const CampaignResult& result);

/// For people, a block a scenario.
std::string summary_text(const CampaignSummary& summary);

}  // namespace alight
