#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "alight/sim/odometry_sensor.h"
#include "alight/sim/platform_motion.h"
#include "alight/sim/radio.h"
#include "alight/sim/rotors.h"
#include "alight/sim/scenario.h"
#include "alight/sim/true_rig.h"
#include "alight/sim/wind.h"

namespace alight {
namespace {

TEST(Scenario, EveryNameIsFoundAgain) {
  for (int k = 0; k < 7; ++k) {
    const auto kind = static_cast<PlatformKind>(k);
    EXPECT_EQ(platform_kind(to_string(kind)), kind);
  }
  EXPECT_FALSE(platform_kind("triangle"));
  EXPECT_FALSE(fault_kind(""));
}

TEST(Scenario, NamesFieldValueAndBounds) {
  Scenario scenario;
  EXPECT_TRUE(scenario.validate());
  scenario.faults.resize(2);
  scenario.faults[1].for_s = -2;
  const auto refused = scenario.validate();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().detail, "faults[1].for_s is -2, must lie in [0, 3600]");
  scenario = {};
  scenario.wind.mean_m_s = std::nan("");
  EXPECT_FALSE(scenario.validate());
}

TEST(GroundEffect, GrowsTowardsTheGroundAndEndsAtTwoDiameters) {
  double last = 1;
  for (double z = 0.3; z > 0.04; z -= 0.001) {
    const double now = ground_effect(z, 0.0381, 0.09);
    EXPECT_GE(now, last);
    last = now;
  }
  EXPECT_EQ(ground_effect(4 * 0.0381, 0.0381, 0.09), 1);
  EXPECT_GT(last, 1.05);
  EXPECT_LT(last, 1.5);
}

TEST(Rotors, HoverCarriesTheWeightAndLagsByTheMotor) {
  const DroneSpec drone;
  Rotors rotors(drone, 1);
  const double hover = 1 / drone.thrust_to_weight;
  for (int k = 0; k < 15; ++k) {  // one time constant
    rotors.step({hover, hover, hover, hover}, true, 0.002);
  }
  EXPECT_NEAR(rotors.mean_share() / hover, 1 - std::exp(-1), 1e-9);
  for (int k = 0; k < 500; ++k) {
    rotors.step({hover, hover, hover, hover}, true, 0.002);
  }
  const Wrench wrench = rotors.wrench({1, 1, 1, 1});
  EXPECT_NEAR(wrench.force.z() / (drone.mass_kg * kGravity), 1, 0.03);
  EXPECT_LT(wrench.moment.norm(), 1e-12);
  rotors.step({9, 9, 9, 9}, true, 10);
  EXPECT_LE(rotors.mean_share(), 1);
}

TEST(TrueRig, DrawsWithTheSpreadAsked) {
  const Rig nominal = alan_rig();
  const RigErrorScenario error;
  const int draws = 400;
  double led = 0, mass = 0, frame_max = 0, mount = 0;
  for (int k = 0; k < draws; ++k) {
    const TrueRig t = draw_true_rig(nominal, error, Rng(static_cast<std::uint64_t>(k)));
    for (int i = 0; i < nominal.leds.size(); ++i) {
      led += (t.rig.leds.p_BL(i) - nominal.leds.p_BL(i)).squaredNorm();
    }
    mass = std::max(mass, std::abs(t.rig.drone.mass_kg / nominal.drone.mass_kg - 1));
    frame_max = std::max(frame_max,
                         angle_between(t.extras.R_FB, Matrix3::Identity()) / kDegree);
    mount += (t.rig.camera.X_NC.translation() - nominal.camera.X_NC.translation())
                 .squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(led / (3 * draws * nominal.leds.size())), 2e-3, 1e-4);
  EXPECT_NEAR(std::sqrt(mount / (3 * draws)), 5e-3, 5e-4);
  EXPECT_LE(mass, 0.1);
  EXPECT_GT(mass, 0.09);
  EXPECT_LE(frame_max, 5 * std::sqrt(3.0) + 0.2);
}

TEST(Wind, GustsHaveTheSpreadOfTheModel) {
  double square = 0, mean = 0, up = 0;
  int n = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    Wind wind({.mean_m_s = 2, .from_deg = 0, .gusts = Gusts::dryden}, Rng(seed));
    for (int k = 0; k < 2000; ++k) {
      const Vector3 air = wind.step(0.01, 2);
      mean += air.x();
      square += (air.x() + 2) * (air.x() + 2);
      up += air.z() * air.z();
      ++n;
    }
  }
  EXPECT_NEAR(mean / n, -2, 0.2);  // from 0 deg: towards -x
  EXPECT_NEAR(std::sqrt(square / n), 0.39, 0.1);
  EXPECT_NEAR(std::sqrt(up / n), 0.2, 0.05);
  Wind calm({.mean_m_s = 1, .from_deg = 90, .gusts = Gusts::none}, Rng(1));
  EXPECT_TRUE(calm.step(0.01, 1).isApprox(Vector3(0, -1, 0), 1e-12));
}

TEST(Radio, LatencyJitterAndLossAreAsAsked) {
  double delay = 0, square = 0;
  int arrived = 0, sent = 0, bursts = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Radio radio({}, Rng(seed));
    Time last = 0;
    for (Time t = 0; t < 60'000'000'000; t += 10'000'000) {
      radio.send(Setpoint{}, RadioEnd::drone, t);
      ++sent;
      while (const auto got = radio.receive(RadioEnd::drone, t)) {
        const double d = to_seconds(got->received - got->sent);
        EXPECT_GE(got->received, last);
        bursts += got->sent - last > 25'000'000;
        last = got->received;
        delay += d;
        square += d * d;
        ++arrived;
      }
    }
  }
  const double mean = delay / arrived;
  EXPECT_NEAR(mean, 0.040, 0.006);
  EXPECT_NEAR(std::sqrt(square / arrived - mean * mean), 0.015, 0.004);
  EXPECT_NEAR(1 - static_cast<double>(arrived) / sent, 0.02, 0.006);
}

TEST(Radio, AStallEndsInAClumpOfTheNewest) {
  RadioScenario config{
      .latency_ms = 0, .jitter_ms = 0, .loss = 0, .burst_ms = 400, .queue = 8};
  Radio radio(config, Rng(4));
  int most = 0;
  for (Time t = 0; t < 20'000'000'000; t += 10'000'000) {
    Setpoint s;
    s.thrust = to_seconds(t);
    radio.send(s, RadioEnd::drone, t);
    int clump = 0;
    while (const auto got = radio.receive(RadioEnd::drone, t)) {
      if (++clump > 1 && clump == 8) {
        EXPECT_GT(std::get<Setpoint>(got->message).thrust, to_seconds(t) - 0.2);
      }
    }
    most = std::max(most, clump);
  }
  EXPECT_GE(most, 7);
  EXPECT_LE(most, 8);
}

TEST(OdometrySensor, ErrsWithinItsBounds) {
  const OdometryScenario config;
  double widest = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    PlatformScenario drive;
    drive.kind = PlatformKind::straight;
    drive.speed_m_s = 0.5;
    PlatformMotion motion(drive, 0.26, true, Rng(seed));
    OdometrySensor sensor(config, motion.state(), Rng(seed));
    double sum = 0, turn = 0;
    int n = 0;
    PlatformOdometry event;
    for (int k = 0; k < 2000; ++k) {
      motion.step(0.002);
      sensor.step(motion.state());
      while (sensor.receive(motion.state().t, event)) {
        EXPECT_GE(event.received - event.captured, 30'000'000);
        EXPECT_LE(event.received - event.captured, 33'000'001);
        if (to_seconds(event.captured) < 1.5) continue;
        sum += event.v_IN_N.x();
        turn += event.w_IN_N.z();
        ++n;
      }
    }
    ASSERT_GT(n, 100);
    EXPECT_NEAR(sum / n, 0.5 * (1 + sensor.scale()), 0.005);
    EXPECT_NEAR(turn / n, sensor.yaw_rate_bias(), 0.005);
    EXPECT_LE(std::abs(sensor.scale()), 0.02);
    widest = std::max(widest, std::abs(sensor.scale()));
  }
  EXPECT_GT(widest, 0.017);
}

}  // namespace
}  // namespace alight
