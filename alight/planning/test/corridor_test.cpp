#include "alight/planning/corridor.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

namespace alight {
namespace {

Rig distorted_rig() {
  Rig rig = alan_rig();
  rig.camera.intrinsics.distortion = {-0.08, 0.02, 0.001, -0.0008, 0.0};
  return rig;
}

bool inside(const Corridor& corridor, int segment, const Vector3& p) {
  for (const HalfSpace& plane : corridor.planes) {
    if (plane.segment == segment && plane.a.dot(p) > plane.b) return false;
  }
  return true;
}

FlatState typical_start() {
  FlatState start;
  start.p_NB = {-1.2, 0.1, 0.8};
  start.yaw = 0.2;
  return start;
}

Matrix3 random_attitude(Rng& rng, const YawRange& yaw, double tilt_max) {
  const double about = rng.uniform(-kPi, kPi);
  const Vector3 axis(std::cos(about), std::sin(about), 0);
  return so3_exp(axis * rng.uniform(0, tilt_max)) *
         from_rpy(0, 0, rng.uniform(yaw.low, yaw.high));
}

class CorridorProperty : public testing::TestWithParam<unsigned> {};

TEST_P(CorridorProperty, EveryLedIsInThePictureAtEveryPlannedAttitude) {
  const Rig rig = GetParam() % 2 == 0 ? alan_rig() : distorted_rig();
  const PlannerConfig config;
  const FlatState start = typical_start();
  const Corridor corridor =
      build_corridor(config, rig, start, landing_end(config, rig));
  const Vector3 p_NC = rig.camera.X_NC.translation();
  const Vector3 shadow = pad_shadow_normal(rig.camera, rig.pad);
  Rng rng(GetParam());
  int tested = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vector3 p(rng.uniform(-1.8, 0.4), rng.uniform(-0.8, 0.8),
                    rng.uniform(-0.2, 1.3));
    const int segment = i % 2;
    if (!inside(corridor, segment, p)) continue;
    ++tested;
    const Matrix3 R = random_attitude(rng, yaw_range(start.yaw, config.end_yaw),
                                      config.tilt_max_deg * kDegree);
    for (const Led& led : rig.leds.leds) {
      const auto uv = project_led(rig.camera, make_pose(R, p), led.p_BL);
      ASSERT_TRUE(uv);
      EXPECT_TRUE(rig.camera.intrinsics.contains(*uv, config.view_border_px - 1e-6))
          << uv->transpose() << " from " << p.transpose();
      if (segment == 0) {
        EXPECT_LE(shadow.dot(p + R * led.p_BL - p_NC), 0);
      }
    }
  }
  EXPECT_GT(tested, 100);
}

TEST_P(CorridorProperty, RaysAboveTheShadowPlaneMissThePad) {
  const Rig rig = alan_rig();
  const Vector3 p_NC = rig.camera.X_NC.translation();
  const Vector3 n = pad_shadow_normal(rig.camera, rig.pad);
  const double half = rig.pad.size_m / 2;
  Rng rng(GetParam());
  int above = 0;
  int hidden = 0;
  for (int i = 0; i < 500; ++i) {
    const Vector3 p(rng.uniform(-3, -half), rng.uniform(-0.2, 0.2),
                    rng.uniform(-0.3, 0.3));
    const double down = p_NC.z() - p.z();
    const Vector3 hit = down > 0 ? (p_NC + (p - p_NC) * (p_NC.z() / down)).eval() : p;
    const bool blocked =
        p.z() < 0 && std::abs(hit.x()) < half && std::abs(hit.y()) < half;
    if (n.dot(p - p_NC) <= 0) {
      ++above;
      EXPECT_FALSE(blocked) << p.transpose();
    } else if (blocked) {
      ++hidden;
    }
  }
  EXPECT_GT(above, 100);
  EXPECT_GT(hidden, 20);
}

INSTANTIATE_TEST_SUITE_P(Seeds, CorridorProperty, testing::Range(0u, 20u));

TEST(Corridor, HoldsStartAndEndAndOverlaps) {
  for (const PlannerConfig& config : {PlannerConfig{}, PlannerConfig::paper()}) {
    const Rig rig = alan_rig();
    const FlatState start = typical_start();
    const FlatState end = landing_end(config, rig);
    const Corridor corridor = build_corridor(config, rig, start, end);
    EXPECT_TRUE(inside(corridor, 0, start.p_NB));
    EXPECT_TRUE(inside(corridor, 1, end.p_NB));
    const Vector3 joint(-0.3, 0, config.touch_down_height_m);
    EXPECT_TRUE(inside(corridor, 0, joint));
    EXPECT_TRUE(inside(corridor, 1, joint));
  }
}

TEST(Corridor, KeepsTheDroneOutOfTheDeckAndOfObstacles) {
  Rig rig = alan_rig();
  rig.pad.obstacles.push_back({{-0.2, 0.3, 0}, {0.2, 0.5, 0.6}});
  const PlannerConfig config;
  FlatState start = typical_start();
  start.yaw = 0;
  const double radius = drone_radius(rig);
  Rng rng(3);
  for (const double z : {0.8, 0.15}) {
    start.p_NB.z() = z;
    const Corridor corridor =
        build_corridor(config, rig, start, landing_end(config, rig));
    ASSERT_FALSE(corridor.full);
    int tested = 0;
    for (int i = 0; i < 20000; ++i) {
      const Vector3 p(rng.uniform(-1.8, 0.4), rng.uniform(-0.8, 0.8),
                      rng.uniform(-0.3, 1.3));
      for (const int segment : {0, 1}) {
        if (!inside(corridor, segment, p)) continue;
        ++tested;
        const double half = rig.pad.size_m / 2;
        const bool over = std::abs(p.x()) < half && std::abs(p.y()) < half;
        if (over) {
          const double least = segment == 0 ? radius : rig.drone.gear_height_m;
          EXPECT_GE(p.z(), least - 1e-12);
        }
        const Obstacle& box = rig.pad.obstacles.front();
        const Vector3 nearest = p.cwiseMax(box.min_m).cwiseMin(box.max_m);
        EXPECT_GE((p - nearest).norm(), radius - 1e-9) << p.transpose();
      }
    }
    EXPECT_GT(tested, 500);
  }
}

TEST(LedSupport, IsReachedAndNeverExceeded) {
  const Rig rig = alan_rig();
  const YawRange yaw = yaw_range(-0.3, 0.5);
  Rng rng(11);
  for (int i = 0; i < 50; ++i) {
    const Vector3 n = Vector3(rng.normal(), rng.normal(), rng.normal()).normalized();
    const double angle = rng.uniform(0, 0.4);
    const double bound = led_support(rig.leds, n, yaw, angle);
    double most = -1;
    for (int k = 0; k < 4000; ++k) {
      const Vector3 axis =
          Vector3(rng.normal(), rng.normal(), rng.normal()).normalized();
      const Matrix3 R = so3_exp(axis * angle * std::sqrt(rng.uniform())) *
                        from_rpy(0, 0, rng.uniform(yaw.low, yaw.high));
      for (const Led& led : rig.leds.leds) most = std::max(most, n.dot(R * led.p_BL));
    }
    EXPECT_LE(most, bound + 1e-12);
    EXPECT_GT(most, bound - 0.012);
  }
}

TEST(YawRange, TakesTheShortWay) {
  const YawRange yaw = yaw_range(3.0, -3.0);
  EXPECT_NEAR(yaw.high - yaw.low, 2 * kPi - 6, 1e-12);
}

}  // namespace
}  // namespace alight
