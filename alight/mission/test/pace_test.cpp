#include "alight/mission/pace.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr Time kMs = 1'000'000, kSecond = 1000 * kMs;

TEST(Pace, LeftAloneItIsTheClock) {
  const Pace pace(3 * kSecond);
  for (const Time t : {Time{0}, 3 * kSecond, 5 * kSecond}) {
    EXPECT_DOUBLE_EQ(pace.at(t).s, to_seconds(t) - 3);
    EXPECT_EQ(pace.at(t).rate, 1);
    EXPECT_EQ(pace.at(t).slope, 0);
  }
}

TEST(Pace, StopsAndGoesOnWithoutAJump) {
  Pace pace(0);
  pace.aim(kSecond, 0);
  const Time stopped = kSecond + from_seconds(1 / Pace::kSlew);
  EXPECT_NEAR(pace.at(stopped).rate, 0, 1e-9);
  EXPECT_NEAR(pace.at(stopped).s, 1 + 0.5 / Pace::kSlew, 1e-9);
  EXPECT_EQ(pace.at(9 * kSecond).s, pace.at(5 * kSecond).s);
  pace.aim(9 * kSecond, 1);
  EXPECT_NEAR(pace.at(20 * kSecond).s - pace.at(19 * kSecond).s, 1, 1e-9);
}

TEST(Pace, HoweverItIsAimedItRunsForwardEvenly) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    Rng rng(seed);
    Pace pace(0);
    Pace::Reading before = pace.at(0);
    for (Time t = kMs; t < 4 * kSecond; t += kMs) {
      if (rng.uniform(0, 1) < 0.02) {
        const Pace::Reading here = pace.at(t);
        const double goal = std::clamp(rng.uniform(-0.5, 1.5), 0.0, 1.0);
        pace.aim(t, goal);
        EXPECT_NEAR(pace.at(t).s, here.s, 1e-12);
        EXPECT_NEAR(pace.at(t).rate, here.rate, 1e-12);
      }
      const Pace::Reading now = pace.at(t);
      ASSERT_GE(now.rate, 0);
      ASSERT_LE(now.rate, 1 + 1e-12);
      // s' is the rate, rate' no more than kSlew.
      ASSERT_NEAR(now.s - before.s, 0.5e-3 * (now.rate + before.rate),
                  2 * Pace::kSlew * 1e-6);
      ASSERT_LE(std::abs(now.rate - before.rate), 1.001e-3 * Pace::kSlew);
      before = now;
    }
  }
}

}  // namespace
}  // namespace alight
