#pragma once
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "alight/run/landing_run.h"
#include "alight/run/run_record.h"
#include "alight/run/scenario_yaml.h"

namespace alight::test {

/// The named scenario of config/scenarios with the authors' rig.
inline LandingRunOptions options_of(const std::string& name, std::uint64_t seed) {
  const auto scenario = load_scenario(std::string(ALIGHT_SOURCE_DIR) +
                                      "/config/scenarios/" + name + ".yaml");
  EXPECT_TRUE(scenario) << scenario.error().detail;
  LandingRunOptions options;
  if (scenario) options.scenario = *scenario;
  options.rig = alan_rig();
  options.seed = seed;
  return options;
}

/// All that must repeat from run to run.
inline std::string figures(const LandingResult& result) {
  auto j = nlohmann::ordered_json::parse(result_json(result));
  j.erase("timing_us");
  j.erase("realtime_factor");
  return j.dump(1);
}

/// A folder of its own for each test, gone with it.
class Folder {
 public:
  Folder() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::path(::testing::TempDir()) /
            (std::string("alight_") + test->test_suite_name() + "_" + test->name());
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

}  // namespace alight::test
