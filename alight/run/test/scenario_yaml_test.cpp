#include "alight/run/scenario_yaml.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "alight/io/files.h"
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

class RecordedPlatform : public testing::Test {
 protected:
  RecordedPlatform()
      : folder_(std::filesystem::temp_directory_path() /
                ("alight_drive_" + std::to_string(getpid()))) {
    EXPECT_TRUE(write_file(at("s.yaml"), "platform: {kind: recorded, file: d.csv}\n"));
  }
  ~RecordedPlatform() override { std::filesystem::remove_all(folder_); }
  std::string at(const char* name) const { return (folder_ / name).string(); }
  std::string complaint_about(const std::string& drive) const {
    EXPECT_TRUE(write_file(at("d.csv"), drive));
    const auto scenario = load_scenario(at("s.yaml"));
    return scenario ? "" : scenario.error().detail;
  }
  std::filesystem::path folder_;
};

TEST_F(RecordedPlatform, ItsDriveStandsBesideTheScenario) {
  ASSERT_EQ(complaint_about("t,x,y,z,yaw_deg\n5,0,0,0.3,90\n6,0,0.5,0.3,100\n"), "");
  const auto scenario = load_scenario(at("s.yaml"));
  ASSERT_TRUE(scenario);
  const PoseLog& drive = scenario->platform.drive;
  ASSERT_EQ(drive.size(), 2u);
  EXPECT_EQ(drive[1].first, 6'000'000'000);
  EXPECT_EQ(Vector3(drive[1].second.translation()), Vector3(0, 0.5, 0.3));
  EXPECT_NEAR(yaw_of(drive[1].second.linear()), 100 * kDegree, 1e-12);
  // Written elsewhere it still finds its drive.
  const auto again = parse_scenario(scenario_text(*scenario), "elsewhere/s.yaml");
  ASSERT_TRUE(again) << again.error().detail;
  EXPECT_EQ(again->platform.file_text, scenario->platform.file_text);
  EXPECT_EQ(complaint_about("0 0 0 0.3 0 0 0 1\n1 0.2 0 0.3 0 0 0 1\n"), "");
}

TEST_F(RecordedPlatform, WhatIsWrongIsToldWithFileAndLine) {
  const std::string header = "t,x,y,z,yaw_deg\n";
  for (const auto& [text, words] : std::vector<std::pair<std::string, std::string>>{
           {"", "d.csv: holds no poses"},
           {"time,x,y,z\n", "d.csv:1: expected the header t,x,y,z,yaw_deg"},
           {header, "d.csv: holds no poses"},
           {header + "0,0,0,1,0\n1,2,3\n", "d.csv:3: found 3 fields"},
           {header + "0,0,0,1,0\n1,nan,0,1,0\n", "d.csv:3: 'nan'"},
           {header + "0,0,0,1,0\n1e99,0,0,1,0\n", "d.csv:3: '1e99'"},
           {header + "1,0,0,1,0\n0,0,0,1,0\n", "d.csv:3: time does not advance"},
           {header + "0,0,0,1,0\n", "d.csv: a drive needs at least two poses"},
           {header + "0,0,0,-1,0\n1,0,0,-1,0\n", "d.csv: at t = 0 s"},
           {header + "0,0,0,1,0\n0.1,500,0,1,0\n", "d.csv: at t = 0 s"}}) {
    const std::string what = complaint_about(text);
    EXPECT_NE(what.find(words), std::string::npos) << text << ": " << what;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
  }
  std::filesystem::remove(at("d.csv"));
  const auto gone = load_scenario(at("s.yaml"));
  ASSERT_FALSE(gone);
  EXPECT_NE(gone.error().detail.find("s.yaml:1: "), std::string::npos);
  EXPECT_NE(gone.error().detail.find("d.csv: no such file"), std::string::npos);
  EXPECT_NE(complaint("platform: {kind: recorded}").find("file is missing"),
            std::string::npos);
  EXPECT_NE(complaint("platform: {kind: circle, file: d.csv}").find("recorded alone"),
            std::string::npos);
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
