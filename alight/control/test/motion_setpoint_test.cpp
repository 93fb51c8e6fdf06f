#include "alight/control/motion_setpoint.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr Time kTick = 10'000'000;

Setpoint leaning(double roll, double pitch, double yaw, double thrust) {
  Setpoint s;
  s.kind = Setpoint::Kind::attitude;
  s.q_IB = Eigen::Quaterniond(from_rpy(roll, pitch, yaw));
  s.thrust = thrust;
  return s;
}

TEST(MotionSetpoint, HoversAtItsOwnVelocity) {
  const DroneResponseConfig response;
  OwnMotion own;
  own.v_IB = Vector3(0.7, -0.2, 0.1);
  const Setpoint s =
      as_motion(leaning(0, 0, 0.5, 1 / response.thrust_to_weight), own, 0.3, response);
  EXPECT_EQ(s.kind, Setpoint::Kind::velocity);
  EXPECT_EQ(s.v_IB, own.v_IB);
  EXPECT_LT(s.a_IB.norm(), 1e-12);
  EXPECT_NEAR(s.yaw, 0.5, 1e-12);
  EXPECT_EQ(s.yaw_rate, 0.3);
}

// The law: whatever attitude and thrust are asked for, the autopilot's velocity loop
// makes the same force of what is sent instead, to a tenth of what it leans by.
TEST(MotionSetpoint, TheVelocityLoopMakesTheSameForceOfIt) {
  DroneResponseConfig config;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Rng rng(seed);
    DroneResponse by_attitude(config), by_motion(config);
    const Vector3 v(rng.uniform(-2, 2), rng.uniform(-2, 2), rng.uniform(-1, 1));
    by_attitude.reset(0, Matrix3::Identity(), kGravity, v);
    by_motion.reset(0, Matrix3::Identity(), kGravity, v);
    const double roll = rng.uniform(-0.2, 0.2), pitch = rng.uniform(-0.2, 0.2);
    const double thrust = rng.uniform(0.9, 1.1) / config.thrust_to_weight;
    double most = 0;
    for (Time t = kTick; t < 100 * kTick; t += kTick) {
      const Time acts = t + from_seconds(1e-3 * config.delay_ms);
      by_motion.advance(acts);
      const DroneResponse::Sample then = by_motion.at(acts);
      const OwnMotion own{then.v_IB, then.f_I() - kGravity * Vector3::UnitZ()};
      const Setpoint wished = leaning(roll, pitch, 0, thrust);
      by_attitude.sent(wished, t);
      by_motion.sent(as_motion(wished, own, 0, config), t);
      by_attitude.advance(t);
      by_motion.advance(t);
      if (t < 50 * kTick) continue;
      most = std::max(most, (by_attitude.at(t).f_I() - by_motion.at(t).f_I()).norm());
    }
    EXPECT_LT(most, 0.25) << seed;
    EXPECT_LT((by_attitude.at(99 * kTick).v_IB - by_motion.at(99 * kTick).v_IB).norm(),
              0.2)
        << seed;
  }
}

}  // namespace
}  // namespace alight
