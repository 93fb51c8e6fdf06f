#include "alight/control/reference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alight/base/rng.h"
#include "alight/geometry/so3.h"

namespace alight {
namespace {

Vector3 draw(Rng& rng, double sd) {
  return {rng.normal(0, sd), rng.normal(0, sd), rng.normal(0, sd)};
}

constexpr Time kStart = 5'000'000'000;

TEST(PointToPoint, BeginsAsItCameAndEndsAtRest) {
  Rng rng(1);
  for (int i = 0; i < 200; ++i) {
    FlatState from;
    from.p_NB = draw(rng, 2);
    from.v_NB = draw(rng, 0.5);
    from.a_NB = draw(rng, 0.5);
    from.yaw = rng.uniform(-3, 3);
    from.yaw_rate = rng.uniform(-0.5, 0.5);
    const Vector3 to = draw(rng, 2);
    const double yaw = rng.uniform(-3, 3);
    const PointToPoint move(kStart, from, to, yaw, {});
    const FlatState a = move.at(kStart);
    EXPECT_LT((a.p_NB - from.p_NB).norm(), 1e-9);
    EXPECT_LT((a.v_NB - from.v_NB).norm(), 1e-9);
    EXPECT_LT((a.a_NB - from.a_NB).norm(), 1e-9);
    EXPECT_NEAR(a.yaw_rate, from.yaw_rate, 1e-9);
    const FlatState b = move.at(move.end() - 1);
    EXPECT_LT((b.p_NB - to).norm(), 1e-6);
    EXPECT_LT(b.v_NB.norm(), 1e-6);
    EXPECT_LT(b.a_NB.norm(), 1e-6);
    EXPECT_NEAR(wrap_angle(b.yaw - yaw), 0, 1e-6);
    EXPECT_LE(std::abs(move.goal_yaw() - from.yaw), kPi + 1e-9);
    const FlatState after = move.at(move.end() + 1'000'000'000);
    EXPECT_EQ(after.p_NB, to);
    EXPECT_EQ(after.v_NB.norm(), 0);
    EXPECT_TRUE(move.done(move.end()));
  }
}

TEST(PointToPoint, DerivativesAreThoseOfThePosition) {
  FlatState from;
  from.v_NB = Vector3(0.3, -0.2, 0.1);
  from.yaw_rate = 0.4;
  const PointToPoint move(kStart, from, Vector3(1, 2, 0.5), 1, {});
  const Time h = 100'000;
  for (double u = 0.05; u < 0.95; u += 0.07) {
    const Time t = kStart + from_seconds(u * move.duration());
    const FlatState a = move.at(t - h), b = move.at(t + h), m = move.at(t);
    const double dt = 2 * to_seconds(h);
    EXPECT_LT(((b.p_NB - a.p_NB) / dt - m.v_NB).norm(), 1e-6);
    EXPECT_LT(((b.v_NB - a.v_NB) / dt - m.a_NB).norm(), 1e-6);
    EXPECT_LT(((b.a_NB - a.a_NB) / dt - m.j_NB).norm(), 1e-5);
    EXPECT_NEAR((b.yaw - a.yaw) / dt, m.yaw_rate, 1e-6);
  }
}

TEST(PointToPoint, KeepsItsBounds) {
  Rng rng(2);
  const MoveLimits limits{0.8, 1.2, 0.7};
  for (int i = 0; i < 300; ++i) {
    FlatState from;
    from.p_NB = draw(rng, 1.5);
    from.v_NB = draw(rng, 0.25);
    from.yaw = rng.uniform(-3, 3);
    const PointToPoint move(kStart, from, draw(rng, 1.5), rng.uniform(-3, 3), limits);
    const double v_max = std::max(limits.speed_m_s, 1.1 * from.v_NB.norm());
    for (int k = 0; k <= 300; ++k) {
      const FlatState s = move.at(kStart + from_seconds(move.duration() * k / 300.0));
      EXPECT_LE(s.v_NB.norm(), 1.01 * v_max);
      EXPECT_LE(s.a_NB.norm(), 1.01 * limits.acceleration_m_s2);
      EXPECT_LE(std::abs(s.yaw_rate), 1.01 * limits.yaw_rate_rad_s);
    }
  }
}

TEST(PointToPoint, IsNotIdle) {
  // From rest, the bound on acceleration or speed is nearly reached somewhere.
  for (const double d : {0.1, 0.5, 1.5, 5.0}) {
    const PointToPoint move(0, FlatState{}, Vector3(d, 0, 0), 0, {});
    double v = 0, a = 0;
    for (int k = 0; k <= 400; ++k) {
      const FlatState s = move.at(from_seconds(move.duration() * k / 400.0));
      v = std::max(v, s.v_NB.norm());
      a = std::max(a, s.a_NB.norm());
    }
    const MoveLimits limits;
    EXPECT_GT(std::max(v / limits.speed_m_s, a / limits.acceleration_m_s2), 0.85) << d;
  }
}

// A start that gains speed leaves the bounds whatever comes after; not by much.
TEST(PointToPoint, AStartThatGainsSpeedStaysNearItsBounds) {
  Rng rng(3);
  const MoveLimits limits{0.9, 1.2, 1};
  for (int i = 0; i < 300; ++i) {
    FlatState from;
    from.v_NB = draw(rng, 0.8);
    from.a_NB = 2 * rng.uniform() * from.v_NB.normalized();
    const Vector3 to = draw(rng, 1.0);
    const PointToPoint move(kStart, from, to, 0, limits);
    for (int k = 0; k <= 300; ++k) {
      const FlatState s = move.at(kStart + from_seconds(move.duration() * k / 300.0));
      EXPECT_LE(s.v_NB.norm(), 2 * std::max(limits.speed_m_s, from.v_NB.norm()));
      // Twice its way of braking with the acceleration allowed, after half a second in
      // which it gains speed, and some for its own.
      const double speed = from.v_NB.norm() + 0.5 * from.a_NB.norm();
      const double braking = speed * speed / limits.acceleration_m_s2;
      EXPECT_LE((s.p_NB - to).norm(), to.norm() + 1 + braking);
    }
    EXPECT_LT((move.at(move.end()).p_NB - to).norm(), 1e-9);
  }
}

TEST(PointToPoint, NowhereToGo) {
  const PointToPoint move(kStart, FlatState{}, Vector3::Zero(), 0, {});
  for (Time t = kStart - 1; t < kStart + 1'000'000'000; t += 50'000'000) {
    EXPECT_LT(move.at(t).p_NB.norm(), 1e-12);
  }
  EXPECT_EQ(PointToPoint().at(123).p_NB, Vector3(0, 0, 0));
}

// Close above the pad a move that turns round in its own time would touch it first.
TEST(PointToPoint, AStartThatSinksRisesInTimeForTheRoomBelow) {
  Rng rng(11);
  int sooner = 0;
  for (int i = 0; i < 300; ++i) {
    FlatState from;
    from.v_NB = Vector3(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-0.6, 0));
    from.a_NB.z() = rng.uniform(-0.5, 0.5);
    const Vector3 to(rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(0.1, 1));
    MoveLimits limits;
    const PointToPoint usual(0, from, to, 0, limits);
    limits.dip_m = rng.uniform(0.01, 0.2);
    const PointToPoint move(0, from, to, 0, limits);
    EXPECT_EQ(move.duration(), usual.duration());
    double least = 0, usual_least = 0, hardest = 0;
    FlatState last = move.at(0);
    for (Time t = 0; t <= move.end(); t += 5'000'000) {
      const FlatState now = move.at(t);
      least = std::min(least, now.p_NB.z());
      usual_least = std::min(usual_least, usual.at(t).p_NB.z());
      hardest = std::max(hardest, std::abs(now.a_NB.z()));
      EXPECT_LT((now.p_NB - last.p_NB).norm(), 0.03);
      EXPECT_LT((now.v_NB - last.v_NB).norm(), 0.05);
      EXPECT_EQ(now.p_NB.head<2>(), usual.at(t).p_NB.head<2>());
      last = now;
    }
    EXPECT_LE(hardest, limits.lift_m_s2 + 1e-9);
    EXPECT_NEAR((move.at(move.end()).p_NB - to).norm(), 0, 1e-6);
    // What the room asks for, or all that the bound gives.
    EXPECT_TRUE(least >= -limits.dip_m - 1e-3 || hardest > 0.85 * limits.lift_m_s2)
        << least << " of " << limits.dip_m << ", " << hardest;
    sooner += least > usual_least + 1e-6;
    if (usual_least > -limits.dip_m) {
      EXPECT_EQ(least, usual_least) << "there was room";
    }
  }
  EXPECT_GT(sooner, 50);
}

}  // namespace
}  // namespace alight
