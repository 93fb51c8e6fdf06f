#include "alight/run/fault_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "alight/run/scenario_yaml.h"
#include "run_scenarios.h"

namespace alight {
namespace {

constexpr const char* kTwo =
    "cases:\n"
    "  - {name: dark, kind: led_dead, led: 2, for_s: 1000, ends: landed}\n"
    "  - {name: deaf, kind: radio_out, ends: landed lost_link_landing}\n"
    "  - {name: blow, kind: gust, gust_m_s: 6}\n";

std::vector<FaultCase> three() {
  const auto cases = parse_fault_cases(kTwo, "f.yaml");
  EXPECT_TRUE(cases) << cases.error().detail;
  return cases ? *cases : std::vector<FaultCase>{};
}

LandingResult ending(Outcome outcome, const std::string& reason = "any") {
  LandingResult result;
  result.outcome = outcome;
  result.reason = reason;
  return result;
}

std::string complaint(const std::string& text) {
  const auto cases = parse_fault_cases(text, "f.yaml");
  return cases ? "" : cases.error().detail;
}

TEST(FaultGrid, ReadsCasesWithTheirParameters) {
  const auto cases = three();
  ASSERT_EQ(cases.size(), 3u);
  EXPECT_EQ(cases[0].fault.kind, FaultKind::led_dead);
  EXPECT_EQ(cases[0].fault.led, 2);
  EXPECT_EQ(cases[0].fault.for_s, 1000);
  EXPECT_EQ(cases[1].ends,
            (std::vector<Outcome>{Outcome::landed, Outcome::lost_link_landing}));
  EXPECT_EQ(cases[2].fault.gust_m_s, 6);
  EXPECT_TRUE(cases[2].ends.empty());
}

TEST(FaultGrid, SaysWhatIsWrongAndWhatIsNear) {
  for (const auto& [text, words] : std::vector<std::pair<std::string, std::string>>{
           {"cases: []", "there are none"},
           {"cases: [{name: a, kind: led_deaf}]", "did you mean 'led_dead'?"},
           {"cases: [{name: a, kind: led_dead, leds: 1}]", "did you mean led"},
           {"cases: [{name: a, kind: gust, led: 1}]", "led"},
           {"cases: [{name: a, kind: gust, gust_m_s: 99}]", "gust_m_s is 99"},
           {"cases: [{name: a, kind: gust, ends: flies}]", "'flies' is not one of"},
           {"cases: [{kind: gust}]", "name"},
           {"cases: [{name: a, kind: gust}, {name: a, kind: gust}]", "twice"}}) {
    const std::string what = complaint(text);
    EXPECT_EQ(what.find("f.yaml"), 0u) << text << ": " << what;
    EXPECT_NE(what.find(words), std::string::npos) << text << ": " << what;
  }
}

TEST(FaultGrid, TheNamedMatrixHoldsEveryKindOfFault) {
  const auto cases = load_fault_cases(ALIGHT_SOURCE_DIR "/config/faults/matrix.yaml");
  ASSERT_TRUE(cases) << cases.error().detail;
  std::set<FaultKind> kinds;
  std::set<int> dead;
  for (const FaultCase& one : *cases) {
    kinds.insert(one.fault.kind);
    EXPECT_FALSE(one.ends.empty()) << one.name;
    // What may end otherwise than on the pad says why it may.
    EXPECT_EQ(one.because.empty(), one.ends == std::vector{Outcome::landed})
        << one.name;
    if (one.fault.kind == FaultKind::led_dead) {
      dead.insert(static_cast<int>(one.fault.led));
    }
  }
  EXPECT_EQ(kinds.size(), static_cast<std::size_t>(kFaultKinds));
  EXPECT_EQ(dead.size(), 6u);
}

TEST(FaultGrid, EveryFaultAtEveryInstantOrEveryPairOnce) {
  const std::vector<CampaignScenario> bases{{.name = "a.yaml", .scenario = {}},
                                            {.name = "b.yaml", .scenario = {}}};
  FaultGrid grid{.cases = three(), .at_s = {1, 2.5}};
  const auto alone = apply_faults(bases, grid);
  ASSERT_EQ(alone.size(), 2u * 3u * 2u);
  EXPECT_EQ(alone[1].name, "a.yaml + dark at 2.5 s");
  EXPECT_EQ(alone[1].scenario.faults.at(0).at_s, 2.5);
  EXPECT_EQ(alone[1].fault, "dark");
  std::set<std::string> names, texts;
  for (const auto& s : alone) {
    EXPECT_TRUE(s.scenario.validate());
    names.insert(s.name);
    texts.insert(scenario_text(s.scenario));
  }
  EXPECT_EQ(names.size(), 12u);
  EXPECT_EQ(texts.size(), 6u);  // both bases are alike

  grid.pairs = true;
  const auto pairs = apply_faults(bases, grid);
  ASSERT_EQ(pairs.size(), 2u * 3u);
  for (const auto& s : pairs) {
    ASSERT_EQ(s.scenario.faults.size(), 2u);
    EXPECT_GT(s.scenario.faults[1].at_s, s.scenario.faults[0].at_s);
  }
  EXPECT_EQ(pairs[0].fault, "dark, deaf");
  EXPECT_TRUE(ended_well(pairs[0], ending(Outcome::lost_link_landing)));
  EXPECT_FALSE(ended_well(pairs[0], ending(Outcome::aborted)));
  EXPECT_TRUE(ended_well(pairs[1], ending(Outcome::aborted)));  // "blow" may end anyhow
  EXPECT_FALSE(ended_well(pairs[1], ending(Outcome::crashed)));
  EXPECT_FALSE(ended_well(pairs[1], ending(Outcome::timeout)));
}

TEST(FaultGrid, AnEndIsJudgedByItsReasonAndByWhatTheDroneDidAlone) {
  const auto cases = parse_fault_cases(
      "cases: [{name: a, kind: radio_out, ends: landed lost_link_landing refused, "
      "because: link | set-points }]",
      "f.yaml");
  ASSERT_TRUE(cases) << cases.error().detail;
  ASSERT_EQ(cases->at(0).because, (std::vector<std::string>{"link", "set-points"}));
  const auto made = apply_faults({{.name = "a.yaml", .scenario = {}}},
                                 {.cases = *cases, .at_s = {1}});
  EXPECT_TRUE(ended_well(made[0], ending(Outcome::landed, "motors stopped")));
  EXPECT_TRUE(ended_well(made[0], ending(Outcome::refused, "the link is lost")));
  EXPECT_FALSE(ended_well(made[0], ending(Outcome::refused, "no odometry")));
  LandingResult alone = ending(Outcome::lost_link_landing, "set-points did not arrive");
  EXPECT_TRUE(ended_well(made[0], alone));
  alone.lost_link = {kDriftMax_m, kSinkMax_m_s};
  EXPECT_TRUE(ended_well(made[0], alone));
  alone.lost_link = {kDriftMax_m + 0.01, kSinkMax_m_s};
  EXPECT_FALSE(ended_well(made[0], alone));
  alone.lost_link = {0, kSinkMax_m_s + 0.01};
  EXPECT_FALSE(ended_well(made[0], alone));
}

TEST(FaultGrid, ScenariosMadeUpReadBackAsTheyWere) {
  const auto cases = load_fault_cases(ALIGHT_SOURCE_DIR "/config/faults/matrix.yaml");
  ASSERT_TRUE(cases);
  for (const CampaignScenario& s :
       apply_faults({{.name = "a", .scenario = {}}}, {.cases = *cases, .at_s = {3}})) {
    const std::string text = scenario_text(s.scenario);
    const auto back = parse_scenario(text, "s.yaml");
    ASSERT_TRUE(back) << s.name << ": " << back.error().detail;
    EXPECT_EQ(scenario_text(*back), text);
    ASSERT_EQ(back->faults.size(), 1u);
    EXPECT_EQ(back->faults[0].kind, s.scenario.faults[0].kind);
  }
}

TEST(FaultGrid, SummarizesByFaultOverInstantsAndSeeds) {
  CampaignOptions options;
  options.scenarios =
      apply_faults({{.name = "a", .scenario = {}}}, {.cases = three(), .at_s = {1, 2}});
  CampaignResult result;
  for (std::size_t s = 0; s < options.scenarios.size(); ++s) {
    for (const Outcome outcome : {Outcome::landed, Outcome::lost_link_landing}) {
      CampaignRun run;
      run.scenario = s;
      run.result.outcome = outcome;
      run.result.reason = "because";
      if (outcome == Outcome::lost_link_landing) {
        run.result.lost_link =
            LandingResult::LostLink{0.1 * static_cast<double>(s), 0.5};
      }
      result.runs.push_back(run);
    }
  }
  const auto all = summarize_faults(options, result);
  ASSERT_EQ(all.size(), 3u);
  EXPECT_EQ(all[0].fault, "dark");
  EXPECT_EQ(all[0].runs, 4);
  EXPECT_EQ(all[0].wrong, 2);
  EXPECT_EQ(all[1].wrong, 0);
  EXPECT_EQ(all[1].reasons.at("lost_link_landing: because"), 2);
  EXPECT_NEAR(all[1].drift_max_m, 0.3, 1e-12);
  const std::string table = fault_table(all);
  EXPECT_NE(table.find("| deaf | 4 | 2 | 2 lost_link_landing: because (drift up to "
                       "0.30 m, sink 0.50 m/s) | 0 |"),
            std::string::npos)
      << table;
}

}  // namespace
}  // namespace alight
