#include <gtest/gtest.h>

#include "alight/base/rng.h"
#include "alight/planning/certificate.h"
#include "alight/planning/planner.h"

namespace alight {
namespace {

PlanRequest random_landing(unsigned seed) {
  Rng rng(seed);
  PlanRequest request;
  request.from.p_NB = {rng.uniform(-1.5, -0.9), rng.uniform(-0.25, 0.25),
                       rng.uniform(0.5, 0.85)};
  request.platform.v_IN_N = {rng.uniform(0, 1.5), 0, 0};
  request.platform.w_IN_N = {0, 0, rng.uniform(-0.6, 0.6)};
  request.platform.a_IN_N = request.platform.w_IN_N.cross(request.platform.v_IN_N);
  return request;
}

Planner make() {
  PlannerConfig config;
  config.time_samples = 9;
  return *Planner::create(config, alan_rig());
}

class EscapeProperty : public testing::TestWithParam<unsigned> {};

TEST_P(EscapeProperty, LeadsFromTheLandingBackToRestInTheRearSpace) {
  const Planner planner = make();
  const PlanRequest request = random_landing(GetParam());
  const PlanResult plan = planner.plan(request);
  ASSERT_TRUE(plan.ok()) << plan.reason;
  const Escape& escape = plan.escape;
  ASSERT_TRUE(escape.exists);
  EXPECT_GE(escape.margin, -1e-6);
  // The commit height: over the pad, and lower than where the touch-down space begins.
  const double gear = alan_rig().drone.gear_height_m;
  EXPECT_GT(escape.height_m, gear + planner.config().escape_clearance_m);
  EXPECT_LT(escape.height_m, planner.config().touch_down_height_m);
  const FlatState left = plan.trajectory.at(escape.from);
  EXPECT_DOUBLE_EQ(left.p_NB.z(), escape.height_m);
  const FlatState begin = escape.trajectory.at(0);
  EXPECT_LT((left.p_NB - begin.p_NB).norm() + (left.v_NB - begin.v_NB).norm() +
                (left.a_NB - begin.a_NB).norm(),
            1e-7);
  const FlatState end = escape.trajectory.at(escape.trajectory.duration());
  EXPECT_LT((end.p_NB - request.from.p_NB).norm(), 1e-9);
  EXPECT_LT(end.v_NB.norm() + end.a_NB.norm(), 1e-7);
  // Nowhere does it come nearer to the pad than its clearance, nor past a limit in I.
  const Rig rig = alan_rig();
  for (int i = 0; i <= 2000; ++i) {
    const Seconds t = escape.trajectory.duration() * i / 2000;
    const FlatState x = escape.trajectory.at(t);
    const PlatformState platform = predict(request.platform, escape.from + t);
    EXPECT_GE(x.p_NB.z(), gear + planner.config().escape_clearance_m - 1e-6);
    EXPECT_LE(inertial_velocity_N(platform, x.p_NB, x.v_NB).norm(),
              rig.limits.speed_m_s + 1e-6);
    const Vector3 a = inertial_acceleration_N(platform, x.p_NB, x.v_NB, x.a_NB);
    EXPECT_LE(a.norm(), rig.limits.acceleration_m_s2 + 1e-6);
    const Pose X_NB = make_pose(flat_attitude(platform, x), x.p_NB);
    for (const Led& led : rig.leds.leds) {
      const auto uv = project_led(rig.camera, X_NB, led.p_BL);
      ASSERT_TRUE(uv);
      EXPECT_TRUE(rig.camera.intrinsics.contains(*uv, 0));
    }
  }
}

// From any state up to the commit height: at once, not only by going on to there.
TEST_P(EscapeProperty, ExistsAllTheWayDownToTheCommitHeight) {
  const Planner planner = make();
  PlanRequest request = random_landing(GetParam());
  const PlanResult plan = planner.plan(request);
  ASSERT_TRUE(plan.ok() && plan.escape.exists);
  for (const double share : {0.0, 0.3, 0.6, 0.8, 0.9, 0.97}) {
    const Seconds t = share * plan.escape.from;
    PlanRequest now = request;
    now.from = plan.trajectory.at(t);
    now.platform = predict(request.platform, t);
    now.has_return = true;
    now.return_to = request.from.p_NB;
    const Escape escape = planner.escape(now);
    EXPECT_TRUE(escape.exists) << share;
    EXPECT_GE(escape.margin, -1e-6);
  }
  // On the pad there is none.
  PlanRequest down = request;
  down.from = plan.trajectory.at(plan.trajectory.duration());
  EXPECT_FALSE(planner.escape(down).exists);
}

INSTANTIATE_TEST_SUITE_P(Seeds, EscapeProperty, testing::Range(0u, 10u));

TEST(Escape, AFasterSinkCommitsHigher) {
  PlannerConfig config;
  config.time_samples = 9;
  double last = 0;
  for (const double sink : {0.1, 0.25, 0.5}) {
    config.touch_down_speed_m_s = sink;
    const PlanResult plan =
        Planner::create(config, alan_rig())->plan(random_landing(3));
    ASSERT_TRUE(plan.ok() && plan.escape.exists) << sink;
    EXPECT_GT(plan.escape.height_m, last) << sink;
    last = plan.escape.height_m;
  }
}

TEST(Escape, ThePaperHasNone) {
  const auto planner = Planner::create(PlannerConfig::paper(), alan_rig());
  const PlanRequest request = random_landing(4);
  const PlanResult plan = planner->plan(request);
  ASSERT_TRUE(plan.ok()) << plan.reason;
  EXPECT_FALSE(plan.escape.exists);
  EXPECT_FALSE(planner->escape(request).exists);
}

// A rail beside the pad and a mast in front of it.
TEST(Obstacles, AreKeptClearOfByTheRadiusOnTheWayDownAndBack) {
  Rig rig = alan_rig();
  rig.pad.obstacles = {{{-0.3, 0.25, 0}, {0.3, 0.27, 0.3}},
                       {{0.25, -0.3, 0}, {0.28, -0.27, 0.5}}};
  PlannerConfig config;
  config.time_samples = 9;
  const auto planner = Planner::create(config, rig);
  ASSERT_TRUE(planner);
  const double radius = drone_radius(rig);
  int solved = 0;
  for (unsigned seed = 0; seed < 8; ++seed) {
    const PlanResult plan = planner->plan(random_landing(seed));
    if (!plan.ok()) continue;
    ++solved;
    const auto clear = [&](const Trajectory& trajectory) {
      for (int i = 0; i <= 1000; ++i) {
        const Vector3 p = trajectory.at(trajectory.duration() * i / 1000).p_NB;
        for (const Obstacle& box : rig.pad.obstacles) {
          const Vector3 q = p.cwiseMax(box.min_m).cwiseMin(box.max_m);
          EXPECT_GE((p - q).norm(), radius - 1e-6) << seed;
        }
      }
    };
    clear(plan.trajectory);
    if (plan.escape.exists) clear(plan.escape.trajectory);
  }
  EXPECT_GE(solved, 6);
}

}  // namespace
}  // namespace alight
