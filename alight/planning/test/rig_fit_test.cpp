#include "alight/planning/rig_fit.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"
#include "alight/planning/corridor.h"

namespace alight {
namespace {

/// The authors' rig, its camera turned up by `up_deg` and to the left by `left_deg`.
Rig turned_rig(double up_deg, double left_deg = 0) {
  Rig rig = alan_rig();
  const Pose X_NH = housing_from_optical(rig.camera.X_NC);
  const Matrix3 R_NH =
      X_NH.linear() * from_rpy(0, -up_deg * kDegree, left_deg * kDegree);
  rig.camera.X_NC = optical_from_housing(make_pose(R_NH, X_NH.translation()));
  return rig;
}

/// The same, `scale` times as large in every length.
Rig scaled_rig(double scale) {
  Rig rig = alan_rig();
  rig.camera.X_NC.translation() *= scale;
  for (Led& led : rig.leds.leds) led.p_BL *= scale;
  rig.drone.size_m *= scale;
  rig.drone.gear_height_m *= scale;
  rig.pad.size_m *= scale;
  return rig;
}

PlanRequest request_from(const Vector3& p_NB) {
  PlanRequest request;
  request.from.p_NB = p_NB;
  return request;
}

TEST(RigFit, TheAuthorsRigTakesTheConfigurationAsItIs) {
  const PlannerConfig config;
  const PlannerConfig fitted = fitted_to(config, alan_rig());
  EXPECT_EQ(fitted.tilt_max_deg, config.tilt_max_deg);
  EXPECT_EQ(fitted.touch_down_height_m, config.touch_down_height_m);
  EXPECT_TRUE(check_view_of_pad(config, alan_rig()));
}

TEST(RigFit, ThePaperPlansAsItSays) {
  const PlannerConfig paper = PlannerConfig::paper();
  const Rig rig = turned_rig(25);
  EXPECT_EQ(fitted_to(paper, rig).tilt_max_deg, paper.tilt_max_deg);
  EXPECT_TRUE(check_view_of_pad(paper, rig));
}

// The higher the camera looks, the nearer to the picture's edge a landing ends.
TEST(RigFit, ALandingLeansNoMoreThanItsEndCanBeSeen) {
  double last = PlannerConfig{}.tilt_max_deg;
  int refused = 0, less = 0;
  for (double up = 0; up <= 12; up += 0.5) {
    const Rig rig = turned_rig(up);
    const PlannerConfig fitted = fitted_to({}, rig);
    EXPECT_LE(fitted.tilt_max_deg, last) << up;
    less += fitted.tilt_max_deg < last ? 1 : 0;
    last = fitted.tilt_max_deg;
    const auto planner = Planner::create({}, rig);
    ASSERT_TRUE(planner);
    const PlanResult plan = planner->plan(request_from({-0.8, 0, 0.6}));
    if (!check_view_of_pad({}, rig)) {
      ++refused;
      EXPECT_EQ(fitted.tilt_max_deg, 4) << up;
    } else {
      EXPECT_EQ(plan.status, PlanStatus::solved) << up << ": " << plan.reason;
    }
  }
  EXPECT_GE(less, 3);
  EXPECT_GE(refused, 3);
}

class OfEachEdge : public testing::TestWithParam<unsigned> {};

TEST_P(OfEachEdge, LeaningAsFarAsPlannedALandedDroneIsInThePicture) {
  Rng rng(GetParam());
  const Rig rig = turned_rig(rng.uniform(-40, 9), rng.uniform(-30, 30));
  const PlannerConfig config = fitted_to({}, rig);
  if (!check_view_of_pad({}, rig)) return;
  const Vector3 p_NB = landing_end(config, rig).p_NB;
  for (int i = 0; i < 500; ++i) {
    const double about = rng.uniform(-kPi, kPi);
    const Vector3 axis(std::cos(about), std::sin(about), 0);
    const Matrix3 R = so3_exp(axis * rng.uniform(0, config.tilt_max_deg) * kDegree) *
                      from_rpy(0, 0, rng.uniform(-10, 10) * kDegree);
    for (const Led& led : rig.leds.leds) {
      const auto uv = project_led(rig.camera, make_pose(R, p_NB), led.p_BL);
      ASSERT_TRUE(uv);
      EXPECT_TRUE(rig.camera.intrinsics.contains(*uv, config.view_border_px - 1e-6));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, OfEachEdge, testing::Range(0u, 20u));

TEST(RigFit, SaysBeyondWhichEdgeTheLedsAreAndWhatToTurn) {
  struct Case {
    double up_deg, left_deg;
    const char* edge;
    const char* turn;
  };
  for (const Case& c : {Case{20, 0, "lower edge", "turn the camera down"},
                        Case{-60, 0, "upper edge", "turn the camera up"},
                        Case{0, 50, "right edge", "turn the camera to its right"},
                        Case{0, -50, "left edge", "turn the camera to its left"}}) {
    const auto good = check_view_of_pad({}, turned_rig(c.up_deg, c.left_deg));
    ASSERT_FALSE(good) << c.edge;
    EXPECT_EQ(good.error().fault, Fault::invalid_config);
    EXPECT_NE(good.error().detail.find(c.edge), std::string::npos)
        << good.error().detail;
    EXPECT_NE(good.error().detail.find(c.turn), std::string::npos)
        << good.error().detail;
  }
}

TEST(RigFit, AnLedBelowThePadIsNamed) {
  Rig rig = alan_rig();
  rig.leds.leds[2].p_BL.z() = -0.068;
  const auto good = check_view_of_pad({}, rig);
  ASSERT_FALSE(good);
  EXPECT_NE(good.error().detail.find("leds[2].xyz_m: 8 mm below the pad"),
            std::string::npos)
      << good.error().detail;
}

TEST(RigFit, LargeAndSmallDronesLand) {
  for (const double scale : {0.5, 1.0, 2.0, 3.0, 4.0}) {
    const Rig rig = scaled_rig(scale);
    const PlannerConfig fitted = fitted_to({}, rig);
    EXPECT_GT(fitted.touch_down_height_m, drone_radius(rig)) << scale;
    EXPECT_GT(fitted.touch_down_height_m, rig.drone.gear_height_m) << scale;
    const auto planner = Planner::create({}, rig);
    ASSERT_TRUE(planner);
    const Vector3 from(-0.8 * scale, 0.1 * scale,
                       std::max(0.6 * scale, fitted.touch_down_height_m));
    const PlanResult plan = planner->plan(request_from(from));
    EXPECT_EQ(plan.status, PlanStatus::solved) << scale << ": " << plan.reason;
  }
}

}  // namespace
}  // namespace alight
