#include "alight/planning/planner.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "alight/base/rng.h"
#include "alight/planning/certificate.h"

namespace alight {
namespace {

PlatformState driving(double speed, double yaw_rate) {
  PlatformState platform;
  platform.X_IN = make_pose(from_rpy(0, 0, 0.7), Vector3(3, -2, 0.26));
  platform.v_IN_N = {speed, 0, 0};
  platform.w_IN_N = {0, 0, yaw_rate};
  platform.a_IN_N = platform.w_IN_N.cross(platform.v_IN_N);
  return platform;
}

PlanRequest random_request(unsigned seed) {
  Rng rng(seed);
  PlanRequest request;
  request.from.p_NB = {rng.uniform(-1.6, -0.9), rng.uniform(-0.3, 0.3),
                       rng.uniform(0.45, 0.9)};
  request.from.v_NB = {rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2),
                       rng.uniform(-0.2, 0.2)};
  request.from.a_NB = {rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3),
                       rng.uniform(-0.3, 0.3)};
  request.from.yaw = rng.uniform(-0.1, 0.1);
  const int kind = static_cast<int>(seed % 3);
  request.platform = kind == 0   ? driving(0, 0)
                     : kind == 1 ? driving(0.9, 0.6)
                                 : driving(2, 0);
  return request;
}

Planner make(PlannerConfig config = {}, int samples = 9) {
  config.time_samples = samples;
  auto planner = Planner::create(config, alan_rig());
  EXPECT_TRUE(planner);
  return *planner;
}

void expect_same_bits(const PlanResult& a, const PlanResult& b) {
  EXPECT_EQ(a.status, b.status);
  EXPECT_STREQ(a.reason, b.reason);
  EXPECT_EQ(a.trajectory.durations, b.trajectory.durations);
  for (std::size_t s = 0; s < kSegments; ++s) {
    for (std::size_t i = 0; i < kControlPoints; ++i) {
      EXPECT_EQ(std::memcmp(a.trajectory.c[s][i].data(), b.trajectory.c[s][i].data(),
                            sizeof(Vector3)),
                0);
    }
  }
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a.feasible, b.feasible);
  ASSERT_EQ(a.certificate.size(), b.certificate.size());
  for (std::size_t i = 0; i < a.certificate.size(); ++i) {
    EXPECT_EQ(a.certificate[i].margin, b.certificate[i].margin);
  }
}

class PlannerProperty : public testing::TestWithParam<unsigned> {};

// The certificate's promise, tried where it counts: positions in I at 1 kHz,
// differentiated there.
TEST_P(PlannerProperty, WhatIsCertifiedHoldsInI) {
  const PlanRequest request = random_request(GetParam());
  const Rig rig = alan_rig();
  const PlanResult result = make().plan(request);
  ASSERT_TRUE(result.ok()) << result.reason;
  const Seconds dt = 1e-3;
  const auto p_IB = [&](Seconds t) {
    return predict(request.platform, t).X_IN * result.trajectory.at(t).p_NB;
  };
  const auto steps = static_cast<int>(result.trajectory.duration() / dt);
  for (int i = 1; i < steps; ++i) {
    const Seconds t = i * dt;
    const Vector3 before = p_IB(t - dt);
    const Vector3 now = p_IB(t);
    const Vector3 after = p_IB(t + dt);
    EXPECT_LE(((after - before) / (2 * dt)).norm(), rig.limits.speed_m_s + 1e-5);
    const Vector3 a_IB = (after - 2 * now + before) / (dt * dt);
    EXPECT_LE(a_IB.norm(), rig.limits.acceleration_m_s2 + 1e-3);
    const PlatformState platform = predict(request.platform, t);
    const Vector3 f_N =
        platform.X_IN.linear().transpose() * (a_IB + Vector3(0, 0, kGravity));
    EXPECT_LE(std::atan2(f_N.head<2>().norm(), f_N.z()), 15.01 * kDegree);
    // And the LEDs are seen.
    const FlatState state = result.trajectory.at(t);
    const Pose X_NB = make_pose(flat_attitude(platform, state), state.p_NB);
    for (const Led& led : rig.leds.leds) {
      const auto uv = project_led(rig.camera, X_NB, led.p_BL);
      ASSERT_TRUE(uv);
      EXPECT_TRUE(rig.camera.intrinsics.contains(*uv, 12));
    }
  }
}

TEST_P(PlannerProperty, SameRequestSameBitsAlsoWhenExplained) {
  const PlanRequest request = random_request(GetParam());
  const Planner planner = make();
  const PlanResult once = planner.plan(request);
  expect_same_bits(once, planner.plan(request));
  const auto details = planner.explain(request);
  ASSERT_TRUE(details);
  expect_same_bits(once, details->result);
}

TEST_P(PlannerProperty, DoesNotCareWhenOrWhereInTheWorldItIs) {
  PlanRequest request = random_request(GetParam());
  const Planner planner = make();
  const PlanResult here = planner.plan(request);
  request.start += 1234567890123;
  request.platform.t += 1234567890123;
  PlanResult later = planner.plan(request);
  EXPECT_EQ(later.start, request.start);
  expect_same_bits(here, later);
  request.platform.X_IN =
      make_pose(from_rpy(0, 0, 1.9), {7, 8, 0}) * request.platform.X_IN;
  const PlanResult turned = planner.plan(request);
  ASSERT_EQ(turned.ok(), here.ok());
  EXPECT_EQ(turned.trajectory.durations, here.trajectory.durations);
  for (std::size_t s = 0; s < kSegments; ++s) {
    for (std::size_t i = 0; i < kControlPoints; ++i) {
      EXPECT_LT((turned.trajectory.c[s][i] - here.trajectory.c[s][i]).norm(), 1e-7);
    }
  }
}

TEST_P(PlannerProperty, BroughtForwardAlongItsPlanItStillFindsOne) {
  PlanRequest request = random_request(GetParam());
  const Planner planner = make();
  const PlanResult first = planner.plan(request);
  ASSERT_TRUE(first.ok()) << first.reason;
  for (const double share : {0.2, 0.4, 0.6}) {
    const Seconds t = share * first.trajectory.duration();
    PlanRequest next = request;
    next.platform = predict(request.platform, t);
    next.from = first.trajectory.at(t);
    const PlanResult again = planner.plan(next);
    EXPECT_TRUE(again.ok()) << share << ": " << again.reason;
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, PlannerProperty, testing::Range(0u, 30u));

TEST(Planner, TypicalLandingTakesAFewGentleSeconds) {
  PlanRequest request;
  request.from.p_NB = {-1.2, 0, 0.8};
  const PlanResult result = make({}, 31).plan(request);
  ASSERT_TRUE(result.ok()) << result.reason;
  EXPECT_EQ(result.tried, 961);
  EXPECT_GT(result.trajectory.duration(), 2.5);
  EXPECT_LT(result.trajectory.duration(), 4.2);
  for (int i = 0; i <= 200; ++i) {
    const Seconds t = result.trajectory.duration() * i / 200;
    EXPECT_LT(result.trajectory.at(t).a_NB.norm(), 2);
  }
  const FlatState end = result.trajectory.at(result.trajectory.duration());
  EXPECT_NEAR(end.p_NB.z(), 0.06, 1e-12);
  EXPECT_NEAR(end.v_NB.z(), -0.25, 1e-12);
}

TEST(Planner, PaperEndsAtRestAboveThePad) {
  PlanRequest request;
  request.from.p_NB = {-1.2, 0, 0.8};
  request.platform = driving(0.9, 0.6);
  const PlanResult result = make(PlannerConfig::paper()).plan(request);
  ASSERT_TRUE(result.ok()) << result.reason;
  const FlatState end = result.trajectory.at(result.trajectory.duration());
  EXPECT_LT((end.p_NB - Vector3(0, 0, 0.14)).norm(), 1e-12);
  EXPECT_LT(end.v_NB.norm(), 1e-12);
}

TEST(Planner, NamesThePlaneThatTheStartIsOutsideOf) {
  const Planner planner = make();
  PlanRequest request;
  request.from.p_NB = {0, 0, 1.5};
  EXPECT_STREQ(planner.plan(request).reason, "the start violates view_upper");
  request.from.p_NB = {-1, 3, 0.7};
  const PlanResult aside = planner.plan(request);
  EXPECT_EQ(aside.status, PlanStatus::infeasible);
  EXPECT_TRUE(std::strstr(aside.reason, "view_"));
}

TEST(Planner, NamesTheLimitThatLeavesNoWay) {
  PlanRequest request;
  request.from.p_NB = {-1.2, 0, 0.8};
  request.platform = driving(5, 0);  // Faster than the drone may fly.
  const PlanResult result = make().plan(request);
  EXPECT_EQ(result.status, PlanStatus::infeasible);
  EXPECT_TRUE(std::strstr(result.reason, "speed")) << result.reason;
}

TEST(Planner, RefusesRequestsThatHoldNoNumbers) {
  const Planner planner = make();
  PlanRequest good;
  good.from.p_NB = {-1.2, 0, 0.8};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<PlanRequest> bad(7, good);
  bad[0].from.v_NB.y() = nan;
  bad[1].from.yaw = nan;
  bad[2].platform.w_IN_N.z() = std::numeric_limits<double>::infinity();
  bad[3].platform.X_IN.translation().x() = nan;
  bad[4].durations = {-1, 1};
  bad[5].durations = {0, 1};
  bad[6].durations = {nan, 1};
  for (const PlanRequest& request : bad) {
    const PlanResult result = planner.plan(request);
    EXPECT_EQ(result.status, PlanStatus::invalid_request);
    EXPECT_STRNE(result.reason, "");
    EXPECT_FALSE(planner.explain(request));
  }
}

TEST(Planner, KeepsGivenDurations) {
  PlanRequest request;
  request.from.p_NB = {-1.2, 0, 0.8};
  request.durations = {2.5, 1.25};
  const PlanResult result = make().plan(request);
  ASSERT_TRUE(result.ok()) << result.reason;
  EXPECT_EQ(result.trajectory.durations, request.durations);
  EXPECT_EQ(result.tried, 1);
}

TEST(PlannerConfig, NamesTheFieldOutOfRange) {
  PlannerConfig config;
  config.tilt_max_deg = 80;
  const auto valid = config.validate();
  ASSERT_FALSE(valid);
  EXPECT_NE(valid.error().detail.find("tilt_max_deg"), std::string::npos);
  EXPECT_NE(valid.error().detail.find("80"), std::string::npos);
  EXPECT_FALSE(Planner::create(config, alan_rig()));
  Rig rig = alan_rig();
  rig.pad.size_m = -1;
  EXPECT_FALSE(Planner::create({}, rig));
}

}  // namespace
}  // namespace alight
