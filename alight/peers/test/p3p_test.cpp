#include "alight/peers/p3p.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

namespace alight {
namespace {

Vector3 somewhere(Rng& rng, double size) {
  const double x = rng.uniform(-size, size);
  const double y = rng.uniform(-size, size);
  const double z = rng.uniform(-size, size);
  return {x, y, z};
}

double difference(const Pose& a, const Pose& b) {
  return (a.matrix() - b.matrix()).norm();
}

/// Three points, not nearly in a line, seen from 0.3 to 4 m.
struct View {
  explicit View(Rng& rng) {
    for (;;) {
      for (Vector3& p : p_B) p = somewhere(rng, 0.1);
      const double longest =
          std::max({(p_B[1] - p_B[0]).norm(), (p_B[2] - p_B[0]).norm(),
                    (p_B[2] - p_B[1]).norm()});
      if ((p_B[1] - p_B[0]).cross(p_B[2] - p_B[0]).norm() > 0.1 * longest * longest)
        break;
    }
    const double range = rng.uniform(0.3, 4);
    X_CB =
        make_pose(so3_exp(somewhere(rng, 2)),
                  range * Vector3(rng.uniform(-0.8, 0.8), rng.uniform(-0.5, 0.5), 1));
    for (int i = 0; i < 3; ++i) rays[i] = rng.uniform(0.1, 5) * (X_CB * p_B[i]);
  }
  Vector3 p_B[3], rays[3];
  Pose X_CB;
};

double nearest(const FixedVector<Pose, 4>& found, const Pose& X) {
  double least = 1e9;
  for (const Pose& pose : found) least = std::min(least, difference(pose, X));
  return least;
}

constexpr int kViews = 1000;

TEST(P3p, TheTruePoseIsAmongTheAnswers) {
  Rng rng(1);
  for (int i = 0; i < kViews; ++i) {
    const View view(rng);
    // Where two answers meet in one, half of the digits are lost.
    EXPECT_LT(nearest(solve_p3p(view.p_B, view.rays), view.X_CB), 1e-3) << i;
  }
}

TEST(P3p, EveryAnswerIsARigidMotionWithThePointsInFront) {
  Rng rng(2);
  for (int i = 0; i < kViews; ++i) {
    const View view(rng);
    const auto found = solve_p3p(view.p_B, view.rays);
    EXPECT_GE(found.size(), 1u);
    for (const Pose& X : found) {
      EXPECT_TRUE((X.linear().transpose() * X.linear()).isIdentity(1e-9));
      EXPECT_NEAR(X.linear().determinant(), 1, 1e-9);
      for (const Vector3& p : view.p_B) EXPECT_GT((X * p).z(), 0);
    }
  }
}

TEST(P3p, ARotatedCameraSeesARotatedPose) {
  Rng rng(3);
  for (int i = 0; i < kViews; ++i) {
    View view(rng);
    const Matrix3 R = so3_exp(0.2 * somewhere(rng, 1));
    for (Vector3& ray : view.rays) ray = R * ray;
    EXPECT_LT(nearest(solve_p3p(view.p_B, view.rays),
                      make_pose(R, Vector3::Zero()) * view.X_CB),
              1e-4)
        << i;
  }
}

TEST(P3p, UnderNoiseThePointsStayWhereTheyAreSeen) {
  Rng rng(4);
  for (int i = 0; i < kViews; ++i) {
    View view(rng);
    for (Vector3& ray : view.rays) {
      ray /= ray.z();
      ray += Vector3(1e-6 * rng.normal(), 1e-6 * rng.normal(), 0);
    }
    // However much the depth may move.
    double least = 1e9;
    for (const Pose& X : solve_p3p(view.p_B, view.rays)) {
      double worst = 0;
      for (int k = 0; k < 3; ++k) {
        const Vector3 p_C = X * view.p_B[k];
        worst = std::max(worst, (p_C / p_C.z() - view.rays[k]).norm());
      }
      least = std::min(least, worst);
    }
    EXPECT_LT(least, 1e-4) << i;
  }
}

TEST(P3pDegenerate, PointsInALineGiveNone) {
  const Vector3 line[3] = {{0, 0, 0}, {0.1, 0, 0}, {0.2, 0, 0}};
  const Vector3 rays[3] = {{0, 0, 1}, {0.1, 0, 1}, {0.2, 0, 1}};
  EXPECT_TRUE(solve_p3p(line, rays).empty());
  const Vector3 same[3] = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  EXPECT_TRUE(solve_p3p(same, rays).empty());
}

TEST(P3pDegenerate, RaysThatAreOneGiveNothingUnsound) {
  const Vector3 p_B[3] = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}};
  const Vector3 rays[3] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
  for (const Pose& X : solve_p3p(p_B, rays)) EXPECT_TRUE(X.matrix().allFinite());
  const Vector3 bad[3] = {{std::nan(""), 0, 1}, {0, 0, 1}, {0, 0.1, 1}};
  EXPECT_TRUE(solve_p3p(p_B, bad).empty());
}

}  // namespace
}  // namespace alight
