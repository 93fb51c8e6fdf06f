#include "alight/sim/camera_sight.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/sim/camera_lights.h"

namespace alight {
namespace {

CameraSimConfig plain() {
  CameraSimConfig config;
  config.hidden_by_body = false;
  config.led_brightness_spread = 0;
  config.pad_reflectance = 0;
  return config;
}

SceneAt at(const Vector3& p_NB, const Matrix3& R_NB = Matrix3::Identity()) {
  SceneAt scene;
  scene.X_NB = make_pose(R_NB, p_NB);
  return scene;
}

TEST(LineMeetsBox, AgreesWithSteppingAlongTheLine) {
  Rng rng(3);
  int met = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const auto point = [&] {
      return Vector3(rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(-2, 2));
    };
    const Vector3 a = point(), b = point();
    const Obstacle box{Vector3(-0.7, -0.5, -1), Vector3(0.7, 0.5, 0.2)};
    // Not where the line only grazes the box: the steps may miss it.
    const Obstacle shrunk{box.min_m.array() + 0.01, box.max_m.array() - 0.01};
    bool inside = false, deep = false;
    for (int k = 0; k <= 2000; ++k) {
      const Vector3 p = a + (k / 2000.0) * (b - a);
      inside |= (p.array() > box.min_m.array()).all() &&
                (p.array() < box.max_m.array()).all();
      deep |= (p.array() > shrunk.min_m.array()).all() &&
              (p.array() < shrunk.max_m.array()).all();
    }
    if (inside != deep) continue;
    EXPECT_EQ(line_meets_box(a, b, box), inside);
    EXPECT_EQ(line_meets_box(b, a, box), inside);
    met += inside;
  }
  EXPECT_GT(met, 200);
}

TEST(LineMeetsBox, TouchingIsNotEntering) {
  const Obstacle box{Vector3(-1, -1, -1), Vector3(1, 1, 0)};
  EXPECT_FALSE(line_meets_box({-2, 0, 0}, {2, 0, 0}, box));  // along the top
  EXPECT_FALSE(line_meets_box({0, 0, 0}, {3, 0, 2}, box));   // up from the top
  EXPECT_TRUE(line_meets_box({-2, 0, -1e-3}, {2, 0, -1e-3}, box));
}

TEST(LedView, ThePadHidesWhatIsBelowItsPlaneBehindIt) {
  const Rig rig = alan_rig();  // lens 3 cm above the pad's plane, looking back
  const LedView view(plain(), rig, Rng(1));
  const double drop = rig.leds.p_BL(0).z();
  // Over the pad's far edge the shadow falls: from the lens through the edge.
  const Vector3 p_NC = rig.camera.X_NC.translation();
  const double x_led = -1.0;
  const double edge = -0.5 * rig.pad.size_m;
  const double shadow =
      p_NC.z() + (0 - p_NC.z()) * (p_NC.x() - x_led) / (p_NC.x() - edge);
  const Vector3 offset(rig.leds.p_BL(0).x(), 0, drop);
  for (const double above : {-0.15, -0.05, -0.01}) {
    const Vector3 p_NL(x_led, rig.leds.p_BL(0).y(), shadow + above);
    EXPECT_FALSE(view.in_sight(0, at(p_NL - rig.leds.p_BL(0)).X_NB)) << above;
  }
  for (const double above : {0.01, 0.05, 0.5}) {
    const Vector3 p_NL(x_led, rig.leds.p_BL(0).y(), shadow + above);
    EXPECT_TRUE(view.in_sight(0, at(p_NL - rig.leds.p_BL(0)).X_NB)) << above;
  }
}

TEST(LedView, ObstaclesHide) {
  Rig rig = alan_rig();
  const SceneAt scene = at({-0.8, 0, 0.5});
  EXPECT_TRUE(LedView(plain(), rig, Rng(1)).in_sight(2, scene.X_NB));
  const Vector3 middle =
      0.5 * (rig.camera.X_NC.translation() + scene.X_NB * rig.leds.p_BL(2));
  rig.pad.obstacles.push_back(
      {middle - Vector3::Constant(0.02), middle + Vector3::Constant(0.02)});
  EXPECT_FALSE(LedView(plain(), rig, Rng(1)).in_sight(2, scene.X_NB));
}

TEST(LedView, TheMirrorImageIsThatOfTheLedBelowThePad) {
  const Rig rig = alan_rig();
  CameraSimConfig config = plain();
  config.pad_reflectance = 0.5;
  const LedView view(config, rig, Rng(1));
  Rng rng(11);
  int mirrored = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const SceneAt scene =
        at({rng.uniform(-0.4, 0.1), rng.uniform(-0.3, 0.3), rng.uniform(0.06, 0.2)},
           from_rpy(rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), 0));
    std::vector<Spot> spots;
    view.append_spots(RowScenes({&scene, 1}, 0, 480), spots);
    for (int i = 0; i < rig.leds.size(); ++i) {
      const Vector3 p_NL = scene.X_NB * rig.leds.p_BL(i);
      if (p_NL.z() <= 0) continue;
      const Vector3 p_NC = rig.camera.X_NC.translation();
      const Vector3 p_NM(p_NL.x(), p_NL.y(), -p_NL.z());
      const auto uv = rig.camera.intrinsics.project(rig.camera.X_NC.inverse() * p_NM);
      ASSERT_TRUE(uv);
      const Vector3 hit = p_NC + p_NC.z() / (p_NC.z() + p_NL.z()) * (p_NM - p_NC);
      const bool on_pad = hit.head<2>().cwiseAbs().maxCoeff() < 0.5 * rig.pad.size_m;
      const auto twin = std::find_if(spots.begin(), spots.end(), [&](const Spot& s) {
        return (s.path[0] - *uv).norm() < 1e-6;
      });
      // The angle of incidence is that of reflection.
      EXPECT_NEAR((p_NL - hit).normalized().z(), (p_NC - hit).normalized().z(), 1e-9);
      if (!on_pad) {
        EXPECT_EQ(twin, spots.end());
      } else if ((hit - p_NL).x() > 0) {
        ASSERT_NE(twin, spots.end());
        ++mirrored;
        const auto direct = project_led(rig.camera, scene.X_NB, rig.leds.p_BL(i));
        const auto original = std::find_if(
            spots.begin(), spots.end(),
            [&](const Spot& s) { return (s.path[0] - *direct).norm() < 1e-6; });
        if (original != spots.end()) {
          EXPECT_LT(twin->flux, 0.5 * original->flux);
          EXPECT_GT(twin->sd_px, original->sd_px - 1e-9);
        }
      }
    }
  }
  EXPECT_GT(mirrored, 100);

  const SceneAt landed = at({0, 0, 0.06});
  std::vector<Spot> matt;
  LedView(plain(), rig, Rng(1)).append_spots(RowScenes({&landed, 1}, 0, 480), matt);
  EXPECT_EQ(matt.size(), 6u);
}

TEST(OwnBody, HidesWhatIsBehindIt) {
  const DroneSpec drone;
  const Vector3 front(0.09, 0.0, -0.04), rear(-0.09, 0.0, 0.0);
  EXPECT_EQ(through_own_body(drone, front, {2, 0, -0.5}), 1);
  EXPECT_EQ(through_own_body(drone, rear, {2, 0, 0}), 0);  // the hull
  // Seen from above through a propeller.
  const double m = drone.arm_m * std::sqrt(0.5);
  const double through =
      through_own_body(drone, {m, m - 0.02, -0.03}, {m, m - 0.02, 2});
  EXPECT_GT(through, 0);
  EXPECT_LT(through, 1);
  // An arm right in the way.
  EXPECT_EQ(through_own_body(drone, {0.05, 0.05, -0.04}, {0.05, 0.05, 2}), 0);
}

TEST(OwnBody, LeavesTheAuthorsLedsAloneFromTheFront) {
  const Rig rig = alan_rig();
  const LedView view(CameraSimConfig{}, rig, Rng(1));
  for (const double pitch : {-0.3, 0.0, 0.3}) {
    for (int i = 0; i < rig.leds.size(); ++i) {
      EXPECT_TRUE(view.in_sight(i, at({-0.8, 0, 0.5}, from_rpy(0, pitch, 0)).X_NB));
    }
  }
}

TEST(RoomLights, HangWhereTheyAreSaidTo) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    CameraSimConfig config;
    config.lights = static_cast<int>(2 * seed);
    const auto lights = make_room_lights(config, Rng(seed));
    ASSERT_EQ(lights.size(), 2 * seed);
    for (const RoomLight& light : lights) {
      EXPECT_GE(light.p_IA.z(), 2.5);
      EXPECT_LE(light.p_IA.z(), 4);
      EXPECT_LT(light.p_IA.head<2>().norm(), config.room_radius_m + 1);
    }
  }
}

TEST(RoomLights, StayFixedInTheRoomWhenThePlatformTurns) {
  const Rig rig = alan_rig();
  const Lens lens(rig.camera.intrinsics);
  CameraSimConfig config;
  config.lights = 100;
  const auto lights = make_room_lights(config, Rng(4));
  int seen = 0;
  for (int step = 0; step < 24; ++step) {
    SceneAt scene = at({-0.8, 0, 0.5});
    scene.X_IN = make_pose(from_rpy(0.02, -0.03, 0.26 * step),
                           Vector3(std::sin(0.3 * step), std::cos(0.2 * step), 0.26));
    std::vector<Spot> spots;
    append_light_spots(lights, rig.camera, lens, 0.8, 1, RowScenes({&scene, 1}, 0, 480),
                       spots);
    const Pose X_CI = (scene.X_IN * rig.camera.X_NC).inverse();
    std::size_t expected = 0;
    for (const RoomLight& light : lights) {
      const auto uv =
          rig.camera.intrinsics.project(X_CI * (0.5 * (light.p_IA + light.p_IB)));
      if (!uv || !rig.camera.intrinsics.contains(*uv)) continue;
      ++expected;
      const bool drawn = std::any_of(spots.begin(), spots.end(), [&](const Spot& s) {
        return (0.5 * (s.path.front() + s.path.back()) - *uv).norm() < 1.0;
      });
      EXPECT_TRUE(drawn);
    }
    EXPECT_GE(spots.size(), expected);
    seen += static_cast<int>(expected);
  }
  EXPECT_GT(seen, 100);
}

}  // namespace
}  // namespace alight
