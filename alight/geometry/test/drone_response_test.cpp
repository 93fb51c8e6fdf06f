#include "alight/geometry/drone_response.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr Time kMs = 1'000'000;

Setpoint attitude(const Matrix3& R, double thrust = 0.4) {
  Setpoint s;
  s.kind = Setpoint::Kind::attitude;
  s.q_IB = Eigen::Quaterniond(R);
  s.thrust = thrust;
  return s;
}

/// Step response of a second-order lag, closed form.
double lag_step(double t, double w0, double zeta) {
  if (t <= 0) return 0;
  const double wd = w0 * std::sqrt(1 - zeta * zeta);
  return 1 - std::exp(-zeta * w0 * t) *
                 (std::cos(wd * t) + zeta * w0 / wd * std::sin(wd * t));
}

TEST(DroneResponse, FollowsAsTheLagItIsSaidToBe) {
  for (const auto& axis : {Vector3(1, 0, 0), Vector3(0, 1, 0), Vector3(0, 0, 1)}) {
    DroneResponse drone;
    drone.reset(0, Matrix3::Identity());
    const double angle = 0.3;
    drone.sent(attitude(so3_exp(angle * axis)), 103 * kMs);  // not on the grid
    drone.advance(500 * kMs);
    const auto& c = drone.config();
    for (Time t = 0; t <= 500 * kMs; t += 7 * kMs) {
      const double dt = to_seconds(t) - 0.103 - c.delay_ms * 1e-3;
      const double expected = angle * lag_step(dt, c.omega_rad_s, c.zeta);
      EXPECT_NEAR(so3_log(drone.at(t).R_IB).dot(axis), expected, 0.002 * angle);
    }
  }
}

TEST(DroneResponse, ThrustLags) {
  DroneResponse drone;
  drone.reset(0, Matrix3::Identity());
  drone.sent(attitude(Matrix3::Identity(), 0.6), 0);
  drone.advance(400 * kMs);
  const auto& c = drone.config();
  const double full = c.thrust_to_weight * kGravity;
  for (Time t = 0; t <= 400 * kMs; t += 10 * kMs) {
    const double dt = std::max(0.0, to_seconds(t) - c.thrust_delay_ms * 1e-3);
    const double expected =
        0.6 * full + (kGravity - 0.6 * full) * std::exp(-dt / (c.motor_ms * 1e-3));
    EXPECT_NEAR(drone.at(t).thrust_m_s2, expected, 1e-3);
  }
}

TEST(DroneResponse, DoesNotDependOnHowOftenItIsAsked) {
  // The same set-points, told early or late, advanced in many steps or in few.
  Rng rng(4);
  DroneResponse often, seldom;
  often.reset(0, Matrix3::Identity());
  seldom.reset(0, Matrix3::Identity());
  for (Time now = 0; now < 600 * kMs; now += 10 * kMs) {
    const Setpoint s = attitude(from_rpy(rng.normal(0, 0.2), rng.normal(0, 0.2), 0),
                                rng.uniform(0.3, 0.5));
    often.advance(now + 80 * kMs);
    often.sent(s, now + 43 * kMs);
    seldom.sent(s, now + 43 * kMs);
  }
  often.advance(640 * kMs);
  seldom.advance(640 * kMs);
  for (Time t = 0; t <= 640 * kMs; t += 5 * kMs) {
    EXPECT_EQ(often.at(t).R_IB, seldom.at(t).R_IB);
    EXPECT_EQ(often.at(t).thrust_m_s2, seldom.at(t).thrust_m_s2);
  }
}

TEST(DroneResponse, TheNewestSetpointWins) {
  DroneResponse a, b;
  a.reset(0, Matrix3::Identity());
  b.reset(0, Matrix3::Identity());
  a.sent(attitude(from_rpy(0.5, 0, 0)), 60 * kMs);
  a.sent(attitude(from_rpy(0, 0.2, 0)), 50 * kMs);  // overtakes
  b.sent(attitude(from_rpy(0, 0.2, 0)), 50 * kMs);
  a.advance(400 * kMs);
  b.advance(400 * kMs);
  EXPECT_EQ(a.at(400 * kMs).R_IB, b.at(400 * kMs).R_IB);
}

TEST(DroneResponse, KeepsItsHistoryAndNoMore) {
  DroneResponse drone;
  drone.reset(0, Matrix3::Identity());
  for (Time now = 0; now < 20'000 * kMs; now += 10 * kMs) {
    drone.advance(now + 80 * kMs);
    drone.sent(attitude(from_rpy(0.1 * std::sin(to_seconds(now)), 0, 0)),
               now + 40 * kMs);
    if (now > 1'000 * kMs) {
      ASSERT_LE(drone.oldest(), now - DroneResponse::kHistory);
      ASSERT_EQ(drone.newest(), now + 80 * kMs);
    }
  }
  // A silence of hours is a matter of microseconds, and ends in a sane state.
  drone.advance(20'000'000 * kMs);
  EXPECT_TRUE(drone.at(drone.newest()).R_IB.allFinite());
}

TEST(DroneResponse, HoldsBeforeTheFirstSetpoint) {
  DroneResponse drone;
  drone.reset(7 * kMs, from_rpy(0, 0, 1));
  drone.advance(300 * kMs);
  EXPECT_LT(angle_between(drone.at(300 * kMs).R_IB, from_rpy(0, 0, 1)), 1e-12);
  EXPECT_NEAR(drone.at(300 * kMs).thrust_m_s2, kGravity, 1e-12);
}

TEST(DroneResponse, IsDrawnToTheReportedAttitude) {
  DroneResponse drone;
  drone.reset(0, Matrix3::Identity());
  const Matrix3 truth = from_rpy(0.02, -0.03, 0.4);
  for (Time now = 0; now < 2'000 * kMs; now += 20 * kMs) {
    drone.sent(attitude(truth), now + 40 * kMs);  // what it holds anyway
    drone.advance(now + 80 * kMs);
    drone.correct(now - 40 * kMs, truth, Vector3::Zero());
  }
  EXPECT_LT(angle_between(drone.at(1'900 * kMs).R_IB, truth), 1e-3);
  // One report moves what comes after it by the share given, what came before not.
  DroneResponse once;
  once.reset(0, Matrix3::Identity());
  once.advance(200 * kMs);
  const double share = once.config().attitude_share;
  once.correct(100 * kMs, from_rpy(0, 0, 0.5), Vector3::Zero());
  EXPECT_NEAR(yaw_of(once.at(150 * kMs).R_IB), share * 0.5, 1e-9);
  EXPECT_NEAR(yaw_of(once.at(50 * kMs).R_IB), 0, 1e-12);
}

TEST(DroneResponse, LearnsTheMomentThatNobodyCommanded) {
  // Reports of a drone that a steady moment holds 0.1 rad off what it was sent.
  const Matrix3 commanded = Matrix3::Identity(), truth = from_rpy(0.1, 0, 0);
  DroneResponse knowing, ignorant;
  for (DroneResponse* drone : {&knowing, &ignorant}) drone->reset(0, truth);
  for (Time now = 0; now < 1'000 * kMs; now += 20 * kMs) {
    for (DroneResponse* drone : {&knowing, &ignorant}) {
      drone->sent(attitude(commanded), now + 40 * kMs);
      drone->advance(now + 80 * kMs);
    }
    knowing.correct(now, truth, Vector3::Zero());
  }
  const auto off = [&](const DroneResponse& drone) {
    return angle_between(drone.at(1'050 * kMs).R_IB, truth);
  };
  EXPECT_LT(off(knowing), 0.5 * off(ignorant));
}

TEST(DroneResponse, VelocityStepAsMeasured) {
  // PX4 1.16: 10 % at 0.22 s, 50 % at 0.49 s, 90 % at 1.4 s after a step of 1 m/s.
  DroneResponse drone;
  drone.reset(0, Matrix3::Identity());
  Setpoint s;
  s.kind = Setpoint::Kind::velocity;
  s.v_IB.x() = 1;
  drone.sent(s, 0);
  double t10 = 0, t50 = 0, t90 = 0;
  for (Time t = 0; t < 3'000 * kMs; t += 10 * kMs) {
    drone.sent(s, t);
    drone.advance(t);
    const double v = drone.at(t).v_IB.x();
    if (v < 0.1) t10 = to_seconds(t);
    if (v < 0.5 && t50 <= t10 + 2) t50 = to_seconds(t);
    if (v < 0.9 && t < 2'000 * kMs && t90 <= to_seconds(t)) t90 = to_seconds(t);
    if (v >= 0.9) break;
  }
  EXPECT_NEAR(t10, 0.22, 0.06);
  EXPECT_NEAR(t50, 0.49, 0.12);
  EXPECT_GT(t90, 0.7);
  EXPECT_LT(t90, 1.6);
  EXPECT_NEAR(drone.at(drone.newest()).v_IB.z(), 0, 0.05);
}

TEST(DroneResponse, IgnoresWhatIsNoNumber) {
  DroneResponse a, b;
  a.reset(0, Matrix3::Identity());
  b.reset(0, Matrix3::Identity());
  Setpoint bad = attitude(Matrix3::Identity());
  bad.thrust = std::nan("");
  a.sent(bad, 0);
  bad = attitude(Matrix3::Identity());
  bad.q_IB.coeffs().setZero();
  a.sent(bad, 0);
  a.sent(Setpoint{}, 0);
  const double nan = std::nan("");
  a.correct(0, Matrix3::Constant(nan), Vector3::Zero());
  a.correct(0, from_rpy(1, 0, 0), Vector3::Constant(nan));
  a.correct(-500 * kMs, from_rpy(1, 0, 0), Vector3::Ones());
  a.advance(200 * kMs);
  b.advance(200 * kMs);
  EXPECT_EQ(a.at(200 * kMs).R_IB, b.at(200 * kMs).R_IB);
  EXPECT_EQ(a.at(200 * kMs).thrust_m_s2, b.at(200 * kMs).thrust_m_s2);
}

TEST(DroneResponseConfig, NamesWhatIsWrong) {
  EXPECT_TRUE(DroneResponseConfig{}.validate());
  DroneResponseConfig config;
  config.zeta = std::nan("");
  const auto r = config.validate();
  ASSERT_FALSE(r);
  EXPECT_NE(r.error().detail.find("response.zeta"), std::string::npos);
}

}  // namespace
}  // namespace alight
