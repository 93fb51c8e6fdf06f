#include "alight/mission/pace.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

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
  // Two lags, one after the other.
  EXPECT_NEAR(pace.at(kSecond + from_seconds(Pace::kTau)).rate, 2 * std::exp(-1), 1e-9);
  EXPECT_NEAR(pace.at(9 * kSecond).s, 1 + 2 * Pace::kTau, 1e-9);
  EXPECT_NEAR(pace.at(9 * kSecond).rate, 0, 1e-9);
  pace.aim(9 * kSecond, 1);
  EXPECT_NEAR(pace.at(20 * kSecond).s - pace.at(19 * kSecond).s, 1, 1e-9);
}

TEST(Pace, SaysHowFarItRunsUntilItStops) {
  for (const double goal : {0.0, 0.4, 1.0}) {
    for (Time after = 0; after < kSecond; after += 70 * kMs) {
      Pace pace(0);
      pace.aim(kSecond, goal);
      const Pace::Reading here = pace.at(kSecond + after);
      pace.aim(kSecond + after, 0);
      EXPECT_NEAR(pace.at(20 * kSecond).s, here.s + here.stops, 1e-9);
    }
  }
}

// What is aimed for takes effect some hundredths of a second later. Until then the
// clock goes on as it was told to before, to the last bit, however long that is.
TEST(Pace, AimedAheadItIsReadBeforeAsItWasForetold) {
  constexpr Time kStep = 10 * kMs;
  for (const Time ahead : {0 * kMs, 80 * kMs, 300 * kMs}) {
    Rng rng(5);
    Pace pace(0);
    std::vector<Pace::Reading> foretold;
    for (Time now = 0; now < 6 * kSecond; now += kStep) {
      pace.aim(now + ahead, rng.uniform(0, 1));
      foretold.push_back(pace.at(now + ahead));
      if (now < ahead) continue;
      const auto then = static_cast<std::size_t>((now - ahead) / kStep);
      EXPECT_EQ(pace.at(now).s, foretold[then].s);
      EXPECT_EQ(pace.at(now).rate, foretold[then].rate);
      EXPECT_EQ(pace.at(now).slope, foretold[then].slope);
    }
  }
}

// The radio's delay has become shorter: what was still to come is forgotten.
TEST(Pace, ANearerAimTakesThePlaceOfThoseAfterIt) {
  Pace pace(0), other(0);
  pace.aim(2 * kSecond, 0.5);
  other.aim(2 * kSecond, 0.5);
  pace.aim(2 * kSecond + 200 * kMs, 1);
  pace.aim(2 * kSecond + 100 * kMs, 0);
  other.aim(2 * kSecond + 100 * kMs, 0);
  for (Time t = kSecond; t < 4 * kSecond; t += 30 * kMs) {
    EXPECT_EQ(pace.at(t).s, other.at(t).s);
  }
}

TEST(Pace, HoweverItIsAimedItRunsForwardEvenly) {
  constexpr double kDt = 1e-3;
  for (unsigned seed = 0; seed < 200; ++seed) {
    Rng rng(seed);
    Pace pace(0);
    Pace::Reading before = pace.at(0);
    for (Time t = kMs; t < 4 * kSecond; t += kMs) {
      bool aimed = false;
      if (rng.uniform(0, 1) < 0.02) {
        const Pace::Reading here = pace.at(t);
        const double goal = std::clamp(rng.uniform(-0.5, 1.5), 0.0, 1.0);
        pace.aim(t, goal);
        aimed = true;
        EXPECT_NEAR(pace.at(t).s, here.s, 1e-12);
        EXPECT_NEAR(pace.at(t).rate, here.rate, 1e-12);
        EXPECT_NEAR(pace.at(t).slope, here.slope, 1e-9);
      }
      const Pace::Reading now = pace.at(t);
      ASSERT_GE(now.rate, 0);
      ASSERT_LE(now.rate, 1 + 1e-12);
      // s' is the rate, rate' the slope, slope' the curve.
      ASSERT_NEAR(now.s - before.s, 0.5 * kDt * (now.rate + before.rate), 1e-7);
      ASSERT_NEAR(now.rate - before.rate, 0.5 * kDt * (now.slope + before.slope), 1e-6);
      if (!aimed) {
        ASSERT_NEAR(now.slope - before.slope, 0.5 * kDt * (now.curve + before.curve),
                    1e-4);
      }
      ASSERT_LE(std::abs(now.rate - before.rate), 1.001 * kDt / Pace::kTau);
      before = now;
    }
  }
}

}  // namespace
}  // namespace alight
