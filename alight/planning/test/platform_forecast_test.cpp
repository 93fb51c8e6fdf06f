#include "alight/planning/platform_forecast.h"

#include <gtest/gtest.h>

#include "alight/planning/planner.h"

namespace alight {
namespace {

/// A deck that rolls, pitches and heaves while it turns; all derivatives by differences
/// of its pose.
Pose deck_pose(Seconds t) {
  return make_pose(
      from_rpy(0.10 * std::sin(1.05 * t), 0.05 * std::sin(0.9 * t + 1), 0.2 * t),
      Vector3(1.2 * t, 0.1 * t * t, 0.4 * std::sin(1.05 * t + 0.5)));
}

PlatformState deck(Seconds t) {
  const double h = 1e-4;
  PlatformState state;
  state.t = from_seconds(t);
  state.X_IN = deck_pose(t);
  const Matrix3 R_NI = state.X_IN.linear().transpose();
  const Vector3 before = deck_pose(t - h).translation();
  const Vector3 here = deck_pose(t).translation();
  const Vector3 after = deck_pose(t + h).translation();
  state.v_IN_N = R_NI * (after - before) / (2 * h);
  state.a_IN_N = R_NI * (after - 2 * here + before) / (h * h);
  const auto rate = [&](Seconds s) -> Vector3 {
    return so3_log(deck_pose(s - h).linear().transpose() * deck_pose(s + h).linear()) /
           (2 * h);
  };
  state.w_IN_N = rate(t);
  state.alpha_IN_N = (rate(t + 10 * h) - rate(t - 10 * h)) / (20 * h);
  return state;
}

PlatformForecast deck_forecast() {
  PlatformForecast forecast;
  for (std::size_t i = 0; i < PlatformForecast::kNodes; ++i) {
    forecast.add(deck(static_cast<double>(i) * forecast.step));
  }
  return forecast;
}

TEST(PlatformForecast, FollowsADeckInBetweenItsNodes) {
  const PlatformForecast forecast = deck_forecast();
  for (double t = 0.05; t < 7.9; t += 0.171) {
    const PlatformState there = deck(t);
    const FrameMotion m = frame_motion({}, forecast, t);
    EXPECT_LT((m.v0 - there.v_IN_N).norm(), 2e-3) << t;
    EXPECT_LT((m.a0 - there.a_IN_N).norm(), 2e-2) << t;
    EXPECT_LT((m.a0 - m.f0 - gravity_N(there)).norm(), 2e-3) << t;
    EXPECT_LT((m.w - hat(there.w_IN_N)).norm(), 1e-3) << t;
  }
}

TEST(PlatformForecast, AConstantAccelerationIsExact) {
  PlatformState state;
  state.v_IN_N = {0.8, 0, 0};
  state.w_IN_N = {0, 0, 0.4};
  state.a_IN_N = state.w_IN_N.cross(state.v_IN_N) + Vector3(0.3, 0, 0);
  state.alpha_IN_N = {0, 0, -0.2};
  const PlatformForecast forecast = constant_acceleration(state, 16);
  for (double t = 0; t < 15; t += 0.37) {
    const FrameMotion m = frame_motion(state, forecast, t);
    const Vector3 v(0.8 + 0.3 * t, 0, 0);
    const Vector3 w(0, 0, 0.4 - 0.2 * t);
    EXPECT_LT((m.v0 - v).norm(), 1e-9);
    EXPECT_LT((m.w - hat(w)).norm(), 1e-9);
    EXPECT_LT((m.a0 - (Vector3(0.3, 0, 0) + w.cross(v))).norm(), 1e-9);
    const Vector3 p(0.3, -0.2, 0.5);
    const Vector3 a = m.acceleration(p, Vector3::Zero(), Vector3::Zero());
    EXPECT_LT((a - (m.a0 + w.cross(w.cross(p)) + state.alpha_IN_N.cross(p))).norm(),
              1e-9);
  }
}

TEST(PlatformForecast, StaysAsItWasPastItsLastNode) {
  PlatformForecast forecast;
  PlatformState state;
  state.v_IN_N = {1, 0, 0};
  forecast.add(state);
  const FrameMotion m = frame_motion({}, forecast, 100);
  EXPECT_LT((m.v0 - state.v_IN_N).norm(), 1e-12);
  EXPECT_LT(m.a0.norm(), 1e-12);
}

// Limits hold over the deck itself, not over what the cubics make of it: positions in I
// at 1 kHz, differentiated there.
TEST(PlatformForecast, WhatIsCertifiedOverADeckHoldsInI) {
  Rig rig = alan_rig();
  rig.limits.acceleration_m_s2 = 3;  // so that it matters
  PlannerConfig config;
  config.time_samples = 7;
  const auto planner = Planner::create(config, rig);
  ASSERT_TRUE(planner);
  int solved = 0;
  for (int k = 0; k < 12; ++k) {
    const Seconds begin = 0.25 * k;
    PlanRequest request;
    request.from.p_NB = {-1.2, 0.05 * (k % 3), 0.7};
    request.platform = deck(begin);
    request.forecast = deck_forecast();
    request.forecast.begin = begin;
    const PlanResult plan = planner->plan(request);
    if (!plan.ok()) continue;
    ++solved;
    const Seconds dt = 1e-3;
    const auto p_IB = [&](Seconds t) -> Vector3 {
      return deck_pose(begin + t) * plan.trajectory.at(t).p_NB;
    };
    const auto steps = static_cast<int>(plan.trajectory.duration() / dt);
    for (int i = 1; i < steps; ++i) {
      const Seconds t = i * dt;
      const Vector3 before = p_IB(t - dt);
      const Vector3 now = p_IB(t);
      const Vector3 after = p_IB(t + dt);
      ASSERT_LE(((after - before) / (2 * dt)).norm(), rig.limits.speed_m_s + 1e-3);
      const Vector3 a = (after - 2 * now + before) / (dt * dt);
      ASSERT_LE(a.norm(), rig.limits.acceleration_m_s2 + 2e-2);
      const Vector3 f =
          deck_pose(begin + t).linear().transpose() * (a + Vector3(0, 0, kGravity));
      ASSERT_LE(std::atan2(f.head<2>().norm(), f.z()),
                (config.tilt_max_deg + 0.2) * kDegree);
    }
  }
  EXPECT_GE(solved, 6);
}

}  // namespace
}  // namespace alight
