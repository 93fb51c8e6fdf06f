#include "alight/mission/force_seen.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/geometry/so3.h"

namespace alight {
namespace {

/// In a circle of 1 m at 2 rad/s, leaning as that asks for.
Pose circling(double t) {
  const double w = 2;
  const Vector3 p_NB(std::cos(w * t), std::sin(w * t), 1);
  const Vector3 f_N = Vector3(-w * w * p_NB.x(), -w * w * p_NB.y(), kGravity);
  const Matrix3 R_NB =
      Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), f_N).toRotationMatrix();
  return make_pose(R_NB, p_NB);
}

void see(ForceSeen& force, double from, double to) {
  for (int k = static_cast<int>(std::lround(from * 60)); k <= to * 60; ++k) {
    force.add(from_seconds(k / 60.0), circling(k / 60.0));
  }
}

TEST(ForceSeen, ADroneIsPushedAlongItsZ) {
  ForceSeen force;
  see(force, 0, 2);
  ASSERT_TRUE(force.across(Matrix3::Identity()));
  EXPECT_LT(*force.across(Matrix3::Identity()), 0.7);  // means over 0.6 s of a circle
}

TEST(ForceSeen, AReadingThatLeansIsPushedAcross) {
  ForceSeen force;
  see(force, 0, 2);
  for (const double deg : {30.0, 60.0, 150.0}) {
    const double push = std::hypot(4, kGravity);
    const double across = deg < 90 ? push * std::sin(deg * kDegree) : push;
    const auto seen = force.across(from_rpy(deg * kDegree, 0, 0));
    ASSERT_TRUE(seen);
    EXPECT_NEAR(*seen, across, 1) << deg;
  }
}

TEST(ForceSeen, SaysNothingUntilItHasSeenForLongEnough) {
  ForceSeen force;
  see(force, 0, 0.55);
  EXPECT_FALSE(force.across(Matrix3::Identity()));
  see(force, 0.6, 0.8);
  EXPECT_TRUE(force.across(Matrix3::Identity()));
}

TEST(ForceSeen, BeginsAnewAfterAGapAJumpOrATurn) {
  const auto after = [](Time t, const Pose& X_NB) {
    ForceSeen force;
    see(force, 0, 1);
    force.add(t, X_NB);
    return force.across(Matrix3::Identity()).has_value();
  };
  EXPECT_TRUE(after(from_seconds(1.1), circling(1.1)));
  EXPECT_FALSE(after(from_seconds(1.4), circling(1.4)));
  EXPECT_FALSE(after(from_seconds(0.5), circling(0.5)));  // time runs backwards
  Pose jumped = circling(1.1), turned = circling(1.1), broken = circling(1.1);
  jumped.translation().x() += 1;
  turned.linear() = turned.linear() * from_rpy(1, 0, 0);
  broken.translation().x() = std::nan("");
  EXPECT_FALSE(after(from_seconds(1.1), jumped));
  EXPECT_FALSE(after(from_seconds(1.1), turned));
  EXPECT_FALSE(after(from_seconds(1.1), broken));
}

}  // namespace
}  // namespace alight
