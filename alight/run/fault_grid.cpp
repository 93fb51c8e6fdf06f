#include "alight/run/fault_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <set>

#include "alight/io/text.h"
#include "alight/io/yaml_reader.h"

namespace alight {
namespace {

// s from the first fault of a pair to the second, so that they overlap.
constexpr double kSecondAfter = 0.3;

std::optional<Outcome> outcome_of(const std::string& word) {
  for (int i = 0; i <= static_cast<int>(Outcome::timeout); ++i) {
    if (word == to_string(static_cast<Outcome>(i))) return static_cast<Outcome>(i);
  }
  return std::nullopt;
}

std::vector<std::string> kind_names() {
  std::vector<std::string> names;
  for (int k = 0; k < kFaultKinds; ++k) {
    names.emplace_back(to_string(static_cast<FaultKind>(k)));
  }
  return names;
}

std::vector<std::string> outcome_names() {
  std::vector<std::string> names;
  for (int i = 0; i <= static_cast<int>(Outcome::timeout); ++i) {
    names.emplace_back(to_string(static_cast<Outcome>(i)));
  }
  return names;
}

FaultCase read_case(YamlMap& map) {
  FaultCase one;
  map.require("name");
  map.require("kind");
  map.read("name", one.name);
  std::string kind = to_string(one.fault.kind);
  map.read("kind", kind);
  if (const auto known = fault_kind(kind)) {
    one.fault.kind = *known;
  } else {
    map.complain("kind", not_one_of(kind, kind_names()));
  }
  map.read("for_s", one.fault.for_s);
  for (const FaultParameter& p : fault_parameters(one.fault.kind)) {
    map.read(p.name, one.fault.*p.value);
  }
  std::string ends;
  map.read("ends", ends);
  for (const std::string_view word : split(ends, ' ')) {
    if (word.empty()) continue;
    if (const auto outcome = outcome_of(std::string(word))) {
      one.ends.push_back(*outcome);
    } else {
      map.complain("ends", not_one_of(std::string(word), outcome_names()));
    }
  }
  std::string because;
  map.read("because", because);
  for (const std::string_view words : split(because, '|')) {
    if (const std::string_view part = trimmed(words); !part.empty()) {
      one.because.emplace_back(part);
    }
  }
  return one;
}

Result<std::vector<FaultCase>> read(Result<YamlMap> file, const std::string& name) {
  if (!file) return fail(file.error());
  std::vector<FaultCase> cases;
  std::set<std::string> seen;
  for (YamlMap& map : file->list("cases")) {
    cases.push_back(read_case(map));
    if (!seen.insert(cases.back().name).second) {
      map.complain("name", "occurs twice");
    }
  }
  if (auto good = file->finish(); !good) return fail(good.error());
  if (cases.empty())
    return fail(Fault::invalid_config, name + ": cases: there are none");
  for (const FaultCase& one : cases) {
    FirstComplaint check;
    check_fault(one.fault, one.name + ": ", check);
    if (auto good = check.result(); !good) {
      return fail(good.error().fault, name + ": " + good.error().detail);
    }
  }
  return cases;
}

CampaignScenario with(const CampaignScenario& base, const std::string& fault,
                      double at_s, std::vector<FaultScenario> faults,
                      std::vector<Outcome> ends, std::vector<std::string> because) {
  CampaignScenario made = base;
  made.name = base.name + " + " + fault + " at " + number_text(at_s) + " s";
  made.fault = fault;
  made.scenario.faults = std::move(faults);
  made.ends = std::move(ends);
  made.because = std::move(because);
  return made;
}

}  // namespace

Result<std::vector<FaultCase>> load_fault_cases(const std::string& path) {
  return read(YamlMap::load(path), path);
}

Result<std::vector<FaultCase>> parse_fault_cases(const std::string& text,
                                                 const std::string& name) {
  return read(YamlMap::parse(text, name), name);
}

std::vector<CampaignScenario> apply_faults(const std::vector<CampaignScenario>& bases,
                                           const FaultGrid& grid) {
  std::vector<CampaignScenario> all;
  for (const CampaignScenario& base : bases) {
    std::size_t pair = 0;
    for (std::size_t i = 0; i < grid.cases.size(); ++i) {
      const FaultCase& a = grid.cases[i];
      FaultScenario first = a.fault;
      if (!grid.pairs) {
        for (const double at_s : grid.at_s) {
          first.at_s = at_s;
          all.push_back(with(base, a.name, at_s, {first}, a.ends, a.because));
        }
        continue;
      }
      for (std::size_t j = i + 1; j < grid.cases.size(); ++j) {
        const FaultCase& b = grid.cases[j];
        const double at_s = grid.at_s[pair++ % grid.at_s.size()];
        FaultScenario second = b.fault;
        first.at_s = at_s;
        second.at_s = at_s + kSecondAfter;
        std::vector<Outcome> ends = a.ends;
        ends.insert(ends.end(), b.ends.begin(), b.ends.end());
        if (a.ends.empty() || b.ends.empty()) ends.clear();
        // Together they may end a landing that neither would have ended alone; whatever
        // is said must still be about one of the two, where both say what that is.
        std::vector<std::string> because = a.because;
        because.insert(because.end(), b.because.begin(), b.because.end());
        all.push_back(with(base, a.name + ", " + b.name, at_s, {first, second},
                           std::move(ends), std::move(because)));
      }
    }
  }
  return all;
}

bool ended_well(const CampaignScenario& scenario, const LandingResult& result) {
  const Outcome outcome = result.outcome;
  const bool touched =
      outcome == Outcome::crashed || outcome == Outcome::landed_elsewhere;
  if (touched && result.lost_link && result.lost_link->helpless) return true;
  if (outcome == Outcome::crashed || outcome == Outcome::timeout) return false;
  const auto& ends = scenario.ends;
  if (!ends.empty() && std::find(ends.begin(), ends.end(), outcome) == ends.end()) {
    return false;
  }
  if (outcome == Outcome::lost_link_landing && result.lost_link &&
      (result.lost_link->drift_m > kDriftMax_m ||
       result.lost_link->sink_m_s > kSinkMax_m_s)) {
    return false;
  }
  const auto& because = scenario.because;
  return outcome == Outcome::landed || because.empty() ||
         std::any_of(because.begin(), because.end(), [&](const std::string& words) {
           return result.reason.find(words) != std::string::npos;
         });
}

std::vector<FaultSummary> summarize_faults(const CampaignOptions& options,
                                           const CampaignResult& result) {
  std::vector<FaultSummary> all;
  std::map<std::string, std::size_t> place;
  for (const CampaignRun& run : result.runs) {
    const CampaignScenario& scenario = options.scenarios[run.scenario];
    if (scenario.fault.empty()) continue;
    const auto [at, fresh] = place.try_emplace(scenario.fault, all.size());
    if (fresh) {
      const double none = std::numeric_limits<double>::quiet_NaN();
      all.push_back(
          {.fault = scenario.fault, .drift_max_m = none, .sink_max_m_s = none});
    }
    FaultSummary& s = all[at->second];
    const LandingResult& r = run.result;
    ++s.runs;
    s.wrong += !ended_well(scenario, r);
    ++s.outcomes[to_string(r.outcome)];
    ++s.reasons[std::string(to_string(r.outcome)) + ": " + r.reason];
    if (r.outcome == Outcome::lost_link_landing && r.lost_link) {
      s.drift_max_m = std::fmax(s.drift_max_m, r.lost_link->drift_m);
      s.sink_max_m_s = std::fmax(s.sink_max_m_s, r.lost_link->sink_m_s);
    }
  }
  return all;
}

std::string fault_table(const std::vector<FaultSummary>& summaries) {
  std::string text =
      "| fault | landings | landed | ended otherwise, and why | wrong |\n"
      "|---|---|---|---|---|\n";
  for (const FaultSummary& s : summaries) {
    const auto landed = s.outcomes.find("landed");
    text += "| " + s.fault + " | " + std::to_string(s.runs) + " | " +
            std::to_string(landed == s.outcomes.end() ? 0 : landed->second) + " | ";
    std::string rest;
    for (const auto& [reason, count] : s.reasons) {
      if (reason.rfind("landed:", 0) == 0) continue;
      rest += (rest.empty() ? "" : "; ") + std::to_string(count) + " " + reason;
    }
    if (!std::isnan(s.drift_max_m)) {
      char figures[96];
      std::snprintf(figures, sizeof figures, " (drift up to %.2f m, sink %.2f m/s)",
                    s.drift_max_m, s.sink_max_m_s);
      rest += figures;
    }
    text += rest + " | " + std::to_string(s.wrong) + " |\n";
  }
  return text;
}

}  // namespace alight
