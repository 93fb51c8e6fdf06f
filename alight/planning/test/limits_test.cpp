#include "alight/planning/limits.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

namespace alight {
namespace {

TEST(LimitPolyhedron, LiesInTheBallAndFillsMostOfIt) {
  const LimitPolyhedron polyhedron = make_polyhedron(Profile::standard);
  EXPECT_GE(polyhedron.normals.size(), 20u);
  EXPECT_GT(polyhedron.face_distance, 0.9);
  Rng rng(1);
  double farthest = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vector3 x = Vector3(rng.normal(), rng.normal(), rng.normal()).normalized();
    double along = 0;
    for (const Vector3& n : polyhedron.normals) along = std::max(along, n.dot(x));
    // The surface of the polyhedron in direction x.
    farthest = std::max(farthest, polyhedron.face_distance / along);
  }
  EXPECT_LE(farthest, 1 + 1e-12);
  EXPECT_GT(farthest, 0.99);
}

TEST(DynamicLimits, CurvesAreTheMotionSeenFromI) {
  Rng rng(5);
  const auto vector = [&](double size) {
    return Vector3(rng.uniform(-size, size), rng.uniform(-size, size),
                   rng.uniform(-size, size));
  };
  for (int i = 0; i < 50; ++i) {
    PlatformState platform;
    platform.X_IN.linear() = so3_exp(vector(0.5));
    platform.v_IN_N = vector(2);
    platform.w_IN_N = vector(1);
    platform.a_IN_N = vector(1);
    platform.alpha_IN_N = vector(0.5);
    const DynamicLimitRows rows =
        make_limits({}, alan_rig(), make_polyhedron(Profile::standard), platform, 1);
    ControlPoints c;
    for (double& value : c.reshaped()) value = rng.uniform(-1, 1);
    const double T = rng.uniform(0.5, 3);
    const MotionCurves curves = motion_curves(rows, c, T);
    std::array<Vector3, kControlPoints> p, v, a;
    for (int k = 0; k < kControlPoints; ++k) {
      const auto at = static_cast<std::size_t>(k);
      p[at] = c.row(k).transpose();
      v[at] = curves.v.row(k).transpose();
      a[at] = curves.a.row(k).transpose();
    }
    const double u = rng.uniform();
    FlatState at, v_at, a_at;
    evaluate_bezier(p, u, T, at);
    evaluate_bezier(v, u, T, v_at);
    evaluate_bezier(a, u, T, a_at);
    EXPECT_LT((v_at.p_NB - inertial_velocity_N(platform, at.p_NB, at.v_NB)).norm(),
              1e-10);
    EXPECT_LT((a_at.p_NB - inertial_acceleration_N(platform, at.p_NB, at.v_NB, at.a_NB))
                  .norm(),
              1e-9);
  }
}

TEST(DynamicLimits, TighteningNeverLoosensARow) {
  const auto polyhedron = make_polyhedron(Profile::standard);
  const auto full = make_limits({}, alan_rig(), polyhedron, {}, 1);
  const auto tight = make_limits({}, alan_rig(), polyhedron, {}, 0.8);
  ASSERT_EQ(full.acceleration.size(), tight.acceleration.size());
  for (std::size_t i = 0; i < full.acceleration.size(); ++i) {
    EXPECT_LT(tight.acceleration[i].b, full.acceleration[i].b);
    EXPECT_EQ(tight.acceleration[i].b_fixed, full.acceleration[i].b);
  }
}

}  // namespace
}  // namespace alight
