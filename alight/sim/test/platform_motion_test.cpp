#include "alight/sim/platform_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "alight/sim/test/fly.h"

namespace alight {
namespace {

constexpr double kDt = 0.002;

PlatformScenario drive(PlatformKind kind) {
  PlatformScenario config;
  config.kind = kind;
  config.side_m = 4;
  config.sea = {.heave_m = 0.5, .roll_deg = 8, .pitch_deg = 3, .period_s = 6};
  return config;
}

std::vector<PlatformState> states(PlatformMotion motion, double seconds) {
  std::vector<PlatformState> all{motion.state()};
  while (to_seconds(all.back().t) < seconds) {
    motion.step(kDt);
    all.push_back(motion.state());
  }
  return all;
}

class Motions : public testing::TestWithParam<std::tuple<PlatformKind, unsigned>> {};

TEST_P(Motions, SpeedsAreDerivativesOfPoses) {
  const auto [kind, seed] = GetParam();
  const auto all = states(PlatformMotion(drive(kind), 0.26, true, Rng(seed)), 40);
  double worst_v = 0, worst_w = 0, worst_a = 0, worst_alpha = 0;
  for (std::size_t i = 1; i + 1 < all.size(); ++i) {
    const PlatformState &a = all[i - 1], &m = all[i], &b = all[i + 1];
    const Matrix3 R_NI = m.X_IN.linear().transpose();
    const Vector3 v = (b.X_IN.translation() - a.X_IN.translation()) / (2 * kDt);
    const Vector3 w =
        so3_log(a.X_IN.linear().transpose() * b.X_IN.linear()) / (2 * kDt);
    const Vector3 dv = (b.X_IN.linear() * b.v_IN_N - a.X_IN.linear() * a.v_IN_N);
    const Vector3 dw = (b.X_IN.linear() * b.w_IN_N - a.X_IN.linear() * a.w_IN_N);
    worst_v = std::max(worst_v, (R_NI * v - m.v_IN_N).norm());
    worst_w = std::max(worst_w, (w - m.w_IN_N).norm());
    worst_a = std::max(worst_a, (R_NI * dv / (2 * kDt) - m.a_IN_N).norm());
    worst_alpha = std::max(worst_alpha, (R_NI * dw / (2 * kDt) - m.alpha_IN_N).norm());
  }
  // A vehicle's ramps have corners, of half its acceleration over a step.
  EXPECT_LT(worst_v, 2e-3);
  EXPECT_LT(worst_w, 8e-3);
  EXPECT_LT(worst_a, kind == PlatformKind::boat ? 0.31 : 1.0);
  EXPECT_LT(worst_alpha, kind == PlatformKind::boat ? 1e-3 : 3.1);
}

TEST_P(Motions, TheRigidBodyFollowsThePose) {
  const auto [kind, seed] = GetParam();
  Scenario scenario = fly::calm(kind);
  scenario.platform = drive(kind);
  const auto world = fly::make(scenario, seed);
  ASSERT_NE(world, nullptr);
  const Vector3 before = world->truth().X_NB.translation();
  for (double t = 0; t < 12; t += 1) {
    world->advance_to(from_seconds(t));
    EXPECT_TRUE(world->standing_on_pad() || t == 0) << t;
    EXPECT_LT((world->truth().X_NB.translation() - before).norm(), 5e-3) << t;
  }
  EXPECT_FALSE(world->contact().struck);
}
INSTANTIATE_TEST_SUITE_P(
    Kinds, Motions,
    testing::Combine(testing::Values(PlatformKind::straight, PlatformKind::circle,
                                     PlatformKind::block, PlatformKind::eight,
                                     PlatformKind::boat),
                     testing::Range(0u, 3u)));

TEST(PlatformMotion, TheBoatsPadSwaysOnItsLever) {
  // Rolled by r, a pad 3 m up is 3 sin r to the side.
  PlatformScenario config = drive(PlatformKind::boat);
  config.speed_m_s = 0;
  config.sea.pad_aft_m = 0;
  config.sea.pitch_deg = 0;
  for (const PlatformState& s :
       states(PlatformMotion(config, 0.26, true, Rng(4)), 30)) {
    const Vector3 p = s.X_IN.translation();
    const Matrix3& R = s.X_IN.linear();
    EXPECT_NEAR(p.y(), -3 * R(2, 1), 1e-9);
    EXPECT_NEAR(p.x(), 0, 1e-9);
  }
}

TEST(PlatformMotion, ABlocksCornersCanBeTurnedInPlace) {
  PlatformScenario config = drive(PlatformKind::block);
  config.speed_m_s = 0.5;
  config.corner_radius_m = 0;
  config.yaw_rate_max_deg_s = 30;
  double fastest = 0, turned_standing = 0;
  for (const PlatformState& s :
       states(PlatformMotion(config, 0.26, true, Rng(1)), 60)) {
    fastest = std::max(fastest, std::abs(s.w_IN_N.z()));
    if (std::abs(s.v_IN_N.x()) < 1e-6) turned_standing += s.w_IN_N.z() * kDt;
  }
  EXPECT_NEAR(fastest, 30 * kDegree, 1e-6);
  EXPECT_GT(turned_standing, 3 * 85 * kDegree);
}

TEST(PlatformMotion, TheEightTurnsBothWays) {
  double left = 0, right = 0;
  for (const PlatformState& s :
       states(PlatformMotion(drive(PlatformKind::eight), 0.26, true, Rng(1)), 30)) {
    left = std::max(left, s.w_IN_N.z());
    right = std::min(right, s.w_IN_N.z());
  }
  // At the change-over the controller overshoots, up to the vehicle's own limit.
  EXPECT_GT(left, 0.9 / 1.5 - 0.05);
  EXPECT_LT(right, -0.9 / 1.5 + 0.05);
  EXPECT_LE(std::max(left, -right), 60.01 * kDegree);
}

TEST(PlatformMotion, AMutinyIsCarriedOutAndEndsSmoothly) {
  PlatformMotion motion(drive(PlatformKind::circle), 0.26, true, Rng(1));
  const auto run = [&](double seconds, const PadMutiny& mutiny) {
    for (double t = 0; t < seconds; t += kDt) {
      const double v = motion.state().v_IN_N.x(), w = motion.state().w_IN_N.z();
      motion.step(kDt, mutiny);
      EXPECT_LE(std::abs(motion.state().v_IN_N.x() - v), 3.001 * kDt);
      EXPECT_LE(std::abs(motion.state().w_IN_N.z() - w), 10.001 * kDt);
    }
    return motion.state();
  };
  run(5, {});
  EXPECT_NEAR(run(1, {.speed_m_s = 0, .turn_rad_s = 0}).v_IN_N.norm(), 0, 1e-9);
  EXPECT_NEAR(run(2, {.speed_m_s = 2, .turn_rad_s = {}}).v_IN_N.x(), 2, 1e-9);
  EXPECT_NEAR(run(1, {.speed_m_s = {}, .turn_rad_s = -1.0}).w_IN_N.z(), -1, 1e-9);
  // Afterwards it finds back to its own speed and path.
  EXPECT_NEAR(run(20, {}).v_IN_N.x(), 0.9, 0.01);
  EXPECT_NEAR(motion.state().w_IN_N.z(), 0.9 / 1.5, 0.05);
}

TEST(PlatformMotion, WhatItIsWishedInAMutinyItDoesAfterIt) {
  for (const double wish : {0.0, 0.9}) {
    PlatformMotion m(drive(PlatformKind::circle), 0.26, true, Rng(1));
    const auto run = [&](double seconds, const PadMutiny& mutiny) {
      double fastest = 0;
      for (int i = 0; i < static_cast<int>(std::lround(seconds / kDt)); ++i) {
        m.step(kDt, mutiny);
        fastest = std::max(fastest, m.state().v_IN_N.norm());
      }
      return fastest;
    };
    run(4, {});
    EXPECT_NEAR(m.state().v_IN_N.norm(), 0.9, 1e-6);
    run(0.4, {.speed_m_s = 0, .turn_rad_s = {}});
    m.wish_speed(wish);
    run(1.6, {.speed_m_s = 0, .turn_rad_s = {}});
    const double after = run(1, {});
    EXPECT_NEAR(after, wish, 1e-6);
  }
}

TEST(PlatformMotion, BrakesAsItsScenarioSaysWhenItIsWishedSlower) {
  for (const double brake : {0.6, 1.0, 4.0}) {
    PlatformScenario config = drive(PlatformKind::circle);
    config.brake_m_s2 = brake;
    PlatformMotion m(config, 0.26, true, Rng(1));
    for (int i = 0; i < static_cast<int>(std::lround(4 / kDt)); ++i) m.step(kDt, {});
    m.wish_speed(0);
    double most = 0, before = m.state().v_IN_N.norm();
    while (before > 1e-9) {
      m.step(kDt, {});
      most = std::max(most, (before - m.state().v_IN_N.norm()) / kDt);
      before = m.state().v_IN_N.norm();
    }
    EXPECT_NEAR(most, brake, 1e-6);
  }
}

TEST(PlatformMotion, WithoutAMutinyNothingChanges) {
  PlatformMotion a(drive(PlatformKind::block), 0.26, true, Rng(1)), b = a;
  for (int k = 0; k < 5000; ++k) {
    a.step(kDt);
    b.step(kDt, PadMutiny{});
    ASSERT_EQ(a.state().X_IN.matrix(), b.state().X_IN.matrix());
  }
}

TEST(Boat, NeedsAPadAboveTheWater) {
  Scenario scenario;
  scenario.platform = drive(PlatformKind::boat);
  EXPECT_TRUE(scenario.validate());
  scenario.platform.sea.pad_above_m = 1;
  const auto low = scenario.validate();
  ASSERT_FALSE(low);
  EXPECT_NE(low.error().detail.find("platform.sea.heave_m is 0.5"), std::string::npos);
  scenario.platform.sea.pad_above_m = 3;
  scenario.start.place = StartPlace::floor;
  EXPECT_FALSE(scenario.validate());
}

}  // namespace
}  // namespace alight
