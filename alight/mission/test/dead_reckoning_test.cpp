#include "alight/mission/dead_reckoning.h"

#include <gtest/gtest.h>

#include <limits>

namespace alight {
namespace {

constexpr Time kReport = 20'000'000;

DeadReckoning::Velocity report(int k, const Vector3& v_IB) {
  return {k * kReport, v_IB};
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
  const Vector3 v_IB(1, 0.5, 0);
  reckoning.in_sight(report(51, v_IB + off + Vector3(0.3, 0, 0)), v_IB);
  reckoning.out_of_sight(report(52, v_IB + off));
  ASSERT_TRUE(reckoning.next(52 * kReport, told));
  EXPECT_LT((told.v_IB - v_IB).norm(), 0.05);
}

// An estimator that begins anew, and goes on from there.
TEST(DeadReckoning, WhatJumpsAsNoDroneCanIsItsEstimator) {
  const Vector3 jump(0.3, -0.4, 0);
  for (const int jumps_at : {50, 53, 58}) {
    SCOPED_TRACE(jumps_at);
    DeadReckoning reckoning;
    DeadReckoning::Velocity told;
    for (int k = 0; k < 60; ++k) {
      const Vector3 v_IB(0.1 * k, 0.5, 0);  // 5 m/s^2
      const Vector3 tells = v_IB + (k >= jumps_at ? jump : Vector3::Zero());
      if (k < 50) {
        reckoning.in_sight(report(k, tells), v_IB);
        continue;
      }
      reckoning.out_of_sight(report(k, tells));
      ASSERT_TRUE(reckoning.next(k * kReport, told));
      // But for what it moved by meanwhile.
      EXPECT_LT((told.v_IB - v_IB).norm(), 0.11) << k;
    }
  }
}

TEST(DeadReckoning, HardBrakingAndReportsThatAreLostAreNoJump) {
  DeadReckoning reckoning;
  DeadReckoning::Velocity told;
  reckoning.in_sight(report(0, Vector3::Zero()), Vector3::Zero());
  reckoning.out_of_sight(report(1, Vector3(0.3, 0, 0)));
  reckoning.out_of_sight(report(7, Vector3(1.5, 0, 0)));
  ASSERT_TRUE(reckoning.next(1 * kReport, told));
  EXPECT_EQ(told.v_IB.x(), 0.3);
  ASSERT_TRUE(reckoning.next(7 * kReport, told));
  EXPECT_EQ(told.v_IB.x(), 1.5);
}

// North, east and down taken for the axes of I, or another drone's radio.
TEST(DeadReckoning, WhatContradictsThePicturesIsNotBelieved) {
  DeadReckoning reckoning;
  DeadReckoning::Velocity told;
  const Vector3 seen(0.9, 0.2, -0.1), other(seen.y(), seen.x(), -seen.z());
  reckoning.in_sight(report(0, other), seen);
  reckoning.out_of_sight(report(1, other));
  EXPECT_FALSE(reckoning.next(100 * kReport, told));
  reckoning.in_sight(report(2, seen + Vector3(0.1, 0, 0)), seen);
  reckoning.out_of_sight(report(3, seen + Vector3(0.1, 0, 0)));
  ASSERT_TRUE(reckoning.next(100 * kReport, told));
  EXPECT_LT((told.v_IB - seen).norm(), 1e-12);
  // For a moment the pictures may be wrong, but not for long.
  for (int k = 4; k <= 40; ++k) {
    reckoning.in_sight(report(k, other), seen);
    if (k != 10 && k != 40) continue;
    reckoning.out_of_sight(report(k, other));
    EXPECT_EQ(reckoning.next(100 * kReport, told), k == 10);
  }
}

TEST(DeadReckoning, ComesInOrderUpToATimeAndOnce) {
  DeadReckoning reckoning;
  reckoning.in_sight(report(0, Vector3::Zero()), Vector3::Zero());
  for (int k = 1; k <= 40; ++k) {
    reckoning.out_of_sight(report(k, Vector3(0.1 * k, 0, 0)));
  }
  DeadReckoning::Velocity told;
  int last = 0, count = 0;
  while (reckoning.next(38 * kReport, told)) {
    const int k = static_cast<int>(told.captured / kReport);
    EXPECT_GT(k, last);
    EXPECT_EQ(told.v_IB.x(), 0.1 * k);
    last = k;
    ++count;
  }
  EXPECT_EQ(last, 38) << "the newest are kept";
  EXPECT_GE(count, 10);
  EXPECT_FALSE(reckoning.next(38 * kReport, told));
  // Seen again, what waited is out of date.
  reckoning.in_sight(report(41, Vector3(4, 0, 0)), Vector3(4, 0, 0));
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
  reckoning.out_of_sight(report(4, Vector3(1.2, 0, 0)));
  ASSERT_TRUE(reckoning.next(100 * kReport, told));
  EXPECT_EQ(told.v_IB, Vector3(1.2, 0, 0));
  reckoning.forget();
  reckoning.out_of_sight(report(5, Vector3(1.2, 0, 0)));
  EXPECT_FALSE(reckoning.next(100 * kReport, told));
}

}  // namespace
}  // namespace alight
