#include "alight/mission/dead_reckoning.h"

#include <gtest/gtest.h>

#include <limits>

namespace alight {
namespace {

constexpr Time kReport = 20'000'000;

AutopilotTelemetry report(int k, const Vector3& v_IB) {
  AutopilotTelemetry t;
  t.captured = k * kReport;
  t.v_IB = v_IB;
  return t;
}

TEST(DeadReckoning, TellsNothingOfADroneThatWasNeverInSight) {
  DeadReckoning reckoning;
  DeadReckoning::Velocity told;
  for (int k = 0; k < 5; ++k) reckoning.out_of_sight(report(k, Vector3(1, 2, 3)));
  EXPECT_FALSE(reckoning.next(kReport * 100, told));
}

TEST(DeadReckoning, WhatTheAutopilotIsOffByIsTakenOut) {
  const Vector3 off(0.1, -0.05, 0.2);
  DeadReckoning reckoning;
  for (int k = 0; k < 50; ++k) {
    const Vector3 v_IB(0.02 * k, 0.5, 0);
    reckoning.in_sight(report(k, v_IB + off), v_IB);
  }
  reckoning.out_of_sight(report(50, Vector3(1, 0.5, -0.1) + off));
  DeadReckoning::Velocity told;
  ASSERT_TRUE(reckoning.next(50 * kReport, told));
  EXPECT_EQ(told.captured, 50 * kReport);
  EXPECT_LT((told.v_IB - Vector3(1, 0.5, -0.1)).norm(), 1e-12);
  // One report that is far off is not what it is off by.
  reckoning.in_sight(report(51, Vector3(0.5, 0, 0)), Vector3::Zero());
  reckoning.out_of_sight(report(52, off));
  ASSERT_TRUE(reckoning.next(52 * kReport, told));
  EXPECT_LT(told.v_IB.norm(), 0.2);
}

// North, east and down taken for the axes of I, or another drone's radio.
TEST(DeadReckoning, WhatContradictsThePicturesIsNotBelieved) {
  DeadReckoning reckoning;
  DeadReckoning::Velocity told;
  const Vector3 seen(0.9, 0.2, -0.1);
  reckoning.in_sight(report(0, seen), seen);
  reckoning.in_sight(report(1, Vector3(seen.y(), seen.x(), -seen.z())), seen);
  reckoning.out_of_sight(report(2, seen));
  EXPECT_FALSE(reckoning.next(100 * kReport, told));
  reckoning.in_sight(report(3, seen + Vector3(0.1, 0, 0)), seen);
  reckoning.out_of_sight(report(4, seen + Vector3(0.1, 0, 0)));
  ASSERT_TRUE(reckoning.next(100 * kReport, told));
  EXPECT_LT((told.v_IB - seen).norm(), 1e-12);
}

TEST(DeadReckoning, ComesInOrderUpToATimeAndOnce) {
  DeadReckoning reckoning;
  reckoning.in_sight(report(0, Vector3::Zero()), Vector3::Zero());
  for (int k = 1; k <= 40; ++k) reckoning.out_of_sight(report(k, Vector3(k, 0, 0)));
  DeadReckoning::Velocity told;
  int last = 0, count = 0;
  while (reckoning.next(38 * kReport, told)) {
    const int k = static_cast<int>(told.captured / kReport);
    EXPECT_GT(k, last);
    EXPECT_EQ(told.v_IB.x(), k);
    last = k;
    ++count;
  }
  EXPECT_EQ(last, 38) << "the newest are kept";
  EXPECT_GE(count, 10);
  EXPECT_FALSE(reckoning.next(38 * kReport, told));
  // Seen again, what waited is out of date.
  reckoning.in_sight(report(41, Vector3::Zero()), Vector3::Zero());
  EXPECT_FALSE(reckoning.next(100 * kReport, told));
}

TEST(DeadReckoning, WhatHasNoVelocityChangesNothing) {
  const Vector3 none = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
  DeadReckoning reckoning;
  DeadReckoning::Velocity told;
  reckoning.in_sight(report(0, none), Vector3::Zero());
  reckoning.out_of_sight(report(1, Vector3(1, 0, 0)));
  EXPECT_FALSE(reckoning.next(100 * kReport, told)) << "not known to tell the truth";
  reckoning.in_sight(report(2, Vector3(1, 0, 0)), Vector3(1, 0, 0));
  reckoning.out_of_sight(report(3, none));
  EXPECT_FALSE(reckoning.next(100 * kReport, told));
  reckoning.out_of_sight(report(4, Vector3(2, 0, 0)));
  ASSERT_TRUE(reckoning.next(100 * kReport, told));
  EXPECT_EQ(told.v_IB, Vector3(2, 0, 0));
  reckoning.forget();
  reckoning.out_of_sight(report(5, Vector3(2, 0, 0)));
  EXPECT_FALSE(reckoning.next(100 * kReport, told));
}

}  // namespace
}  // namespace alight
