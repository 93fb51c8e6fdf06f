#include "alight/control/attitude_controller.h"

#include <gtest/gtest.h>

#include "alight/control/test/attitude_loop.h"

namespace alight {
namespace {

AttitudeLoop circle() {
  AttitudeLoop loop;
  loop.speed_m_s = 0.9;
  return loop;
}

AttitudeInput at_rest() {
  AttitudeInput in;
  in.state.p_NB = in.reference.p_NB = Vector3(-1, 0, 1);
  return in;
}

AttitudeController standard() { return AttitudeController::create({}, {}, {}).value(); }

TEST(AttitudeController, HoversLevelWhereItShouldBe) {
  const AttitudeOutput out = standard().step(at_rest(), 0.01);
  EXPECT_EQ(out.setpoint.kind, Setpoint::Kind::attitude);
  EXPECT_NEAR(out.setpoint.q_IB.angularDistance(Eigen::Quaterniond::Identity()), 0,
              1e-9);
  EXPECT_NEAR(out.setpoint.thrust, 1 / DroneSpec{}.thrust_to_weight, 1e-9);
  EXPECT_FALSE(out.limited);
  EXPECT_FALSE(out.invalid);
}

TEST(AttitudeController, LeansTowardsTheErrorAndAgainstTheDisturbance) {
  AttitudeInput in = at_rest();
  in.reference.p_NB.x() += 0.1;
  EXPECT_GT(standard().step(in, 0.01).setpoint.q_IB.toRotationMatrix()(0, 2), 0.01);
  in = at_rest();
  in.d_N = Vector3(0, 1, 0);
  EXPECT_LT(standard().step(in, 0.01).setpoint.q_IB.toRotationMatrix()(1, 2), -0.05);
  in = at_rest();
  in.d_N = Vector3(0, 0, -1);
  EXPECT_GT(standard().step(in, 0.01).setpoint.thrust,
            1.05 / DroneSpec{}.thrust_to_weight);
}

// More thrust makes up for thrust that is lacking, along whatever it points.
TEST(AttitudeController, ThrustThatIsLackingIsGivenWithoutLeaningMore) {
  AttitudeInput in = at_rest();
  in.platform.a_IN_N = in.platform_later.a_IN_N = Vector3(0, 1, 0);
  in.state.v_NB.setZero();
  AttitudeControllerConfig config;
  config.ka = config.ka_z = 0;  // the model's force is not looked at
  const auto step = [&] {
    return AttitudeController::create(config, {}, {}).value().step(in, 0.01).setpoint;
  };
  const Setpoint as_supposed = step();
  in.b_N.z() = -0.1 * kGravity;
  const Setpoint heavy = step();
  EXPECT_LT(heavy.q_IB.angularDistance(as_supposed.q_IB), 1e-9);
  EXPECT_NEAR(heavy.thrust, as_supposed.thrust / 0.9, 1e-9);
}

TEST(AttitudeController, WithoutFeedForwardATurnIsNotLeantInto) {
  AttitudeInput in = at_rest();
  in.platform.a_IN_N = in.platform_later.a_IN_N = Vector3(0, 0.5, 0);
  in.state.v_NB.setZero();
  const auto lean = [&](bool feed_forward) {
    AttitudeControllerConfig config;
    config.feed_forward = feed_forward;
    config.ka = config.ka_z = 0;  // what is left is forward or nothing
    AttitudeController controller = AttitudeController::create(config, {}, {}).value();
    return controller.step(in, 0.01).setpoint.q_IB.toRotationMatrix()(1, 2);
  };
  EXPECT_NEAR(lean(true), 0.5 / kGravity, 2e-3);
  EXPECT_NEAR(lean(false), 0, 1e-12);
}

TEST(AttitudeController, TurnsWithTheAutopilotsHeading) {
  // The same situation told in an inertial frame whose heading differs by h.
  AttitudeInput in = at_rest();
  in.reference.p_NB += Vector3(0.1, -0.05, 0.1);
  in.d_N = Vector3(0.3, 0.2, -0.1);
  const Matrix3 R = standard().step(in, 0.01).setpoint.q_IB.toRotationMatrix();
  for (const double h : {-2.0, 0.7, 3.0}) {
    AttitudeInput turned = in;
    turned.autopilot_heading = h;
    turned.response.R_IB = from_rpy(0, 0, h);
    const Matrix3 R_h = standard().step(turned, 0.01).setpoint.q_IB.toRotationMatrix();
    EXPECT_LT(angle_between(from_rpy(0, 0, h) * R, R_h), 1e-9);
  }
}

TEST(AttitudeController, KeepsItsBounds) {
  Rng rng(5);
  AttitudeController controller = standard();
  for (int i = 0; i < 2000; ++i) {
    AttitudeInput in;
    for (int k = 0; k < 3; ++k) {
      in.state.p_NB[k] = rng.normal(0, 5);
      in.state.v_NB[k] = rng.normal(0, 5);
      in.reference.a_NB[k] = rng.normal(0, 5);
      in.d_N[k] = rng.normal(0, 5);
    }
    in.reference.yaw = rng.uniform(-3, 3);
    in.tilt_limit_rad = rng.uniform(0, 0.8);
    in.response.R_IB = from_rpy(rng.normal(0, 1), rng.normal(0, 1), rng.uniform(-3, 3));
    const AttitudeOutput out = controller.step(in, 0.01);
    const double tilt =
        std::acos(std::min(1.0, out.setpoint.q_IB.toRotationMatrix()(2, 2)));
    const double allowed =
        std::min(in.tilt_limit_rad, DroneSpec{}.tilt_max_deg * kDegree);
    EXPECT_LE(tilt, allowed + 1e-6);
    EXPECT_GE(out.setpoint.thrust, controller.config().thrust_min);
    EXPECT_LE(out.setpoint.thrust, controller.config().thrust_max);
  }
}

TEST(AttitudeController, NanGivesLevelHoverAndSaysSo) {
  const auto expect_level = [](AttitudeInput in, Seconds dt) {
    AttitudeController controller = standard();
    const AttitudeOutput out = controller.step(in, dt);
    EXPECT_TRUE(out.invalid);
    EXPECT_NEAR(out.setpoint.q_IB.toRotationMatrix()(2, 2), 1, 1e-12);
    EXPECT_NEAR(out.setpoint.thrust, 1 / DroneSpec{}.thrust_to_weight, 1e-12);
    // and the next good input is served as if nothing had been
    EXPECT_FALSE(controller.step(at_rest(), 0.01).invalid);
  };
  const double nan = std::nan("");
  AttitudeInput in = at_rest();
  in.state.v_NB.x() = nan;
  expect_level(in, 0.01);
  in = at_rest();
  in.reference.j_NB.z() = nan;
  expect_level(in, 0.01);
  in = at_rest();
  in.response.R_IB(1, 1) = nan;
  expect_level(in, 0.01);
  in = at_rest();
  in.d_N.z() = INFINITY;
  expect_level(in, 0.01);
  in = at_rest();
  in.platform.w_IN_N.z() = nan;
  expect_level(in, 0.01);
  expect_level(at_rest(), nan);
}

TEST(AttitudeController, RefusesSettingsOutOfRange) {
  AttitudeControllerConfig config;
  config.kp = -1;
  const auto made = AttitudeController::create(config, {}, {});
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().fault, Fault::invalid_config);
  EXPECT_NE(made.error().detail.find("attitude.kp is -1"), std::string::npos);
  DroneSpec weak;
  weak.thrust_to_weight = 1;
  EXPECT_FALSE(AttitudeController::create({}, {}, weak));
}

TEST(AttitudeLoop, FollowsTheCircleExactlyWithoutNoise) {
  AttitudeLoop loop = circle();
  loop.disturbance_I = Vector3(0.8, 0, -0.6);
  loop.drag_per_s = loop.model.gains.drag_per_s;
  const auto r = loop.run(20, 10);
  EXPECT_LT(r.rms_m, 0.01);
  RecordProperty("rms_mm", static_cast<int>(1000 * r.rms_m));
}

TEST(AttitudeLoop, PaysForAirResistanceThatItDoesNotKnow) {
  // The rest turns with the platform, behind which this filter's disturbance lags.
  AttitudeLoop loop = circle();
  loop.drag_per_s = 0.35;
  EXPECT_LT(loop.run(20, 10).rms_m, 0.03);
}

TEST(AttitudeLoop, WithNoise) {
  AttitudeLoop loop = circle();
  loop.disturbance_I = Vector3(0.8, 0, -0.6);
  loop.position_noise_m = 0.01;
  loop.velocity_noise_m_s = 0.05;
  loop.filter_sd_m = 0.01;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    loop.seed = seed;
    EXPECT_LT(loop.run(16, 8).rms_m, 0.06) << seed;
  }
}

TEST(AttitudeLoop, StandsFiftyMillisecondsMore) {
  AttitudeLoop loop = circle();
  loop.error.extra_delay = 0.050;
  loop.disturbance_I = Vector3(0.8, 0, -0.6);
  const auto r = loop.run(20, 10);
  EXPECT_LT(r.rms_m, 0.03);
  EXPECT_LT(r.last_rms_m, 0.03);
}

TEST(AttitudeLoop, StandsTheWrongThrustAndLag) {
  for (const double thrust : {0.8, 1.2}) {
    for (const double omega : {0.8, 1.2}) {
      AttitudeLoop loop = circle();
      loop.error = {thrust, omega, 0.02};
      const auto r = loop.run(30, 20);
      // Stable; the rest is the disturbance that a wrong thrust makes, which turns with
      // the platform while d_N is taken as fixed in I.
      EXPECT_LT(r.rms_m, 0.12) << thrust << ' ' << omega;
    }
  }
}

TEST(AttitudeLoop, FliesInAForeignHeadingFrame) {
  AttitudeLoop loop = circle();
  loop.autopilot_heading = 2.2;
  loop.drag_per_s = loop.model.gains.drag_per_s;
  EXPECT_LT(loop.run(10, 5).rms_m, 0.01);
}

TEST(AttitudeLoop, SurvivesNanEverySeventhStep) {
  AttitudeLoop loop = circle();
  loop.poison = true;
  EXPECT_LT(loop.run(16, 10).rms_m, 0.05);
}

}  // namespace
}  // namespace alight
