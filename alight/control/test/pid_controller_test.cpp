#include "alight/control/pid_controller.h"

#include <gtest/gtest.h>

#include "alight/geometry/drone_response.h"

namespace alight {
namespace {

PidController make(const PidControllerConfig& config = {}) {
  return PidController::create(config).value();
}

TEST(PidController, ActsInTheFrameOfThePlatform) {
  PlatformState platform;
  platform.X_IN.linear() = from_rpy(0, 0, 1.2);
  FlatState reference;
  reference.p_NB = Vector3(0.2, -0.1, 0.05);
  const PidOutput out = make().step(platform, {}, reference, 0.01);
  ASSERT_EQ(out.setpoint.kind, Setpoint::Kind::velocity);
  // Proportional plus one step of the integral.
  const Vector3 v_N = (Vector3(2.5, 2.5, 1.5) + Vector3::Constant(0.3 * 0.01))
                          .cwiseProduct(reference.p_NB);
  EXPECT_LT((out.setpoint.v_IB - platform.X_IN.linear() * v_N).norm(), 1e-12);
  const PidOutput foreign = make().step(platform, {}, reference, 0.01, -0.5);
  EXPECT_LT((foreign.setpoint.v_IB - from_rpy(0, 0, -0.5) * out.setpoint.v_IB).norm(),
            1e-12);
}

TEST(PidController, YawTakesTheShorterWay) {
  FlatState reference;
  reference.yaw = 3.1;
  RelativeState state;
  state.R_NB = from_rpy(0, 0, -3.1);
  const double rate = make().step({}, state, reference, 0.01).setpoint.yaw_rate;
  EXPECT_LT(rate, 0);
  EXPECT_GT(rate, -0.1);
}

TEST(PidController, IntegralIsClampedAndForgotten) {
  PidController pid = make();
  FlatState reference;
  reference.p_NB.x() = 0.5;
  Vector3 v;
  for (int i = 0; i < 5000; ++i) v = pid.step({}, {}, reference, 0.01).setpoint.v_IB;
  EXPECT_NEAR(v.x(), 2.5 * 0.5 + 1, 1e-9);
  pid.reset();
  EXPECT_NEAR(pid.step({}, {}, {}, 0.01).setpoint.v_IB.norm(), 0, 1e-12);
}

// As in the paper: its loop follows a platform of speed v at v / kp.
TEST(PidController, DoesNotFeedThePlatformForward) {
  PlatformState platform;
  platform.v_IN_N = Vector3(0.9, 0, 0);
  platform.w_IN_N = Vector3(0, 0, 0.6);
  RelativeState state;
  FlatState reference;
  state.p_NB = reference.p_NB = Vector3(-1.2, 0, 0.5);
  EXPECT_EQ(make().step(platform, state, reference, 0.01).setpoint.v_IB.norm(), 0);
}

TEST(PidController, LimitsAndBadInput) {
  PidController pid = make();
  FlatState reference;
  reference.p_NB = Vector3(100, 0, 0);
  const PidOutput far = pid.step({}, {}, reference, 0.01);
  EXPECT_TRUE(far.limited);
  EXPECT_LE(far.setpoint.v_IB.norm(), 3 + 1e-9);
  reference.p_NB.y() = std::nan("");
  const PidOutput bad = pid.step({}, {}, reference, 0.01);
  EXPECT_TRUE(bad.invalid);
  EXPECT_EQ(bad.setpoint.v_IB.norm(), 0);
  EXPECT_TRUE(make().step({}, {}, {}, std::nan("")).invalid);
  EXPECT_TRUE(make().step({}, {}, {}, -1).invalid);
  EXPECT_FALSE(pid.step({}, {}, {}, 0.01).invalid);

  PidControllerConfig config;
  config.kp[1] = std::nan("");
  EXPECT_FALSE(PidController::create(config));
}

TEST(PidController, LagsAPlatformBySpeedOverGain) {
  // What the paper's loop does behind a platform in steady motion: the integral aside,
  // it follows v / kp behind. Velocity set-points through the modelled autopilot.
  PidControllerConfig config;
  config.ki.setZero();
  PidController pid = make(config);
  DroneResponse drone;
  const double speed = 0.5;
  drone.reset(0, Matrix3::Identity(), kGravity, Vector3(speed, 0, 0));
  PlatformState platform;
  platform.v_IN_N = Vector3(speed, 0, 0);
  RelativeState state;
  double lag = 0;
  for (Time now = 0; now < 20'000'000'000; now += 10'000'000) {
    drone.advance(now);
    const Vector3 v = drone.at(now).v_IB;
    state.v_NB = v - platform.v_IN_N;
    state.p_NB += 0.01 * state.v_NB;
    drone.sent(pid.step(platform, state, {}, 0.01).setpoint, now + 40'000'000);
    lag = -state.p_NB.x();
  }
  EXPECT_NEAR(lag, speed / 2.5, 0.02);
}

}  // namespace
}  // namespace alight
