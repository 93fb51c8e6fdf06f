#include "alight/geometry/rig.h"

#include <gtest/gtest.h>

#include <cmath>

namespace alight {
namespace {

void expect_refused(const Rig& rig, const std::string& field) {
  const auto r = rig.validate();
  ASSERT_FALSE(r) << field;
  EXPECT_EQ(r.error().fault, Fault::invalid_config);
  EXPECT_NE(r.error().detail.find(field), std::string::npos) << r.error().detail;
}

TEST(Rig, TheAuthorsRigIsValid) {
  const auto r = alan_rig().validate();
  EXPECT_TRUE(r) << r.error().detail;
}

TEST(Rig, NamesTheFieldTheValueAndTheBounds) {
  Rig rig = alan_rig();
  rig.drone.tilt_max_deg = 80;
  expect_refused(rig, "drone.tilt_max_deg is 80, must lie in [5, 60]");
}

TEST(Rig, EveryKindOfNonsenseIsRefused) {
  const double nan = std::nan("");
  Rig rig = alan_rig();
  rig.camera.intrinsics.fx = nan;
  expect_refused(rig, "camera.fx");
  rig = alan_rig();
  rig.camera.intrinsics.distortion[2] = nan;
  expect_refused(rig, "camera.distortion");
  rig = alan_rig();
  rig.camera.intrinsics.distortion = {0.05, -0.5, 0, 0, 0};
  expect_refused(rig, "camera.distortion folds the picture back before its edge");
  rig = alan_rig();
  rig.timing.exposure_ms = 20;  // longer than the frame period
  expect_refused(rig, "camera.exposure_ms");
  rig = alan_rig();
  rig.timing.readout_ms = 17;  // rows would be read out when the next are due
  expect_refused(rig, "camera.readout_ms");
  rig = alan_rig();
  rig.camera.X_NC.translation().y() = nan;
  expect_refused(rig, "mount.xyz_m");
  rig = alan_rig();
  rig.camera.X_NC.linear()(0, 0) = INFINITY;
  expect_refused(rig, "mount.rpy_deg");
  rig = alan_rig();
  rig.leds.leds.truncate(3);
  expect_refused(rig, "at least 4");
  rig = alan_rig();
  rig.leds.leds[4].p_BL = rig.leds.leds[1].p_BL;
  expect_refused(rig, "leds[1] and leds[4]");
  rig = alan_rig();
  rig.leds.leds[2].p_BL.z() = nan;
  expect_refused(rig, "leds[2].xyz_m");
  rig = alan_rig();
  rig.drone.inertia_kg_m2.y() = 0;
  expect_refused(rig, "drone.inertia_kg_m2");
  rig = alan_rig();
  rig.pad.obstacles.push_back({Vector3(0, 0, 0), Vector3(1, -1, 1)});
  expect_refused(rig, "pad.obstacles");
  rig = alan_rig();
  rig.limits.speed_m_s = 0;
  expect_refused(rig, "limits.speed_m_s");
}

TEST(Rig, HousingAndOpticalAxes) {
  const Pose X_NH = make_pose(from_rpy(0, -0.35, kPi), Vector3(0.5, 0, 0.03));
  const Pose X_NC = optical_from_housing(X_NH);
  EXPECT_LT((X_NC.linear().col(2) - X_NH.linear().col(0)).norm(), 1e-12);  // out
  EXPECT_LT((X_NC.linear().col(0) + X_NH.linear().col(1)).norm(), 1e-12);  // right
  EXPECT_LT((X_NC.linear().col(1) + X_NH.linear().col(2)).norm(), 1e-12);  // down
  EXPECT_LT((housing_from_optical(X_NC).matrix() - X_NH.matrix()).norm(), 1e-12);
}

TEST(Rig, TheAuthorsCameraLooksBackAndUp) {
  const Rig rig = alan_rig();
  const Vector3 out = rig.camera.X_NC.linear().col(2);
  EXPECT_LT(out.x(), -0.9);
  EXPECT_NEAR(out.z(), std::sin(20 * kDegree), 1e-9);
}

}  // namespace
}  // namespace alight
