#include "alight/run/campaign_summary.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/io/text.h"
#include "alight/run/append_format.h"

namespace alight {
namespace {

Spread spread(const std::vector<double>& values) {
  return {percentile(values, 0.5), percentile(values, 0.95), percentile(values, 0),
          percentile(values, 1)};
}

CampaignSummary summarize(const std::string& name,
                          const std::vector<const LandingResult*>& landings) {
  CampaignSummary s;
  s.scenario = name;
  s.runs = static_cast<int>(landings.size());
  double attempts = 0;
  for (const LandingResult* r : landings) {
    ++s.outcomes[to_string(r->outcome)];
    s.landed += r->outcome == Outcome::landed;
    s.crashed += r->outcome == Outcome::crashed;
    s.soft += r->outcome == Outcome::landed && r->touchdown &&
              r->touchdown->tilt_deg <= kSoftTilt &&
              r->touchdown->relative_speed_m_s <= kSoftSpeed;
    attempts += r->attempts;
  }
  s.landed_interval = wilson_interval(s.landed, s.runs);
  s.attempts_mean =
      s.runs > 0 ? attempts / s.runs : std::numeric_limits<double>::quiet_NaN();

  const auto of_all = [&](auto&& figure) {
    std::vector<double> values;
    for (const LandingResult* r : landings) values.push_back(figure(*r));
    return spread(values);
  };
  const auto of_touchdowns = [&](auto&& figure) {
    std::vector<double> values;
    for (const LandingResult* r : landings) {
      if (r->touchdown) values.push_back(figure(*r->touchdown));
    }
    return spread(values);
  };
  using R = LandingResult;
  using T = LandingResult::Touchdown;
  s.touchdown_error_m = of_touchdowns([](const T& t) { return t.error_m; });
  s.relative_speed_m_s = of_touchdowns([](const T& t) { return t.relative_speed_m_s; });
  s.tilt_deg = of_touchdowns([](const T& t) { return t.tilt_deg; });
  s.yaw_error_deg = of_touchdowns([](const T& t) { return std::abs(t.yaw_error_deg); });
  s.touchdown_t_s = of_touchdowns([](const T& t) { return t.t_s; });
  s.tracking_rmse_m = of_all([](const R& r) { return r.tracking_rmse_m; });
  s.follow_rmse_m = of_all([](const R& r) { return r.follow_rmse_m; });
  s.position_rmse_m = of_all([](const R& r) { return r.estimate.position_rmse_m; });
  s.rotation_rmse_deg = of_all([](const R& r) { return r.estimate.rotation_rmse_deg; });
  s.velocity_rmse_m_s = of_all([](const R& r) { return r.estimate.velocity_rmse_m_s; });
  s.tracked_fraction = of_all([](const R& r) { return r.estimate.tracked_fraction; });
  s.nees_mean = of_all([](const R& r) { return r.estimate.nees_mean; });
  s.realtime_factor = of_all([](const R& r) { return r.realtime_factor; });

  std::map<std::string, std::vector<Percentiles>> stages;
  for (const LandingResult* r : landings) {
    for (const auto& [stage, us] : r->timing_us) stages[stage].push_back(us);
  }
  for (const auto& [stage, all] : stages) {
    std::vector<double> p50, p99, max;
    for (const Percentiles& p : all) {
      p50.push_back(p.p50);
      p99.push_back(p.p99);
      max.push_back(p.max);
    }
    s.timing_us[stage] = {percentile(p50, 0.5), percentile(p99, 0.5),
                          percentile(max, 1)};
  }
  return s;
}

}  // namespace

std::vector<CampaignSummary> summarize(const CampaignOptions& options,
                                       const CampaignResult& result) {
  std::vector<std::vector<const LandingResult*>> landings(options.scenarios.size());
  for (const CampaignRun& run : result.runs) {
    landings[run.scenario].push_back(&run.result);
  }
  std::vector<CampaignSummary> summaries;
  for (std::size_t i = 0; i < landings.size(); ++i) {
    summaries.push_back(summarize(options.scenarios[i].name, landings[i]));
  }
  return summaries;
}

std::string summary_text(const CampaignSummary& s) {
  std::string text;
  append_format(text, "%s\n", s.scenario.c_str());
  append_format(text, "  landed       %d/%d, %.1f %% (95 %%: %.1f to %.1f)", s.landed,
                s.runs, s.runs > 0 ? 100.0 * s.landed / s.runs : 0,
                100 * s.landed_interval.low, 100 * s.landed_interval.high);
  for (const auto& [outcome, count] : s.outcomes) {
    if (outcome != "landed") append_format(text, ", %s %d", outcome.c_str(), count);
  }
  append_format(text, "; attempts %.2f\n", s.attempts_mean);
  if (std::isfinite(s.touchdown_t_s.p50)) {
    append_format(text,
                  "  touch-down   error p50 %.1f p95 %.1f max %.1f cm, speed p95 %.2f "
                  "m/s, tilt p95 %.1f deg, after %.1f s; %d within %g m/s and %g deg\n",
                  100 * s.touchdown_error_m.p50, 100 * s.touchdown_error_m.p95,
                  100 * s.touchdown_error_m.max, s.relative_speed_m_s.p95,
                  s.tilt_deg.p95, s.touchdown_t_s.p50, s.soft, kSoftSpeed, kSoftTilt);
  } else {
    text += "  touch-down   none\n";
  }
  // What no landing got to is a dash.
  const auto f = [](double value, int digits) { return fixed_text(value, digits); };
  text += "  tracking     RMSE p50 " + f(s.tracking_rmse_m.p50, 3) + " p95 " +
          f(s.tracking_rmse_m.p95, 3) + " m; following p50 " +
          f(s.follow_rmse_m.p50, 3) + " p95 " + f(s.follow_rmse_m.p95, 3) + " m\n";
  text += "  estimate     RMSE p50 " + f(s.position_rmse_m.p50, 4) + " m (p95 " +
          f(s.position_rmse_m.p95, 4) + "), " + f(s.rotation_rmse_deg.p50, 2) +
          " deg (p95 " + f(s.rotation_rmse_deg.p95, 2) + "), " +
          f(s.velocity_rmse_m_s.p50, 3) + " m/s; tracked p50 " +
          f(100 * s.tracked_fraction.p50, 2) + " min " +
          f(100 * s.tracked_fraction.min, 2) + " %; NEES p50 " + f(s.nees_mean.p50, 1) +
          "\n";
  append_format(
      text, "  simulation   %.1f times real time (p50 of one landing on its thread)\n",
      s.realtime_factor.p50);
  return text;
}

}  // namespace alight
