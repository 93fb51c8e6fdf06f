#include "alight/run/campaign_compare.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>

#include "alight/run/append_format.h"
#include "alight/run/campaign_store.h"

namespace alight {
namespace {

constexpr double kZ = 1.959963984540054;  // 95 %
constexpr double kAlpha = 0.05;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// P(X <= k) for n throws of a fair coin.
double coin_cdf(int k, int n) {
  double sum = 0;
  for (int i = 0; i <= k; ++i) {
    sum += std::exp(std::lgamma(n + 1.0) - std::lgamma(i + 1.0) -
                    std::lgamma(n - i + 1.0) - n * std::log(2.0));
  }
  return sum;
}

struct Figure {
  const char* name;
  double scale;
  std::function<double(const LandingResult&)> of;
};

using Down = LandingResult::Touchdown;

double of_touchdown(const LandingResult& r, double Down::*figure) {
  return r.touchdown ? (*r.touchdown).*figure : kNaN;
}

const std::array<Figure, 7> kFigures{{
    {"touch-down error, cm", 100,
     [](const LandingResult& r) { return of_touchdown(r, &Down::error_m); }},
    {"touch-down speed, m/s", 1,
     [](const LandingResult& r) { return of_touchdown(r, &Down::relative_speed_m_s); }},
    {"touch-down tilt, deg", 1,
     [](const LandingResult& r) { return of_touchdown(r, &Down::tilt_deg); }},
    {"touch-down time, s", 1,
     [](const LandingResult& r) { return of_touchdown(r, &Down::t_s); }},
    {"tracking RMSE, m", 1, [](const LandingResult& r) { return r.tracking_rmse_m; }},
    {"position RMSE, m", 1,
     [](const LandingResult& r) { return r.estimate.position_rmse_m; }},
    {"rotation RMSE, deg", 1,
     [](const LandingResult& r) { return r.estimate.rotation_rmse_deg; }},
}};

/// By scenario, then by seed.
using Landings = std::map<std::string, std::map<std::uint64_t, StoredLanding>>;

std::string configuration(const CampaignKey& key) {
  return "profile " + key.profile + ", version " + key.version;
}

Result<Landings> landings_of(const CampaignSide& side, const char* letter) {
  std::error_code code;
  if (!std::filesystem::exists(side.store, code)) {
    return fail(Fault::io, side.store + ": no such file");
  }
  auto store = CampaignStore::open(side.store);
  if (!store) return fail(store.error());
  auto all = store->all();
  if (!all) return fail(all.error());
  Landings landings;
  for (StoredLanding& one : *all) {
    const CampaignKey& key = one.key;
    if ((!side.profile.empty() && key.profile != side.profile) ||
        (!side.scenario.empty() && key.scenario != side.scenario) ||
        key.version.rfind(side.version, 0) != 0) {
      continue;
    }
    auto& of_scenario = landings[key.scenario];
    const auto [at, fresh] = of_scenario.try_emplace(key.seed, one);
    if (fresh) continue;
    const std::string first = configuration(at->second.key);
    const std::string second = configuration(key);
    const std::string what = side.store + ": " + key.scenario + ", seed " +
                             std::to_string(key.seed) + " is there twice: ";
    if (first == second) {
      return fail(Fault::invalid_input,
                  what +
                      "with two rigs, time limits or texts of the scenario: keep "
                      "them in stores of their own");
    }
    return fail(Fault::invalid_input, what + first + " and " + second +
                                          ": choose with --profile-" + letter +
                                          " or --version-" + letter);
  }
  return landings;
}

PairedFigure compare_figure(const Figure& figure,
                            const std::vector<const LandingResult*>& a,
                            const std::vector<const LandingResult*>& b) {
  std::vector<double> of_a, of_b, differences;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double x = figure.scale * figure.of(*a[i]);
    const double y = figure.scale * figure.of(*b[i]);
    if (!std::isfinite(x) || !std::isfinite(y)) continue;
    of_a.push_back(x);
    of_b.push_back(y);
    differences.push_back(y - x);
  }
  const PairedMedian median = paired_median(differences);
  return {.name = figure.name,
          .pairs = static_cast<int>(differences.size()),
          .median_a = percentile(of_a, 0.5),
          .median_b = percentile(of_b, 0.5),
          .difference = median.median,
          .interval = median.interval};
}

CampaignComparison compare_scenario(const std::string& name,
                                    const std::map<std::uint64_t, StoredLanding>& a,
                                    const std::map<std::uint64_t, StoredLanding>& b) {
  CampaignComparison c;
  c.scenario = name;
  std::vector<const LandingResult*> of_a, of_b;
  for (const auto& [seed, landing] : a) {
    const auto twin = b.find(seed);
    if (twin == b.end()) {
      ++c.alone_a;
      continue;
    }
    of_a.push_back(&landing.result);
    of_b.push_back(&twin->second.result);
  }
  c.alone_b = static_cast<int>(b.size() - of_a.size());
  const auto share = [&](auto holds) {
    int counts[2][2] = {{0, 0}, {0, 0}};
    for (std::size_t i = 0; i < of_a.size(); ++i) {
      ++counts[holds(*of_a[i]) ? 1 : 0][holds(*of_b[i]) ? 1 : 0];
    }
    return paired_share(counts[1][1], counts[1][0], counts[0][1], counts[0][0]);
  };
  c.landed = share([](const LandingResult& r) { return r.outcome == Outcome::landed; });
  c.first_try = share([](const LandingResult& r) {
    return r.outcome == Outcome::landed && r.attempts == 1;
  });
  c.crashed =
      share([](const LandingResult& r) { return r.outcome == Outcome::crashed; });
  for (const Figure& figure : kFigures) {
    c.figures.push_back(compare_figure(figure, of_a, of_b));
  }
  return c;
}

void append_share(std::string& text, const char* name, const PairedShare& s) {
  append_format(text,
                "  %-24s A %d, B %d; only A %d, only B %d: B - A = %+.2f %% "
                "(95 %%: %+.2f to %+.2f), McNemar p = %.3g\n",
                name, s.both + s.only_a, s.both + s.only_b, s.only_a, s.only_b,
                100 * s.difference, 100 * s.interval.low, 100 * s.interval.high, s.p);
}

}  // namespace

PairedShare paired_share(int both, int only_a, int only_b, int neither) {
  PairedShare s{.both = both, .only_a = only_a, .only_b = only_b, .neither = neither};
  const int apart = only_a + only_b;
  s.p = std::min(1.0, 2 * coin_cdf(std::min(only_a, only_b), apart));
  if (s.pairs() == 0) return s;
  s.difference = static_cast<double>(only_b - only_a) / s.pairs();
  const double n = s.pairs() + 2, less = only_a + 0.5, more = only_b + 0.5;
  const double middle = (more - less) / n;
  const double sd = std::sqrt(more + less - (more - less) * (more - less) / n) / n;
  s.interval = {std::max(-1.0, middle - kZ * sd), std::min(1.0, middle + kZ * sd)};
  return s;
}

PairedMedian paired_median(std::vector<double> differences) {
  PairedMedian result{percentile(differences, 0.5), {kNaN, kNaN}};
  std::sort(differences.begin(), differences.end());
  const int n = static_cast<int>(differences.size());
  int outside = 0;  // order statistics left out at each end
  while (2 * (outside + 1) <= n && 2 * coin_cdf(outside, n) <= kAlpha) ++outside;
  if (outside == 0) return result;
  const auto at = [&](int i) { return differences[static_cast<std::size_t>(i)]; };
  result.interval = {at(outside - 1), at(n - outside)};
  return result;
}

Result<std::vector<CampaignComparison>> compare_campaigns(CampaignSide a,
                                                          CampaignSide b) {
  if (a.scenario.empty()) a.scenario = b.scenario;
  if (b.scenario.empty()) b.scenario = a.scenario;
  const auto of_a = landings_of(a, "a");
  if (!of_a) return fail(of_a.error());
  const auto of_b = landings_of(b, "b");
  if (!of_b) return fail(of_b.error());
  std::vector<CampaignComparison> all;
  for (const auto& [name, landings] : *of_a) {
    const auto twin = of_b->find(a.scenario == b.scenario ? name : b.scenario);
    if (twin == of_b->end()) continue;
    const std::string both = name == twin->first ? name : name + " / " + twin->first;
    all.push_back(compare_scenario(both, landings, twin->second));
    if (all.back().landed.pairs() == 0) all.pop_back();
  }
  if (all.empty()) {
    return fail(Fault::invalid_input,
                "no landing of A has a twin of the same scenario and seed in B");
  }
  return all;
}

std::string comparison_text(const std::vector<CampaignComparison>& comparisons) {
  std::string text;
  for (const CampaignComparison& c : comparisons) {
    const PairedShare& l = c.landed;
    append_format(text, "%s: %d pairs", c.scenario.c_str(), l.pairs());
    if (c.alone_a + c.alone_b > 0) {
      append_format(text, "; %d of A and %d of B have no twin", c.alone_a, c.alone_b);
    }
    text += '\n';
    append_share(text, "landed", l);
    append_share(text, "landed at the first try", c.first_try);
    append_share(text, "crashed", c.crashed);
    for (const PairedFigure& f : c.figures) {
      if (f.pairs == 0) continue;
      append_format(text, "  %-24s A %.4g, B %.4g; B - A = %+.3g", f.name.c_str(),
                    f.median_a, f.median_b, f.difference);
      if (std::isnan(f.interval.low)) {
        text += " (too few pairs for an interval)\n";
      } else {
        append_format(text, " (95 %%: %+.3g to %+.3g)\n", f.interval.low,
                      f.interval.high);
      }
    }
  }
  return text + "Figures: medians of the landings in which both have one.\n";
}

}  // namespace alight
