#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "alight/sim/camera_renderer.h"

namespace alight {
namespace {

SceneAt at(const Vector3& p_NB) {
  SceneAt scene;
  scene.X_NB = make_pose(Matrix3::Identity(), p_NB);
  return scene;
}

double depth_at(const DepthBuffer& depth, const Vector2& uv) {
  const auto u = static_cast<int>(std::lround(uv.x()));
  const auto v = static_cast<int>(std::lround(uv.y()));
  return 1e-3 * depth.pixels()[static_cast<std::size_t>(v * depth.width + u)];
}

TEST(CameraDepth, LedsAreAtTheirDepthWithNoiseThatGrowsAndHoles) {
  const Rig rig = alan_rig();
  auto renderer = CameraRenderer::create({}, rig, 2);
  ASSERT_TRUE(renderer);
  double before = 0;
  for (const double x : {-0.5, -1.0, -2.0}) {
    const SceneAt scene = at({x, 0.05, 0.5});
    ColorBuffer color;
    DepthBuffer depth;
    double bias = 0, square = 0;
    int known = 0, all = 0;
    for (std::uint64_t frame = 0; frame < 100; ++frame) {
      ASSERT_TRUE(renderer->render(frame, {&scene, 1}, color, &depth));
      for (int i = 0; i < rig.leds.size(); ++i) {
        const Vector3 p_CL =
            rig.camera.X_NC.inverse() * (scene.X_NB * rig.leds.p_BL(i));
        const double z =
            depth_at(depth, *project_led(rig.camera, scene.X_NB, rig.leds.p_BL(i)));
        ++all;
        if (z <= 0) continue;
        ++known;
        bias += z - p_CL.z();
        square += (z - p_CL.z()) * (z - p_CL.z());
      }
    }
    const double z = (rig.camera.X_NC.inverse() * (scene.X_NB * rig.leds.p_BL(2))).z();
    const double sd = std::sqrt(square / known);
    EXPECT_NEAR(sd, 0.0063 * z * z, 0.25 * 0.0063 * z * z);
    EXPECT_LT(std::abs(bias / known), 0.5 * sd);
    EXPECT_GT(sd, before);
    before = sd;
    EXPECT_NEAR(1 - static_cast<double>(known) / all, 0.27, 0.08);
  }
}

TEST(CameraDepth, TheDroneStandsOutFromTheRoom) {
  const Rig rig = alan_rig();
  auto renderer = CameraRenderer::create({}, rig, 2);
  ASSERT_TRUE(renderer);
  const SceneAt scene = at({-0.6, 0, 0.5});
  ColorBuffer color;
  DepthBuffer depth;
  ASSERT_TRUE(renderer->render(0, {&scene, 1}, color, &depth));
  ASSERT_EQ(depth.pixels().size(), 848u * 480u);
  const Vector3 p_CB = rig.camera.X_NC.inverse() * scene.X_NB.translation();
  const double width = rig.camera.intrinsics.fx * rig.drone.size_m / p_CB.z();
  int near = 0, far = 0, holes = 0;
  int u_low = depth.width, u_high = 0;
  for (int v = 0; v < depth.height; ++v) {
    for (int u = 0; u < depth.width; ++u) {
      const int mm = depth.pixels()[static_cast<std::size_t>(v * depth.width + u)];
      holes += mm == 0;
      far += mm > 2200;
      if (std::abs(1e-3 * mm - p_CB.z()) < 0.15) {
        ++near;
        u_low = std::min(u_low, u);
        u_high = std::max(u_high, u);
      }
      EXPECT_LT(mm, 8500);
    }
  }
  EXPECT_NEAR(u_high - u_low, width, 0.5 * width);
  EXPECT_GT(near, 0.1 * width * width);
  EXPECT_GT(far, 848 * 480 / 3);
  EXPECT_GT(holes, 848 * 480 / 10);
}

TEST(CameraDepth, MayShowAnotherInstantThanColour) {
  const Rig rig = alan_rig();
  CameraSimConfig config;
  config.depth_hole_share = 0;
  auto renderer = CameraRenderer::create(config, rig, 2);
  ASSERT_TRUE(renderer);
  const SceneAt now = at({-0.9, 0.1, 0.5}), later = at({-0.6, 0.1, 0.5});
  ColorBuffer color, same;
  DepthBuffer depth;
  ASSERT_TRUE(renderer->render(0, {&now, 1}, same));
  ASSERT_TRUE(renderer->render(0, {&now, 1}, color, &depth, &later));
  EXPECT_EQ(color.pixels(), same.pixels());
  const Vector3 p_CL = rig.camera.X_NC.inverse() * (later.X_NB * rig.leds.p_BL(4));
  EXPECT_NEAR(depth_at(depth, *project_led(rig.camera, later.X_NB, rig.leds.p_BL(4))),
              p_CL.z(), 0.06);
}

TEST(CameraDepth, NothingIsMeasuredTooNear) {
  const Rig rig = alan_rig();
  auto renderer = CameraRenderer::create({}, rig, 2);
  ASSERT_TRUE(renderer);
  const SceneAt scene = at({0.22, 0, 0.12});
  ColorBuffer color;
  DepthBuffer depth;
  ASSERT_TRUE(renderer->render(0, {&scene, 1}, color, &depth));
  int in_picture = 0;
  for (int i = 0; i < rig.leds.size(); ++i) {
    const auto uv = project_led(rig.camera, scene.X_NB, rig.leds.p_BL(i));
    if (!uv || !rig.camera.intrinsics.contains(*uv, 1)) continue;
    EXPECT_EQ(depth_at(depth, *uv), 0);
    ++in_picture;
  }
  EXPECT_GT(in_picture, 0);
}

}  // namespace
}  // namespace alight
