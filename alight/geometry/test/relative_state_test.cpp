#include "alight/geometry/relative_state.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

namespace alight {
namespace {

Vector9 draw(Rng& rng, double sd) {
  Vector9 d;
  for (int i = 0; i < 9; ++i) d[i] = rng.normal(0, sd);
  return d;
}

TEST(RelativeState, BoxminusInvertsBoxplus) {
  Rng rng(1);
  for (int i = 0; i < 300; ++i) {
    const RelativeState x = boxplus({}, draw(rng, 1));
    Vector9 d = draw(rng, 1);
    // The rotation part is unique below half a turn.
    const double turn = d.segment<3>(3).norm();
    if (turn > 3) d.segment<3>(3) *= 3 / turn;
    EXPECT_LT((boxminus(boxplus(x, d), x) - d).norm(), 1e-12);
  }
}

TEST(RelativeState, BoxplusInvertsBoxminus) {
  Rng rng(2);
  for (int i = 0; i < 300; ++i) {
    const RelativeState a = boxplus({}, draw(rng, 1)), b = boxplus({}, draw(rng, 1));
    const RelativeState c = boxplus(b, boxminus(a, b));
    EXPECT_LT((c.p_NB - a.p_NB).norm(), 1e-12);
    EXPECT_LT((c.v_NB - a.v_NB).norm(), 1e-12);
    EXPECT_LT((c.R_NB - a.R_NB).norm(), 1e-9);
  }
}

TEST(RelativeState, RotationErrorStandsInB) {
  RelativeState x;
  x.R_NB = from_rpy(0, 0, 1.5);
  Vector9 d = Vector9::Zero();
  d[3] = 0.1;  // about x of B
  EXPECT_LT((boxplus(x, d).R_NB - x.R_NB * from_rpy(0.1, 0, 0)).norm(), 1e-15);
  EXPECT_EQ(boxplus(x, Vector9::Zero()).R_NB, x.R_NB);
  EXPECT_EQ(boxminus(x, x), Vector9::Zero());
}

TEST(RelativeState, PoseHoldsItsParts) {
  RelativeState x;
  x.p_NB = Vector3(1, 2, 3);
  x.R_NB = from_rpy(0.1, 0.2, 0.3);
  const Pose X = x.X_NB();
  EXPECT_EQ(X.translation(), x.p_NB);
  EXPECT_EQ(X.linear(), x.R_NB);
  const Vector3 q(0.3, -0.2, 0.1);
  EXPECT_LT((X.inverse() * (X * q) - q).norm(), 1e-15);
}

TEST(LargestSd, IsThatOfTheWidestAxisHoweverItIsTurned) {
  Rng rng(3);
  for (int i = 0; i < 50; ++i) {
    const Vector3 sd(rng.uniform(0, 1), rng.uniform(0, 1), rng.uniform(0, 1));
    const Vector3 turn(rng.normal(), rng.normal(), rng.normal());
    const Matrix3 R = so3_exp(turn);
    const Matrix3 cov = R * sd.cwiseAbs2().asDiagonal() * R.transpose();
    EXPECT_NEAR(largest_sd(cov), sd.maxCoeff(), 1e-6);
  }
  EXPECT_EQ(largest_sd(Matrix3::Zero()), 0);
}

}  // namespace
}  // namespace alight
