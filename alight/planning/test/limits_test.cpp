#include "alight/planning/limits.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"
#include "alight/planning/test/bezier_state.h"

namespace alight {
namespace {

/// A curve by its Bernstein coefficients, one a row.
Vector3 value(const MotionPoints& c, double u) {
  MotionPoints b = c;
  for (Eigen::Index level = c.rows() - 1; level > 0; --level) {
    for (Eigen::Index i = 0; i < level; ++i) {
      b.row(i) = (1 - u) * b.row(i) + u * b.row(i + 1);
    }
  }
  return b.row(0);
}

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
    const MotionCurves curves =
        motion_curves(rows, segment_frames(rows, {T, T})[0], c, T);
    const double u = rng.uniform();
    const FlatState at = test::bezier_state(c, u, T);
    EXPECT_LT(
        (value(curves.v, u) - inertial_velocity_N(platform, at.p_NB, at.v_NB)).norm(),
        1e-10);
    const Vector3 a = inertial_acceleration_N(platform, at.p_NB, at.v_NB, at.a_NB);
    EXPECT_LT((value(curves.a, u) - a).norm(), 1e-9);
    EXPECT_LT((value(curves.f, u) - (a - gravity_N(platform))).norm(), 1e-9);
    // The jerk in I: the force's rate there, by differences.
    const double h = 1e-5;
    const auto f_I = [&](double s) -> Vector3 {
      return so3_exp(platform.w_IN_N * (s - u) * T) * value(curves.a, s);
    };
    const Vector3 j = (f_I(u + h) - f_I(u - h)) / (2 * h * T);
    EXPECT_LT((value(curves.j, u) - j).norm(), 1e-4 * (1 + j.norm()));
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
