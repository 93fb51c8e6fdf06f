#include "alight/geometry/camera.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"
#include "alight/geometry/rig.h"

namespace alight {
namespace {

Intrinsics distorted() {
  Intrinsics k;
  k.distortion = {-0.28, 0.09, 0.0015, -0.0008, -0.01};
  return k;
}

class Lenses : public ::testing::TestWithParam<bool> {
 protected:
  Intrinsics lens() const { return GetParam() ? distorted() : Intrinsics{}; }
};

TEST_P(Lenses, UnprojectInvertsProject) {
  const Intrinsics k = lens();
  for (double u = 0; u < k.width; u += 37) {
    for (double v = 0; v < k.height; v += 31) {
      const Vector3 ray = k.unproject({u, v});
      EXPECT_EQ(ray.z(), 1);
      for (const double z : {0.3, 2.0}) {
        const auto uv = k.project(z * ray);
        ASSERT_TRUE(uv);
        EXPECT_LT((*uv - Vector2(u, v)).norm(), 1e-8);
      }
    }
  }
}

TEST_P(Lenses, JacobianAgainstDifferences) {
  const Intrinsics k = lens();
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    const Vector3 p(rng.uniform(-0.8, 0.8), rng.uniform(-0.5, 0.5),
                    rng.uniform(0.8, 3));
    Matrix23 J;
    const auto uv = k.project(p, J);
    ASSERT_TRUE(uv);
    EXPECT_LT((*uv - *k.project(p)).norm(), 1e-10);
    constexpr double h = 1e-6;
    for (int c = 0; c < 3; ++c) {
      const Vector3 d = h * Vector3::Unit(c);
      const Vector2 slope = (*k.project(p + d) - *k.project(p - d)) / (2 * h);
      EXPECT_LT((slope - J.col(c)).norm(), 1e-5 * (1 + J.norm()));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Distortion, Lenses, ::testing::Bool());

TEST(Intrinsics, CentreAndAxes) {
  const Intrinsics k;
  EXPECT_EQ(*k.project({0, 0, 1}), Vector2(k.cx, k.cy));
  EXPECT_GT(k.project({0.1, 0, 1})->x(), k.cx);  // x to the right
  EXPECT_GT(k.project({0, 0.1, 1})->y(), k.cy);  // y down
  EXPECT_FALSE(k.has_distortion());
  EXPECT_TRUE(distorted().has_distortion());
}

TEST(Intrinsics, NothingBehindTheLens) {
  const Intrinsics k;
  Matrix23 J;
  for (const double z : {0.0, 0.009, -1.0, std::nan("")}) {
    EXPECT_FALSE(k.project({0, 0, z}));
    EXPECT_FALSE(k.project({0, 0, z}, J));
  }
}

TEST(Intrinsics, ContainsPixelsByTheirCentres) {
  const Intrinsics k;
  EXPECT_TRUE(k.contains({-0.5, -0.5}));
  EXPECT_FALSE(k.contains({-0.51, 0}));
  EXPECT_TRUE(k.contains({k.width - 0.5, k.height - 0.5}));
  EXPECT_FALSE(k.contains({k.width - 0.4, 0}));
  EXPECT_FALSE(k.contains({5, 100}, 10));
  EXPECT_FALSE(k.contains({std::nan(""), 3}));
}

/// X moved by (dp in N, dR in B).
Pose moved(const Pose& X, const Eigen::Matrix<double, 6, 1>& d) {
  return make_pose(X.linear() * so3_exp(d.tail<3>()), X.translation() + d.head<3>());
}

TEST(ProjectLed, JacobianAgainstDifferences) {
  const Rig rig = alan_rig();
  Rng rng(2);
  for (const bool bent : {false, true}) {
    Camera camera = rig.camera;
    if (bent) camera.intrinsics = distorted();
    for (int i = 0; i < 50; ++i) {
      const Pose X = make_pose(
          from_rpy(rng.normal(0, 0.2), rng.normal(0, 0.2), rng.normal(0, 0.4)),
          Vector3(rng.uniform(-2, -0.5), rng.uniform(-0.5, 0.5),
                  rng.uniform(0.2, 0.8)));
      for (int led = 0; led < rig.leds.size(); ++led) {
        Matrix26 J;
        const auto uv = project_led(camera, X, rig.leds.p_BL(led), &J);
        ASSERT_TRUE(uv);
        EXPECT_LT((*uv - *project_led(camera, X, rig.leds.p_BL(led))).norm(), 1e-10);
        constexpr double h = 1e-6;
        for (int c = 0; c < 6; ++c) {
          Eigen::Matrix<double, 6, 1> d = Eigen::Matrix<double, 6, 1>::Zero();
          d[c] = h;
          const Vector2 slope =
              (*project_led(camera, moved(X, d), rig.leds.p_BL(led)) -
               *project_led(camera, moved(X, -d), rig.leds.p_BL(led))) /
              (2 * h);
          EXPECT_LT((slope - J.col(c)).norm(), 1e-5 * (1 + J.norm()));
        }
      }
    }
  }
}

TEST(ProjectLed, OnlyTheRelativePoseMatters) {
  const Rig rig = alan_rig();
  const Pose X_NB = make_pose(from_rpy(0.1, 0.1, 0.2), Vector3(-1.2, 0.1, 0.5));
  const Pose X_MN = make_pose(from_rpy(0.5, -1, 2), Vector3(3, -2, 1));  // other axes
  Camera moved_camera = rig.camera;
  moved_camera.X_NC = X_MN * rig.camera.X_NC;
  for (int i = 0; i < rig.leds.size(); ++i) {
    const auto a = project_led(rig.camera, X_NB, rig.leds.p_BL(i));
    const auto b = project_led(moved_camera, X_MN * X_NB, rig.leds.p_BL(i));
    EXPECT_LT((*a - *b).norm(), 1e-9);
  }
}

TEST(Intrinsics, SeesWhereItsDistortionDoesNotFoldBack) {
  const Intrinsics straight;
  EXPECT_TRUE(straight.sees({0, 0}));
  EXPECT_TRUE(distorted().sees({0, distorted().cy}));
  // Turns back at a tangent of 0.91, where its image is 0.61 f from the middle.
  Intrinsics folded;
  folded.distortion = {-0.4, 0, 0, 0, 0};
  const double fold = folded.fx * 2.0 / 3 / std::sqrt(1.2);
  for (const double share : {0.0, 0.3, 0.9, 0.99}) {
    EXPECT_TRUE(folded.sees({folded.cx + share * fold, folded.cy})) << share;
  }
  for (const double share : {1.01, 1.2, 1.6}) {
    EXPECT_FALSE(folded.sees({folded.cx + share * fold, folded.cy})) << share;
  }
}

}  // namespace
}  // namespace alight
