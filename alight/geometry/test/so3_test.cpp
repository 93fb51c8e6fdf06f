#include "alight/geometry/so3.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "alight/base/rng.h"

namespace alight {
namespace {

Vector3 direction(Rng& rng) {
  return Vector3(rng.normal(), rng.normal(), rng.normal()).normalized();
}

// Around the switch between series and quotient, and close to a half turn.
constexpr double kAngles[] = {0,       1e-12,      1e-9,       1e-8,      1e-6,
                              0.99e-4, 1e-4,       1e-3,       0.1,       1,
                              3,       kPi - 1e-3, kPi - 1e-6, kPi - 1e-9};

TEST(So3, HatIsTheCrossProduct) {
  const Vector3 a(1, -2, 3), b(0.5, 4, -1);
  EXPECT_EQ(hat(a) * b, a.cross(b));
  EXPECT_EQ(hat(a).transpose(), -hat(a));
}

TEST(So3, ExpIsARotation) {
  Rng rng(1);
  for (const double angle : kAngles) {
    for (int i = 0; i < 50; ++i) {
      const Matrix3 R = so3_exp(angle * direction(rng));
      EXPECT_LT((R * R.transpose() - Matrix3::Identity()).norm(), 1e-14);
      EXPECT_NEAR(R.determinant(), 1, 1e-14);
    }
  }
}

TEST(So3, LogInvertsExp) {
  Rng rng(2);
  for (const double angle : kAngles) {
    for (int i = 0; i < 50; ++i) {
      const Vector3 w = angle * direction(rng);
      EXPECT_LT((so3_log(so3_exp(w)) - w).norm(), 1e-9 * angle + 1e-15)
          << "angle " << angle;
    }
  }
}

TEST(So3, ExpInvertsLogAtTheHalfTurn) {
  Rng rng(3);
  for (int i = 0; i < 200; ++i) {
    const Vector3 n = direction(rng);
    const Matrix3 R = 2 * n * n.transpose() - Matrix3::Identity();
    const Vector3 w = so3_log(R);
    EXPECT_NEAR(w.norm(), kPi, 1e-7);
    EXPECT_LT((so3_exp(w) - R).norm(), 1e-7);
  }
}

TEST(So3, RightJacobianAgainstDifferences) {
  Rng rng(4);
  for (const double angle : {0.0, 1e-6, 0.99e-4, 1.01e-4, 0.01, 0.7, 2.0, 3.1}) {
    const Vector3 w = angle * direction(rng);
    const Matrix3 J = so3_right_jacobian(w);
    constexpr double h = 1e-5;
    for (int k = 0; k < 3; ++k) {
      const Vector3 d = h * Vector3::Unit(k);
      const Vector3 column = so3_log(so3_exp(w - d).transpose() * so3_exp(w + d));
      EXPECT_LT((column / (2 * h) - J.col(k)).norm(), 1e-8) << angle;
    }
    EXPECT_LT((J * so3_right_jacobian_inverse(w) - Matrix3::Identity()).norm(), 1e-10)
        << angle;
  }
}

TEST(So3, RpyIsZYX) {
  const Matrix3 R = from_rpy(0.3, -0.4, 2.5);
  EXPECT_LT(
      (R - from_rpy(0, 0, 2.5) * from_rpy(0, -0.4, 0) * from_rpy(0.3, 0, 0)).norm(),
      1e-14);
  EXPECT_NEAR(yaw_of(R), 2.5, 1e-14);
  // Pitch up lowers the nose in a frame with z up: the first axis looks down.
  EXPECT_LT(from_rpy(0, 0.2, 0)(2, 0), 0);
}

TEST(So3, WrapAngleKeepsTheDirection) {
  for (double a = -20; a < 20; a += 0.37) {
    const double w = wrap_angle(a);
    EXPECT_GT(w, -kPi);
    EXPECT_LE(w, kPi);
    EXPECT_NEAR(std::sin(w), std::sin(a), 1e-12);
    EXPECT_NEAR(std::cos(w), std::cos(a), 1e-12);
  }
  EXPECT_EQ(wrap_angle(kPi), kPi);
  EXPECT_EQ(wrap_angle(-kPi), kPi);
}

TEST(So3, OrthonormalizedMendsDrift) {
  Rng rng(5);
  for (int i = 0; i < 100; ++i) {
    const Matrix3 R = so3_exp(rng.uniform(0, 3) * direction(rng));
    Matrix3 drifted = R;
    for (int k = 0; k < 9; ++k) drifted.data()[k] += rng.normal(0, 1e-6);
    const Matrix3 mended = orthonormalized(drifted);
    EXPECT_LT((mended * mended.transpose() - Matrix3::Identity()).norm(), 1e-14);
    EXPECT_LT((mended - R).norm(), 2e-5);
  }
}

TEST(So3, AngleBetweenIsAMetric) {
  Rng rng(6);
  for (int i = 0; i < 100; ++i) {
    const Matrix3 A = so3_exp(rng.uniform(0, 3) * direction(rng));
    const Matrix3 B = so3_exp(rng.uniform(0, 3) * direction(rng));
    const Matrix3 C = so3_exp(rng.uniform(0, 3) * direction(rng));
    EXPECT_NEAR(angle_between(A, B), angle_between(B, A), 1e-12);
    EXPECT_NEAR(angle_between(C * A, C * B), angle_between(A, B), 1e-9);
    EXPECT_LE(angle_between(A, C), angle_between(A, B) + angle_between(B, C) + 1e-12);
    EXPECT_NEAR(angle_between(A, A), 0, 1e-7);
  }
}

}  // namespace
}  // namespace alight
