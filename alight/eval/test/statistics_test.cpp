#include "alight/eval/statistics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"

namespace alight {
namespace {

TEST(Wilson, SolvesItsOwnEquation) {
  // The bounds are the p at which the count lies z standard deviations off.
  const double z = 1.959963984540054;
  for (const auto& [k, n] : {std::pair{1, 10}, {5, 10}, {395, 400}, {37, 1000}}) {
    const Interval i = wilson_interval(k, n, z);
    const double share = static_cast<double>(k) / n;
    for (const double p : {i.low, i.high}) {
      EXPECT_NEAR(std::abs(share - p), z * std::sqrt(p * (1 - p) / n), 1e-12);
    }
    EXPECT_LT(i.low, share);
    EXPECT_GT(i.high, share);
  }
}

TEST(Wilson, StaysInsideZeroAndOne) {
  EXPECT_EQ(wilson_interval(0, 0).low, 0);
  EXPECT_EQ(wilson_interval(0, 0).high, 1);
  EXPECT_NEAR(wilson_interval(0, 400).low, 0, 1e-12);
  EXPECT_NEAR(wilson_interval(400, 400).low, 0.990487, 1e-6);  // n / (n + z^2)
  EXPECT_NEAR(wilson_interval(400, 400).high, 1, 1e-12);
}

TEST(Wilson, CoversTheTruthAboutAsOftenAsItSays) {
  Rng rng(3);
  int covered = 0;
  const int rounds = 3000;
  for (int r = 0; r < rounds; ++r) {
    int k = 0;
    for (int i = 0; i < 200; ++i) k += rng.chance(0.9);
    const Interval i = wilson_interval(k, 200);
    covered += i.low <= 0.9 && 0.9 <= i.high;
  }
  EXPECT_NEAR(static_cast<double>(covered) / rounds, 0.95, 0.02);
}

TEST(Percentile, IsLinearBetweenOrderStatistics) {
  EXPECT_DOUBLE_EQ(percentile({4, 1, 3, 2}, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(percentile({4, 1, 3, 2}, 0), 1);
  EXPECT_DOUBLE_EQ(percentile({4, 1, 3, 2}, 1), 4);
  EXPECT_DOUBLE_EQ(percentile({0, 10}, 0.95), 9.5);
  EXPECT_DOUBLE_EQ(percentile({std::nan(""), 7}, 0.3), 7);
  EXPECT_TRUE(std::isnan(percentile({}, 0.5)));
}

TEST(MeanAndRms, AreWhatTheyAre) {
  EXPECT_DOUBLE_EQ(mean({1, 2, 6}), 3);
  EXPECT_DOUBLE_EQ(rms({3, -4}), std::sqrt(12.5));
  EXPECT_TRUE(std::isnan(mean({})));
  EXPECT_TRUE(std::isnan(rms({})));
}

}  // namespace
}  // namespace alight
