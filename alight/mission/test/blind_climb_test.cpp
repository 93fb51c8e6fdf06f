#include "alight/mission/blind_climb.h"

#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <limits>
#include <string>

#include "alight/base/rng.h"
#include "alight/geometry/so3.h"

namespace alight {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr Time kStep = 10'000'000;  // 100 Hz

/// A drone on the floor, and the radio to it and back.
struct Climb {
  BlindClimb::Config config;
  BlindClimb brain;
  double hover = 1;             // share that carries it
  Seconds there = 0.08;         // until thrust acts
  Seconds back = 0.04;          // until the brain is told
  Time every = 20'000'000;      // telemetry
  double told_off = 0, sd = 0;  // m/s, of what it tells: steady, and over 0.4 s
  double drag = 0.2;            // 1/s
  double noise = 0;
  Rng rng{1};

  Time now = 0;
  double z = 0, v = 0, share = 0;
  double fastest = 0, least = 9;
  struct Late {
    Time at = 0;
    Time captured = 0;
    double value = 0;
  };
  std::deque<Late> sent, told;

  void run(Seconds s) {
    if (now == 0) brain.begin(config, now);
    for (const Time end = now + from_seconds(s); now < end; now += kStep) {
      while (!told.empty() && told.front().at <= now) {
        brain.told(told.front().captured, told.front().value);
        told.pop_front();
      }
      const double wanted = brain.share(now, there);
      sent.push_back({now + from_seconds(there), now, wanted});
      while (!sent.empty() && sent.front().at <= now) {
        share = sent.front().value;
        sent.pop_front();
      }
      const double a = kGravity * (share / hover - 1) - drag * v;
      v = z <= 0 && a < 0 ? 0 : v + a * to_seconds(kStep);
      z = std::max(0.0, z + v * to_seconds(kStep));
      fastest = std::max(fastest, v);
      if (z > 0.1) least = std::min(least, v);
      if (now % every == 0) {
        const double keep = std::exp(-to_seconds(every) / 0.4);
        noise = keep * noise + std::sqrt(1 - keep * keep) * rng.normal(0, sd);
        told.push_back({now + from_seconds(back), now, v + told_off + noise});
      }
    }
  }
};

TEST(BlindClimb, HoldsItsSpeedWhateverCarriesTheDrone) {
  for (const double hover : {0.78, 0.9, 1.0, 1.12, 1.25}) {
    for (const Seconds there : {0.03, 0.1, 0.2}) {
      for (const Seconds back : {0.01, 0.12}) {
        SCOPED_TRACE(std::to_string(hover) + ", " + std::to_string(there) + ", " +
                     std::to_string(back));
        Climb c;
        c.hover = hover;
        c.there = there;
        c.back = back;
        c.run(3);
        EXPECT_TRUE(c.brain.lifted());
        EXPECT_NEAR(c.v, c.config.speed_m_s, 0.12);
        EXPECT_LT(c.fastest, 1.7 * c.config.speed_m_s + 2 * (there + back));
        EXPECT_GT(c.least, 0.2) << "it never stops on its way";
        EXPECT_NEAR(c.brain.height_m(), c.z, 0.1 + (back + 0.02) * 1.2);
      }
    }
  }
}

TEST(BlindClimb, IsNoFasterThanItIsToldWrongly) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(seed);
    Climb c;
    c.rng = Rng(seed);
    c.noise = c.rng.normal(0, 0.1);
    c.hover = c.rng.uniform(0.8, 1.2);
    c.there = c.rng.uniform(0.03, 0.2);
    c.back = c.rng.uniform(0.01, 0.12);
    c.every = seed % 3 == 0 ? 100'000'000 : 20'000'000;
    c.told_off = c.rng.uniform(-0.15, 0.15);
    c.sd = 0.1;
    c.run(3);
    EXPECT_LT(c.fastest, 2.1);
    EXPECT_NEAR(c.v, c.config.speed_m_s - c.told_off, 0.6);
  }
}

TEST(BlindClimb, ToldNothingThrustOnlyGrows) {
  Climb c;
  c.told_off = kNaN;
  c.hover = 2;
  c.run(0.3);
  EXPECT_NEAR(c.share, 0.7 + 1.1 * (0.3 - 0.08), 0.03);
  c.run(2);
  EXPECT_EQ(c.share, c.config.to);
  EXPECT_FALSE(c.brain.lifted());
}

TEST(BlindClimb, NoiseOfADroneThatStandsDoesNotStopTheRamp) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(seed);
    Climb c;
    c.rng = Rng(seed);
    c.sd = 0.1;
    c.told_off = 0.1;
    c.hover = 1.15;
    c.run(3);
    EXPECT_GT(c.z, 0.8);
    EXPECT_LT(c.fastest, 1.8);
  }
}

// Telemetry ends on the way: what is known carries on, for as long as a link may be
// lost.
TEST(BlindClimb, GoesOnWithoutTelemetryForAWhile) {
  Climb c;
  c.hover = 0.88;
  c.run(1.2);
  c.told_off = kNaN;
  c.run(0.6);
  EXPECT_NEAR(c.v, c.config.speed_m_s, 0.35);
}

TEST(BlindClimb, WhatIsOldOrNoNumberChangesNothing) {
  Climb a;
  a.run(1);
  Climb b = a;
  b.brain.told(b.now - 500'000'000, 5);
  b.brain.told(b.now, kNaN);
  b.brain.told(b.now, std::numeric_limits<double>::infinity());
  EXPECT_EQ(a.brain.share(a.now, 0.1), b.brain.share(b.now, 0.1));
  EXPECT_EQ(a.brain.height_m(), b.brain.height_m());
}

}  // namespace
}  // namespace alight
