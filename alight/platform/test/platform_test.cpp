#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "alight/base/rng.h"
#include "alight/platform/platform_tracker.h"
#include "alight/platform/test/deck.h"
#include "alight/platform/ugv_controller.h"

namespace alight {
namespace {

class EveryPath : public testing::TestWithParam<PathConfig> {};

TEST_P(EveryPath, RunsAtUnitSpeedAlongItsHeading) {
  const Path path(GetParam());
  const double h = 1e-5;
  for (double s = 0.013; s < 40; s += 0.0717) {
    const double corner = path.next_corner(s - 2 * h);
    if (std::abs(corner - s) < 3 * h) continue;
    const PathPoint a = path.at(s - h), b = path.at(s + h), m = path.at(s);
    const Vector2 t = (b.p_I - a.p_I) / (2 * h);
    EXPECT_NEAR((t - Vector2(std::cos(m.heading), std::sin(m.heading))).norm(), 0,
                1e-4);
  }
  EXPECT_EQ(path.at(0).p_I.norm(), 0);
}

TEST_P(EveryPath, IsFollowedWithinCentimetres) {
  const Path path(GetParam());
  const UgvControllerConfig config;
  UgvController controller(config, path);
  UgvPose pose;
  UgvCommand last;
  const double dt = 0.01, wish = 0.5;
  double way = 0;
  for (int k = 0; k < 6000; ++k) {
    const UgvCommand c = controller.step(pose, wish, dt);
    EXPECT_LE(std::abs(c.v - last.v), config.acceleration_m_s2 * dt + 1e-12);
    EXPECT_LE(std::abs(c.w - last.w), config.yaw_acceleration_rad_s2 * dt + 1e-12);
    EXPECT_LE(c.v, wish + 1e-12);
    last = c;
    const double mid = pose.yaw + c.w * dt / 2;
    pose.p_I += c.v * dt * Vector2(std::cos(mid), std::sin(mid));
    pose.yaw += c.w * dt;
    way += c.v * dt;
    const double off = (path.at(controller.travelled()).p_I - pose.p_I).norm();
    EXPECT_LT(off, 0.08) << "at s = " << controller.travelled();
  }
  EXPECT_GT(way, 15);
}

TEST(UgvController, BrakesHarderThanItSpeedsUpAndNoFartherThanWished) {
  const Path path({.kind = PathKind::straight});
  const UgvControllerConfig config;
  UgvController controller(config, path);
  UgvPose pose;
  const double dt = 0.01;
  double v = 0;
  const auto seconds_to = [&](double wish) {
    for (int k = 1; k < 1000; ++k) {
      const double before = v;
      v = controller.step(pose, wish, dt).v;
      pose.p_I.x() += v * dt;
      EXPECT_LE(before - v, config.brake_m_s2 * dt + 1e-12);
      EXPECT_GE(v, std::min(before, wish) - 1e-12);
      if (std::abs(v - wish) < 1e-9) return k * dt;
    }
    return 1e9;
  };
  EXPECT_NEAR(seconds_to(0.9), 0.9 / config.acceleration_m_s2, 0.02);
  EXPECT_NEAR(seconds_to(0.3), 0.6 / config.brake_m_s2, 0.02);
  EXPECT_NEAR(seconds_to(0), 0.3 / config.brake_m_s2, 0.02);
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryPath,
                         testing::Values(PathConfig{.kind = PathKind::straight},
                                         PathConfig{.kind = PathKind::circle},
                                         PathConfig{.kind = PathKind::eight},
                                         PathConfig{.kind = PathKind::block},
                                         PathConfig{.kind = PathKind::block,
                                                    .corner_radius_m = 0}));

PlatformState circling(double t_s) {
  PlatformState state;
  state.v_IN_N = {0.9, 0, 0};
  state.w_IN_N = {0, 0, 0.6};
  return predict(state, t_s);
}

PlatformOdometry reading(double t_s, Rng& rng, double noise) {
  const PlatformState truth = circling(t_s);
  PlatformOdometry o;
  o.captured = from_seconds(t_s);
  o.received = from_seconds(t_s + 0.03);
  o.X_IN = truth.X_IN;
  o.v_IN_N = truth.v_IN_N + Vector3(rng.normal(0, noise), 0, 0);
  o.w_IN_N = truth.w_IN_N + Vector3(0, 0, rng.normal(0, noise));
  return o;
}

TEST(PlatformTracker, CarriesACircleForward) {
  Rng rng(1);
  PlatformTracker tracker;
  for (int k = 0; k <= 100; ++k) ASSERT_TRUE(tracker.add(reading(0.02 * k, rng, 0)));
  for (const double t : {1.95, 2.0, 2.03, 2.1, 2.3}) {
    const PlatformState x = tracker.at(from_seconds(t));
    EXPECT_TRUE(x.X_IN.isApprox(circling(t).X_IN, 1e-9)) << t;
    EXPECT_LT((x.a_IN_N - Vector3(0, 0.54, 0)).norm(), 1e-9) << t;
    EXPECT_EQ(x.t, from_seconds(t));
  }
}

/// Rolls about an axis 3 m below, as decks do.
PlatformState rolling(double t_s, double w) {
  const double roll = 0.14 * std::sin(w * t_s);
  return rolled(from_seconds(t_s), roll, 0.14 * w * std::cos(w * t_s), -w * w * roll,
                3);
}

// Both are fed forward, the rate times a tenth of a second: what trails behind is flown
// as an error.
TEST(PlatformTracker, AnImusForceAndItsRateDoNotTrailBehindADeckThatRolls) {
  for (const double w : {0.6, 1.05, 2.0}) {
    PlatformTracker tracker;
    double force = 0, force_off = 0, rate = 0, rate_off = 0;
    for (int k = 0; k < 4000; ++k) {
      const double t = 0.005 * k;
      const PlatformState truth = rolling(t, w);
      ASSERT_TRUE(tracker.add(imu_of(truth)));
      if (k % 4 == 0) {
        ASSERT_TRUE(tracker.add(odometry_of(truth)));
      }
      if (k < 1000) continue;
      const auto f_I = [](const PlatformState& x) -> Vector3 {
        return x.X_IN.linear() * (x.a_IN_N - gravity_N(x)) - Vector3(0, 0, kGravity);
      };
      const double ahead = t + 0.1, h = 0.01;
      const Vector3 f = f_I(rolling(ahead, w));
      const Vector3 df = (f_I(rolling(ahead + h, w)) - f) / h;
      const Vector3 g = f_I(tracker.at(from_seconds(ahead)));
      const Vector3 dg = (f_I(tracker.at(from_seconds(ahead + h))) - g) / h;
      force += f.squaredNorm();
      force_off += (g - f).squaredNorm();
      rate += df.squaredNorm();
      rate_off += (dg - df).squaredNorm();
    }
    // Of a tenth of a second times its own rate of change; that itself is smoothed.
    EXPECT_LT(std::sqrt(force_off / force), 0.3 * 0.1 * w) << w;
    EXPECT_LT(std::sqrt(rate_off / rate), 0.1 * w * w) << w;
  }
}

TEST(PlatformTracker, MayTakeTheLastOdometryForNow) {
  Rng rng(1);
  PlatformTrackerConfig config;
  config.carry_forward = false;
  PlatformTracker tracker(config);
  for (int k = 0; k <= 100; ++k) ASSERT_TRUE(tracker.add(reading(0.02 * k, rng, 0)));
  for (const double t : {2.0, 2.1, 2.9}) {
    const PlatformState x = tracker.at(from_seconds(t));
    EXPECT_TRUE(x.X_IN.isApprox(circling(2).X_IN, 1e-9)) << t;
    EXPECT_EQ(x.a_IN_N, Vector3::Zero());
    EXPECT_EQ(x.t, from_seconds(t));
  }
  EXPECT_EQ(tracker.resets(), 0u);
}

TEST(PlatformTracker, SmoothsWhatIsNoisy) {
  double square_v = 0, square_a = 0;
  int n = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    Rng rng(seed);
    PlatformTracker tracker;
    for (int k = 0; k <= 200; ++k) {
      ASSERT_TRUE(tracker.add(reading(0.02 * k, rng, 0.01)));
      if (k < 50) continue;
      const PlatformState x = tracker.at(from_seconds(0.02 * k + 0.05));
      square_v += (x.v_IN_N - Vector3(0.9, 0, 0)).squaredNorm();
      square_a += (x.a_IN_N - Vector3(0, 0.54, 0)).squaredNorm();
      ++n;
    }
  }
  EXPECT_LT(std::sqrt(square_v / n), 0.01);
  EXPECT_LT(std::sqrt(square_a / n), 0.1);
}

TEST(PlatformTracker, TakesAnAnnouncedJumpAndFindsASilentOne) {
  for (const bool announced : {true, false}) {
    Rng rng(2);
    PlatformTracker tracker;
    for (int k = 0; k <= 100; ++k) {
      PlatformOdometry o = reading(0.02 * k, rng, 0);
      if (k >= 60) {
        o.X_IN.translation().x() += 1;
        o.resets = announced ? 1 : 0;
      }
      ASSERT_TRUE(tracker.add(o));
      const PlatformState x = tracker.at(o.captured);
      EXPECT_TRUE(x.X_IN.isApprox(o.X_IN, 1e-9));
      EXPECT_LT((x.v_IN_N - Vector3(0.9, 0, 0)).norm(), 1e-9);  // never as motion
      EXPECT_EQ(tracker.resets(), k >= 60 ? 1u : 0u);
    }
  }
}

TEST(PlatformTracker, RefusesWhatIsOldOrBroken) {
  Rng rng(3);
  PlatformTracker tracker;
  EXPECT_FALSE(tracker.ready());
  EXPECT_TRUE(tracker.stale(0));
  EXPECT_TRUE(tracker.add(reading(1, rng, 0)));
  EXPECT_FALSE(tracker.add(reading(1, rng, 0)));
  EXPECT_FALSE(tracker.add(reading(0.98, rng, 0)));
  PlatformOdometry broken = reading(1.02, rng, 0);
  broken.v_IN_N.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(tracker.add(broken));
  EXPECT_FALSE(tracker.stale(from_seconds(1.2)));
  EXPECT_TRUE(tracker.stale(from_seconds(1.4)));
  EXPECT_DOUBLE_EQ(tracker.age(from_seconds(1.25)), 0.25);
}

// Vehicles drive on without odometry, but nobody knows for how long.
TEST(PlatformTracker, WhatDroveOnIsTakenToDriveOnForAWhile) {
  PlatformTracker tracker;
  PlatformOdometry odometry;
  odometry.v_IN_N.x() = 0.9;
  odometry.w_IN_N.z() = 0.6;
  for (int i = 0; i <= 50; ++i) {
    odometry.captured = from_seconds(0.02 * i);
    const double yaw = 0.6 * 0.02 * i, r = 1.5;
    odometry.X_IN = make_pose(from_rpy(0, 0, yaw),
                              Vector3(r * std::sin(yaw), r * (1 - std::cos(yaw)), 0));
    ASSERT_TRUE(tracker.add(odometry));
  }
  const PlatformState soon = tracker.at(from_seconds(1 + 1.9));
  EXPECT_NEAR(soon.v_IN_N.x(), 0.9, 1e-3);
  EXPECT_NEAR(soon.w_IN_N.z(), 0.6, 1e-3);
  const double yaw = 0.6 * 2.9;
  EXPECT_NEAR(soon.X_IN.translation().x(), 1.5 * std::sin(yaw), 0.02);
  EXPECT_NEAR(soon.X_IN.translation().y(), 1.5 * (1 - std::cos(yaw)), 0.02);
  // Without a jump it comes to rest.
  PlatformState before = soon;
  for (Seconds t = 2.9; t < 20; t += 0.01) {
    const PlatformState now = tracker.at(from_seconds(t));
    EXPECT_LE(now.v_IN_N.x(), before.v_IN_N.x() + 1e-9);
    EXPECT_LT((now.v_IN_N - before.v_IN_N).norm(), 0.01);
    EXPECT_LT((now.X_IN.translation() - before.X_IN.translation()).norm(), 0.0095);
    before = now;
  }
  EXPECT_LT(before.v_IN_N.norm(), 1e-3);
  EXPECT_LT(before.w_IN_N.norm(), 1e-3);
}

TEST(PlatformTracker, NamesABadSetting) {
  PlatformTrackerConfig config;
  config.stale_after_s = -1;
  const auto refused = config.validate();
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().detail.find("stale_after_s is -1"), std::string::npos);
}

}  // namespace
}  // namespace alight
