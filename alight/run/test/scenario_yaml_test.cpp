#include "alight/run/scenario_yaml.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "alight/io/text.h"

namespace alight {
namespace {

std::string complaint(const std::string& text) {
  const auto scenario = parse_scenario(text, "s.yaml");
  return scenario ? "" : scenario.error().detail;
}

TEST(ScenarioYaml, AnEmptyMapIsTheDefault) {
  const auto scenario = parse_scenario("{}", "s.yaml");
  ASSERT_TRUE(scenario) << scenario.error().detail;
  EXPECT_EQ(scenario_text(*scenario), scenario_text(Scenario{}));
}

TEST(ScenarioYaml, WhatIsWrittenReadsBack) {
  Scenario scenario;
  scenario.platform.kind = PlatformKind::block;
  scenario.platform.speed_m_s = 0.1 + 0.2;  // has no short decimal
  scenario.start.place = StartPlace::floor;
  scenario.wind.gusts = Gusts::dryden;
  scenario.autopilot.interface = AutopilotInterface::velocity;
  scenario.autopilot.external_pose = false;
  scenario.faults.push_back({.kind = FaultKind::radio_out, .at_s = 3, .for_s = 0.25});
  scenario.faults.push_back({.kind = FaultKind::gust, .at_s = 5, .for_s = 1});
  const std::string text = scenario_text(scenario);
  const auto back = parse_scenario(text, "s.yaml");
  ASSERT_TRUE(back) << back.error().detail;
  EXPECT_EQ(scenario_text(*back), text);
  EXPECT_EQ(back->platform.kind, PlatformKind::block);
  EXPECT_EQ(back->platform.speed_m_s, 0.1 + 0.2);
  EXPECT_EQ(back->start.place, StartPlace::floor);
  ASSERT_EQ(back->faults.size(), 2u);
  EXPECT_EQ(back->faults[0].kind, FaultKind::radio_out);
  EXPECT_EQ(back->faults[0].for_s, 0.25);
}

TEST(ScenarioYaml, EveryNamedScenarioHolds) {
  int count = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(ALIGHT_SOURCE_DIR "/config/scenarios")) {
    const auto scenario = load_scenario(entry.path().string());
    EXPECT_TRUE(scenario) << scenario.error().detail;
    ++count;
  }
  EXPECT_GE(count, 4);
}

TEST(ScenarioYaml, UnknownKeysAreNamedWithTheNearestKnown) {
  EXPECT_EQ(complaint("wind:\n  meen_m_s: 1\n").substr(0, 9), "s.yaml:2:");
  EXPECT_NE(complaint("wind: {meen_m_s: 1}").find("mean_m_s"), std::string::npos);
  EXPECT_NE(complaint("windy: {mean_m_s: 1}").find("did you mean wind"),
            std::string::npos);
  EXPECT_NE(complaint("faults: [{kind: gust, at: 1}]").find("at_s"), std::string::npos);
}

TEST(ScenarioYaml, WordsOutsideTheChoiceAreNamed) {
  const std::string what = complaint("platform: {kind: cirle}");
  EXPECT_NE(what.find("s.yaml:1"), std::string::npos) << what;
  EXPECT_NE(what.find("'circle'"), std::string::npos) << what;
}

TEST(ScenarioYaml, EveryNumberOutOfRangeIsRefused) {
  // Every number of the file in turn is made NaN, infinite and a word.
  const std::string text = scenario_text(Scenario{});
  int tried = 0;
  std::size_t begin = 0;
  for (const std::string_view line : split(text, '\n')) {
    const std::size_t colon = line.find(": ");
    double value = 0;
    if (colon != std::string_view::npos &&
        parse_number(line.substr(colon + 2), value)) {
      for (const char* bad : {".nan", ".inf", "-.inf", "much", "[1, 2]"}) {
        std::string broken = text;
        broken.replace(begin + colon + 2, line.size() - colon - 2, bad);
        EXPECT_FALSE(parse_scenario(broken, "s.yaml")) << line << " made " << bad;
      }
      ++tried;
    }
    begin += line.size() + 1;
  }
  EXPECT_GE(tried, 30);
}

TEST(ScenarioYaml, ValuesOutOfBoundsNameFileAndField) {
  for (const char* text :
       {"radio: {loss: 1.5}", "platform: {speed_m_s: -1}", "wind: {mean_m_s: -2}"}) {
    const std::string what = complaint(text);
    EXPECT_EQ(what.find("s.yaml"), 0u) << text << ": " << what;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
  }
}

TEST(ScenarioYaml, WhatIsNoScenarioIsRefused) {
  for (const char* text :
       {"[1, 2]", "platform: 3", "platform: [", "wind: {mean_m_s: 1, mean_m_s: 2}",
        "faults: {kind: gust}", "\t- x: : y"}) {
    EXPECT_FALSE(parse_scenario(text, "s.yaml")) << '"' << text << '"';
  }
}

}  // namespace
}  // namespace alight
