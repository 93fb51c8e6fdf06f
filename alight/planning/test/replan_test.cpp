#include "alight/planning/replan.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

namespace alight {
namespace {

PlanRequest random_landing(unsigned seed) {
  Rng rng(seed);
  PlanRequest request;
  request.start = 5'000'000'000;
  request.from.p_NB = {rng.uniform(-1.5, -0.9), rng.uniform(-0.25, 0.25),
                       rng.uniform(0.5, 0.85)};
  request.from.v_NB = {rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), 0};
  request.from.yaw = rng.uniform(-0.3, 0.3);
  request.from.yaw_rate = rng.uniform(-0.1, 0.1);
  request.platform.v_IN_N = {rng.uniform(0, 1.5), 0, 0};
  request.platform.w_IN_N = {0, 0, rng.uniform(-0.6, 0.6)};
  request.platform.a_IN_N = request.platform.w_IN_N.cross(request.platform.v_IN_N);
  return request;
}

Planner make(double wish_px = 60) {
  PlannerConfig config;
  config.time_samples = 9;
  config.view_wish_px = wish_px;
  return *Planner::create(config, alan_rig());
}

double cost_of(const Trajectory& trajectory, Seconds from) {
  // Integral of the squared jerk from `from` on, by midpoints.
  const int steps = 4000;
  const Seconds dt = (trajectory.duration() - from) / steps;
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    sum += trajectory.at(from + (i + 0.5) * dt).j_NB.squaredNorm() * dt;
  }
  return sum;
}

class ReplanProperty : public testing::TestWithParam<unsigned> {};

TEST_P(ReplanProperty, CarriesTheLandingOnWithoutAJumpUpToTheThirdDerivative) {
  const Planner planner = make();
  const PlanRequest request = random_landing(GetParam());
  const PlanResult current = planner.plan(request);
  ASSERT_TRUE(current.ok()) << current.reason;
  for (const bool sweep : {false, true}) {
    for (const double share : {0.05, 0.3, 0.55, 0.7, 0.85}) {
      const Seconds gone = share * current.trajectory.duration();
      const Replan replan{.in_force = request.start + from_seconds(gone),
                          .platform = predict(request.platform, gone),
                          .sweep = sweep};
      const auto wanted = replan_request(current, replan);
      ASSERT_TRUE(wanted);
      const PlanResult fresh = planner.plan(*wanted);
      EXPECT_TRUE(fresh.ok()) << share << ' ' << sweep << ": " << fresh.reason;
      if (!fresh.ok()) continue;
      const FlatState a =
          current.trajectory.at(to_seconds(fresh.start - current.start));
      const FlatState b = fresh.trajectory.at(0);
      EXPECT_LT((a.p_NB - b.p_NB).norm(), 1e-9);
      EXPECT_LT((a.v_NB - b.v_NB).norm(), 1e-9);
      EXPECT_LT((a.a_NB - b.a_NB).norm(), 1e-8);
      EXPECT_LT((a.j_NB - b.j_NB).norm(), 1e-5);
      EXPECT_NEAR(wrap_angle(a.yaw - b.yaw), 0, 1e-9);
      EXPECT_NEAR(a.yaw_rate, b.yaw_rate, 1e-9);
      EXPECT_NEAR(a.yaw_acceleration, b.yaw_acceleration, 1e-8);
      // Near the end durations sampled anew may make a detour.
      const Seconds left = current.trajectory.duration() - gone;
      const bool detour = fresh.trajectory.duration() > 1.5 * left;
      EXPECT_FALSE(detour && !sweep);
      EXPECT_EQ(takes_over(current, fresh, fresh.start - 1), !detour);
      // And of a kind that can be carried on again.
      EXPECT_TRUE(replan_request(fresh, {.in_force = fresh.start + 1}));
    }
  }
}

TEST_P(ReplanProperty, WhatIsLeftIsAtMostAsCostlyAsBefore) {
  const Planner planner = make(0);
  const PlanRequest request = random_landing(GetParam());
  const PlanResult current = planner.plan(request);
  ASSERT_TRUE(current.ok());
  const Seconds gone = 0.4 * current.trajectory.durations[0];
  const auto wanted =
      replan_request(current, {.in_force = request.start + from_seconds(gone),
                               .platform = predict(request.platform, gone)});
  ASSERT_TRUE(wanted);
  const PlanResult fresh = planner.plan(*wanted);
  ASSERT_TRUE(fresh.ok()) << fresh.reason;
  EXPECT_EQ(fresh.tried, 1);
  const double before = cost_of(current.trajectory, gone);
  EXPECT_LE(fresh.jerk_cost, before * (1 + 1e-4) + 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Seeds, ReplanProperty, testing::Range(0u, 12u));

TEST(Replan, LateInfeasibleOrTornItChangesNothing) {
  const Planner planner = make();
  const PlanRequest request = random_landing(1);
  const PlanResult current = planner.plan(request);
  ASSERT_TRUE(current.ok());
  const Time in_force = request.start + from_seconds(0.5);
  Replan replan{.in_force = in_force, .platform = predict(request.platform, 0.5)};
  const PlanResult fresh = planner.plan(*replan_request(current, replan));
  ASSERT_TRUE(fresh.ok());
  EXPECT_TRUE(takes_over(current, fresh, in_force));
  EXPECT_FALSE(takes_over(current, fresh, in_force + 1));  // late

  PlanResult bad = fresh;
  bad.status = PlanStatus::infeasible;
  EXPECT_FALSE(takes_over(current, bad, in_force - 1));
  bad = fresh;
  bad.trajectory.c[0][3].x() += 1e-4;  // A jump of the jerk alone.
  EXPECT_FALSE(takes_over(current, bad, in_force - 1));
  bad = fresh;
  bad.start += 1'000'000;
  EXPECT_FALSE(takes_over(current, bad, in_force - 1));
  bad = fresh;
  bad.trajectory.yaw_rate_start += 0.01;
  EXPECT_FALSE(takes_over(current, bad, in_force - 1));

  EXPECT_EQ(replanned(planner, current, replan, in_force).start, in_force);
  EXPECT_EQ(replanned(planner, current, replan, in_force + 1).start, current.start);
  replan.platform.v_IN_N.x() = 20;  // No drone keeps up.
  EXPECT_EQ(replanned(planner, current, replan, in_force).start, current.start);
}

TEST(Replan, ADetourIsNotTaken) {
  const Planner planner = make();
  int detours = 0;
  for (unsigned seed = 1; seed < 6; ++seed) {
    const PlanRequest request = random_landing(seed);
    const PlanResult current = planner.plan(request);
    if (!current.ok()) continue;
    const Time in_force = request.start + from_seconds(0.4);
    const Replan replan{.in_force = in_force,
                        .platform = predict(request.platform, 0.4)};
    auto longer = replan_request(current, replan);
    ASSERT_TRUE(longer);
    const Seconds left = current.trajectory.duration() - 0.4;
    longer->durations = {left, left};
    const PlanResult fresh = planner.plan(*longer);
    if (!fresh.ok()) continue;
    ++detours;
    EXPECT_FALSE(takes_over(current, fresh, in_force - 1)) << seed;
  }
  EXPECT_GT(detours, 0);
}

TEST(Replan, NothingToCarryOn) {
  const Planner planner = make();
  const PlanRequest request = random_landing(2);
  const PlanResult current = planner.plan(request);
  ASSERT_TRUE(current.ok());
  const auto at = [&](Seconds t) {
    return replan_request(current, {.in_force = request.start + from_seconds(t)});
  };
  EXPECT_FALSE(at(-0.01));
  EXPECT_FALSE(at(current.trajectory.duration() - 0.2));
  EXPECT_FALSE(at(current.trajectory.duration() + 1));
  EXPECT_TRUE(at(current.trajectory.duration() - 0.4));
  PlanResult none = current;
  none.status = PlanStatus::infeasible;
  EXPECT_FALSE(replan_request(none, {.in_force = request.start}));
}

}  // namespace
}  // namespace alight
