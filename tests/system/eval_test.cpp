#include <gtest/gtest.h>

#include <filesystem>

#include "alight/eval/path_error.h"
#include "alight/eval/statistics.h"
#include "alight/io/pose_log.h"

namespace alight {
namespace {

struct Row {
  const char* log;
  int frames;
  double position, fitted, rotation, mean_out, ms;
};

class AuthorsLogs : public testing::TestWithParam<Row> {};

/// The figures measured on the authors' logs, to the digits they were told in.
TEST_P(AuthorsLogs, AgreeWithTheTable) {
  const Row& row = GetParam();
  const std::string base =
      ALIGHT_SOURCE_DIR "/../shared/data/alan/logs/" + std::string(row.log);
  if (!std::filesystem::exists(base + "_vicon.csv")) GTEST_SKIP() << "no data here";
  const auto estimate = load_pose_log(base + "_estimate.csv");
  const auto truth = load_pose_log(base + "_vicon.csv");
  ASSERT_TRUE(estimate) << estimate.error().detail;
  ASSERT_TRUE(truth) << truth.error().detail;
  const auto pairs = associate_rows(estimate->poses, truth->poses);
  ASSERT_TRUE(pairs) << pairs.error().detail;
  const auto error = path_error(*pairs);
  ASSERT_TRUE(error) << error.error().detail;
  EXPECT_EQ(error->count, row.frames);
  EXPECT_NEAR(error->position_rmse_m, row.position, 0.0005);
  EXPECT_NEAR(error->position_fitted_rmse_m, row.fitted, 0.0005);
  EXPECT_NEAR(error->rotation_rmse_rad / kDegree, row.rotation, 0.05);
  EXPECT_NEAR(error->rotation_mean_out_rmse_rad / kDegree, row.mean_out, 0.05);
  EXPECT_NEAR(percentile(estimate->frame_ms, 0.5), row.ms, 0.05);
}
INSTANTIATE_TEST_SUITE_P(
    Logs, AuthorsLogs,
    testing::Values(Row{"static_led", 5325, 0.055, 0.025, 6.7, 3.9, 10.2},
                    Row{"dynamic_led", 2729, 0.056, 0.021, 9.0, 6.3, 10.7},
                    Row{"static_aruco", 2641, 0.112, 0.108, 38.3, 31.9, 12.2}));

}  // namespace
}  // namespace alight
