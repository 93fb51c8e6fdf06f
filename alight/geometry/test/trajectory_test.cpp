#include "alight/geometry/trajectory.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

namespace alight {
namespace {

Trajectory random_trajectory(std::uint64_t seed) {
  Rng rng(seed);
  Trajectory t;
  t.durations = {rng.uniform(0.5, 3), rng.uniform(0.5, 3)};
  for (auto& segment : t.c) {
    for (auto& p : segment) p = Vector3(rng.normal(), rng.normal(), rng.normal());
  }
  t.yaw_start = rng.uniform(-3, 3);
  t.yaw_end = t.yaw_start + rng.uniform(-1, 1);
  return t;
}

TEST(Bezier, DerivativesAgainstDifferences) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Trajectory c = random_trajectory(seed);
    for (int segment = 0; segment < kSegments; ++segment) {
      const auto k = static_cast<std::size_t>(segment);
      const double T = c.durations[k];
      const double h = 1e-5;
      for (double u = 0.05; u < 1; u += 0.1) {
        FlatState a, b, m;
        evaluate_bezier(c.c[k], u - h, T, a);
        evaluate_bezier(c.c[k], u + h, T, b);
        evaluate_bezier(c.c[k], u, T, m);
        const double dt = 2 * h * T;
        EXPECT_LT(((b.p_NB - a.p_NB) / dt - m.v_NB).norm(), 1e-5 * (1 + m.v_NB.norm()));
        EXPECT_LT(((b.v_NB - a.v_NB) / dt - m.a_NB).norm(), 1e-5 * (1 + m.a_NB.norm()));
        EXPECT_LT(((b.a_NB - a.a_NB) / dt - m.j_NB).norm(), 1e-5 * (1 + m.j_NB.norm()));
      }
    }
  }
}

TEST(Bezier, EndsAtItsEndPointsAndStaysInItsHull) {
  const Trajectory c = random_trajectory(3);
  FlatState s;
  evaluate_bezier(c.c[0], 0, 1, s);
  EXPECT_EQ(s.p_NB, c.c[0].front());
  evaluate_bezier(c.c[0], 1, 1, s);
  EXPECT_EQ(s.p_NB, c.c[0].back());
  Rng rng(9);
  for (int i = 0; i < 200; ++i) {
    const Vector3 n(rng.normal(), rng.normal(), rng.normal());
    double bound = -1e9;
    for (const auto& p : c.c[0]) bound = std::max(bound, n.dot(p));
    evaluate_bezier(c.c[0], rng.uniform(), 1, s);
    EXPECT_LE(n.dot(s.p_NB), bound + 1e-12);
  }
}

TEST(Bezier, EqualPointsStandStill) {
  std::array<Vector3, kControlPoints> c;
  c.fill(Vector3(1, 2, 3));
  FlatState s;
  evaluate_bezier(c, 0.37, 2, s);
  EXPECT_LT((s.p_NB - Vector3(1, 2, 3)).norm(), 1e-14);
  EXPECT_LT(s.v_NB.norm() + s.a_NB.norm() + s.j_NB.norm(), 1e-11);
}

TEST(Trajectory, RunsThroughItsSegmentsAndClampsBeyond) {
  const Trajectory c = random_trajectory(5);
  const double T1 = c.durations[0];
  EXPECT_LT((c.at(0).p_NB - c.c[0].front()).norm(), 1e-12);
  EXPECT_LT((c.at(T1 - 1e-9).p_NB - c.c[0].back()).norm(), 1e-6);
  EXPECT_LT((c.at(T1 + 1e-9).p_NB - c.c[1].front()).norm(), 1e-6);
  EXPECT_LT((c.at(c.duration()).p_NB - c.c[1].back()).norm(), 1e-9);
  EXPECT_LT((c.at(-1).p_NB - c.c[0].front()).norm(), 1e-12);
  EXPECT_LT((c.at(c.duration() + 5).p_NB - c.c[1].back()).norm(), 1e-9);
}

TEST(Trajectory, YawGoesOverSmoothly) {
  const Trajectory c = random_trajectory(6);
  EXPECT_NEAR(wrap_angle(c.at(0).yaw - c.yaw_start), 0, 1e-9);
  EXPECT_NEAR(wrap_angle(c.at(c.duration()).yaw - c.yaw_end), 0, 1e-9);
  EXPECT_NEAR(c.at(0).yaw_rate, 0, 1e-9);
  EXPECT_NEAR(c.at(c.duration()).yaw_rate, 0, 1e-9);
  constexpr double h = 1e-5;
  for (double t = 0.05; t < c.duration() - 0.05; t += 0.1) {
    const double slope = wrap_angle(c.at(t + h).yaw - c.at(t - h).yaw) / (2 * h);
    EXPECT_NEAR(slope, c.at(t).yaw_rate, 1e-5);
  }
}

TEST(Trajectory, YawTakesUpTheRateAndAccelerationOfItsStart) {
  Trajectory c = random_trajectory(7);
  c.yaw_rate_start = 0.4;
  c.yaw_acceleration_start = -0.7;
  EXPECT_NEAR(c.at(0).yaw_rate, 0.4, 1e-9);
  EXPECT_NEAR(c.at(0).yaw_acceleration, -0.7, 1e-9);
  EXPECT_NEAR(wrap_angle(c.at(c.duration()).yaw - c.yaw_end), 0, 1e-9);
  EXPECT_NEAR(c.at(c.duration()).yaw_rate, 0, 1e-9);
  EXPECT_NEAR(c.at(c.duration()).yaw_acceleration, 0, 1e-9);
  constexpr double h = 1e-5;
  for (double t = 0.05; t < c.duration() - 0.05; t += 0.1) {
    const double slope = wrap_angle(c.at(t + h).yaw - c.at(t - h).yaw) / (2 * h);
    const double bend = (c.at(t + h).yaw_rate - c.at(t - h).yaw_rate) / (2 * h);
    EXPECT_NEAR(slope, c.at(t).yaw_rate, 1e-5);
    EXPECT_NEAR(bend, c.at(t).yaw_acceleration, 1e-5);
  }
}

}  // namespace
}  // namespace alight
