#include "alight/mission/floor_contact.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "alight/base/rng.h"
#include "alight/geometry/so3.h"

namespace alight {
namespace {

constexpr Time kReport = 20'000'000;  // 50 Hz

/// A drone that sinks to the floor, hidden on the last part of the way.
struct Descent {
  FloorContact contact;
  Time now = kReport;
  double z = 0.6;  // above where it stands
  double hidden_below = 0.15;
  double told_off = 0;  // m/s, of what it tells
  double tilt = 0.05;
  double climb = -0.42;
  Seconds stands_for = 0;
  Seconds known_after = -1;  // from touch

  void report() {
    now += kReport;
    if (z <= 0) climb = 0;
    z = std::max(0.0, z + climb * to_seconds(kReport));
    if (z > hidden_below) contact.seen(z);
    contact.told(now, climb + told_off, tilt);
    if (z > 0) {
      EXPECT_FALSE(contact.stands()) << "at " << z << " m";
      return;
    }
    stands_for += to_seconds(kReport);
    if (contact.stands() && known_after < 0) known_after = stands_for;
  }
  void run(Seconds s) {
    for (Seconds t = 0; t < s; t += to_seconds(kReport)) report();
  }
};

TEST(FloorContact, IsFeltHalfASecondAfterTheFeetTouch) {
  Descent d;
  d.run(4);
  EXPECT_GT(d.known_after, 0.3);
  EXPECT_LT(d.known_after, 0.5);
}

TEST(FloorContact, IsFeltThroughWhatAnAutopilotTellsWrong) {
  for (const double off : {-0.12, -0.05, 0.05, 0.12}) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
      SCOPED_TRACE(std::to_string(off) + ", " + std::to_string(seed));
      Rng rng(seed);
      Descent d;
      for (int i = 0; i < 200; ++i) {
        d.told_off = off + rng.normal(0, 0.02);
        d.report();
      }
      EXPECT_GT(d.known_after, 0.3);
      EXPECT_LT(d.known_after, 0.6);
    }
  }
}

TEST(FloorContact, ADroneThatHoversInSightOrOutOfItFlies) {
  for (const double hidden_below : {0.0, 0.5}) {
    Descent d;
    d.hidden_below = hidden_below;
    d.run(0.6);
    d.climb = 0;  // a gust holds it up
    d.run(3);
    EXPECT_GT(d.z, 0.2);
    EXPECT_FALSE(d.contact.stands());
  }
}

TEST(FloorContact, WhatHasNotSunkDoesNotStand) {
  FloorContact contact;
  contact.seen(0.02);
  for (Time t = kReport; t < 100 * kReport; t += kReport) contact.told(t, 0, 0.05);
  EXPECT_FALSE(contact.stands());
}

TEST(FloorContact, ALeaningDroneIsLeftToItsAutopilot) {
  Descent d;
  d.tilt = 20 * kDegree;
  d.run(4);
  EXPECT_LT(d.known_after, 0);
}

TEST(FloorContact, AfterAGapOrWithoutAClimbNothingIsKnownUntilItIsSeen) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const bool gap : {true, false}) {
    Descent d;
    d.run(1.2);  // hidden by now
    if (gap) {
      d.now += 20 * kReport;
    } else {
      d.contact.told(d.now + 1, nan, 0.05);
    }
    d.run(3);
    EXPECT_LT(d.known_after, 0);
  }
}

TEST(FloorContact, DamagedNumbersTellNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  FloorContact contact;
  contact.seen(nan);
  contact.told(kReport, -1, 0);
  contact.seen(0.1);
  contact.told(2 * kReport, -0.4, nan);
  contact.told(kReport, -0.4, 0);
  EXPECT_FALSE(contact.stands());
}

}  // namespace
}  // namespace alight
