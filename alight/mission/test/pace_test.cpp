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
  EXPECT_NEAR(pace.at(kSecond + from_seconds(Pace::kTau)).rate, std::exp(-1), 1e-9);
  EXPECT_NEAR(pace.at(9 * kSecond).s, 1 + Pace::kTau, 1e-9);
  EXPECT_NEAR(pace.at(9 * kSecond).rate, 0, 1e-9);
  pace.aim(9 * kSecond, 1);
  EXPECT_NEAR(pace.at(20 * kSecond).s - pace.at(19 * kSecond).s, 1, 1e-9);
}

// What is aimed for takes effect some hundredths of a second later; until then the
// clock is read before that.
TEST(Pace, AimedAheadItIsReadBeforeAsItWentOn) {
  constexpr Time kAhead = 80 * kMs, kStep = 10 * kMs;
  for (const double goal : {0.0, 0.5, 1.0}) {
    Pace pace(0);
    pace.aim(kSecond, 0.3);
    Pace::Reading ahead = pace.at(kSecond + 3 * kStep + kAhead);
    for (Time now = kSecond + 4 * kStep; now < 3 * kSecond; now += kStep) {
      pace.aim(now + kAhead, goal);
      const Pace::Reading here = pace.at(now + kAhead);
      EXPECT_NEAR(here.rate, ahead.rate + to_seconds(kStep) * here.slope, 2e-3);
      ahead = here;
      const Pace::Reading before = pace.at(now);
      ASSERT_GE(before.rate, 0);
      ASSERT_LE(before.rate, 1);
      // Its place is the integral of its rate, read backwards as well.
      const Pace::Reading later = pace.at(now + kMs);
      ASSERT_NEAR(later.s - before.s, 0.5e-3 * (before.rate + later.rate), 1e-6);
    }
  }
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
      // s' is the rate, rate' no more than 1 / kTau.
      ASSERT_NEAR(now.s - before.s, 0.5e-3 * (now.rate + before.rate),
                  2e-6 / Pace::kTau);
      ASSERT_LE(std::abs(now.rate - before.rate), 1.001e-3 / Pace::kTau);
      before = now;
    }
  }
}

}  // namespace
}  // namespace alight
