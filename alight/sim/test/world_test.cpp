#include "alight/sim/world.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/sim/test/fly.h"

namespace alight {
namespace {

/// When a quantity that rises to one first passes a level, s; -1 if it never does.
struct Crossing {
  double level;
  double at = -1;
  void look(double value, double t) {
    if (at < 0 && value >= level) at = t;
  }
};

Scenario rough() {
  Scenario scenario;
  scenario.wind = {.mean_m_s = 1, .from_deg = 30, .gusts = Gusts::dryden};
  return scenario;
}

TEST(World, RefusesABadScenario) {
  Scenario scenario;
  scenario.radio.loss = 1.5;
  const auto world = World::create(scenario, alan_rig(), 1);
  ASSERT_FALSE(world);
  EXPECT_NE(world.error().detail.find("radio.loss is 1.5"), std::string::npos);
}

TEST(World, StandsStillWithMotorsOff) {
  const auto world = fly::make(fly::calm());
  world->advance_to(from_seconds(0.5));
  const TruthState before = world->truth();
  world->advance_to(from_seconds(3));
  const TruthState after = world->truth();
  EXPECT_LT((after.X_NB.translation() - before.X_NB.translation()).norm(), 1e-5);
  EXPECT_NEAR(after.X_NB.translation().z(), 0.06, 1e-3);
  EXPECT_TRUE(world->standing_on_pad());
  EXPECT_FALSE(world->contact().struck);
}

class WorldSeeds : public testing::TestWithParam<unsigned> {};

TEST_P(WorldSeeds, ThePadCarriesWhatStandsOnIt) {
  for (const PlatformKind kind :
       {PlatformKind::circle, PlatformKind::block, PlatformKind::boat}) {
    Scenario scenario = rough();
    scenario.platform.kind = kind;
    const auto world = fly::make(scenario, GetParam());
    const Vector3 before = world->truth().X_NB.translation();
    world->advance_to(from_seconds(10));
    const TruthState after = world->truth();
    EXPECT_GT(after.platform.v_IN_N.norm(), 0.2) << to_string(kind);
    EXPECT_LT((after.X_NB.translation() - before).norm(), 5e-3) << to_string(kind);
    EXPECT_LT(after.v_NB.norm(), 0.02) << to_string(kind);
    EXPECT_TRUE(world->standing_on_pad()) << to_string(kind);
  }
}

TEST_P(WorldSeeds, TruthAgreesWithItsOwnDerivatives) {
  const auto world = fly::make(rough(), GetParam());
  fly::take_off(*world, 3);
  const Time h = World::kStep;
  const Time t = world->truth().t - 20 * h;
  const TruthState a = world->truth_at(t - 5 * h);
  const TruthState m = world->truth_at(t);
  const TruthState b = world->truth_at(t + 5 * h);
  const double dt = to_seconds(10 * h);
  const Vector3 v_NB = (b.X_NB.translation() - a.X_NB.translation()) / dt;
  EXPECT_LT((v_NB - m.v_NB).norm(), 0.01);
  const Vector3 v_IN =
      (b.platform.X_IN.translation() - a.platform.X_IN.translation()) / dt;
  EXPECT_LT((m.platform.X_IN.linear().transpose() * v_IN - m.platform.v_IN_N).norm(),
            5e-3);
  EXPECT_TRUE(m.X_IB.isApprox(m.platform.X_IN * m.X_NB, 1e-12));
}
INSTANTIATE_TEST_SUITE_P(Seeds, WorldSeeds, testing::Range(0u, 6u));

TEST(World, RemembersInstantsBetweenSteps) {
  const auto world = fly::make(fly::calm(PlatformKind::circle));
  world->advance_to(from_seconds(3));
  const Time t = from_seconds(2.9);
  const double x0 = world->truth_at(t).platform.X_IN.translation().x();
  const double x1 = world->truth_at(t + World::kStep).platform.X_IN.translation().x();
  const double half =
      world->truth_at(t + World::kStep / 2).platform.X_IN.translation().x();
  EXPECT_NEAR(half, (x0 + x1) / 2, 1e-12);
  EXPECT_EQ(world->truth_at(from_seconds(9)).t, world->truth().t);
}

std::vector<double> story(const Scenario& scenario, std::uint64_t seed) {
  const auto world = fly::make(scenario, seed);
  fly::take_off(*world, 3);
  SensorBatch batch;
  world->collect(from_seconds(3), batch);
  std::vector<double> all;
  const Pose X = world->truth().X_NB;
  all.insert(all.end(), X.data(), X.data() + 16);
  for (const auto& o : batch.odometry) {
    all.push_back(o.v_IN_N.x());
    all.push_back(static_cast<double>(o.received));
  }
  for (const auto& a : batch.telemetry) all.push_back(a.q_IB.x());
  return all;
}

TEST(World, SameSeedSameBitsAndOthersDiffer) {
  const auto first = story(rough(), 7);
  EXPECT_EQ(first, story(rough(), 7));
  EXPECT_NE(first, story(rough(), 8));
}

TEST(World, FollowsAttitudeLikeTheRealFirmware) {
  // The second-order lag measured: 10 rad/s, damping 0.55, 40 ms late.
  Scenario scenario = fly::calm();
  const auto world = fly::make(scenario);
  fly::take_off(*world, 5);
  const double share = world->truth().rotor_share;
  // Level first: velocity control leaves some tilt of its own.
  fly::run(*world, 6, [&](const TruthState&) {
    return fly::attitude(Matrix3::Identity(), share);
  });
  const double t0 = to_seconds(world->truth().t);
  const double target = 10 * kDegree;
  double worst = 0;
  double most = 0;
  fly::run(
      *world, t0 + 1.2,
      [&](const TruthState&) { return fly::attitude(from_rpy(0, target, 0), share); },
      [&](const TruthState& x) {
        const double s = to_seconds(x.t) - t0 - 0.04;
        const double wd = 10 * std::sqrt(1 - 0.55 * 0.55);
        const double ideal =
            s < 0 ? 0
                  : 1 - std::exp(-5.5 * s) *
                            (std::cos(wd * s) + 5.5 / wd * std::sin(wd * s));
        const double pitch = -std::asin(x.X_IB(2, 0)) / target;
        worst = std::max(worst, std::abs(pitch - ideal));
        most = std::max(most, pitch);
      });
  EXPECT_LT(worst, 0.06);
  EXPECT_NEAR(most, 1.126, 0.03);
}

TEST(World, FollowsVelocityLikeTheRealFirmware) {
  // Measured: 10 % at 0.22 s, 50 % at 0.49 s, 90 % at 1.4 s, in still air and with
  // hardly any drag, which is why the drag is sent along as an acceleration here.
  Crossing c10{0.1}, c50{0.5}, c90{0.9};
  double sum10 = 0, sum50 = 0, sum90 = 0;
  const int runs = 6;
  for (int seed = 0; seed < runs; ++seed) {
    const auto world = fly::make(fly::calm(), static_cast<std::uint64_t>(seed));
    fly::take_off(*world, 5);
    const double t0 = to_seconds(world->truth().t);
    const double v0 = world->truth().v_IB.x();
    Crossing a = c10, b = c50, c = c90;
    fly::run(
        *world, t0 + 3,
        [&](const TruthState& x) {
          Setpoint s = fly::velocity({1, 0, 0});
          s.a_IB.x() = 0.35 * x.v_IB.x();
          return s;
        },
        [&](const TruthState& x) {
          const double t = to_seconds(x.t) - t0;
          const double v = (x.v_IB.x() - v0) / (1 - v0);
          a.look(v, t);
          b.look(v, t);
          c.look(v, t);
        });
    sum10 += a.at / runs;
    sum50 += b.at / runs;
    sum90 += c.at / runs;
  }
  RecordProperty("t10_ms", static_cast<int>(1e3 * sum10));
  RecordProperty("t50_ms", static_cast<int>(1e3 * sum50));
  RecordProperty("t90_ms", static_cast<int>(1e3 * sum90));
  EXPECT_NEAR(sum10, 0.22, 0.05);
  EXPECT_NEAR(sum50, 0.49, 0.08);
  EXPECT_NEAR(sum90, 1.4, 0.3);
}

TEST(World, ALostLinkEndsInTheAutopilotsOwnLanding) {
  for (const bool external_pose : {true, false}) {
    Scenario scenario = fly::calm();
    scenario.autopilot.external_pose = external_pose;
    scenario.start.place = StartPlace::floor;
    scenario.faults = {{.kind = FaultKind::radio_out, .at_s = 5, .for_s = 100}};
    const auto world = fly::make(scenario, 3);
    world->send(AutopilotOrder::arm, 0);
    fly::run(*world, 5, [&](const TruthState& x) {
      const double climb = 0.8 - x.X_IB.translation().z() - 0.5 * x.v_IB.z();
      return fly::attitude(Matrix3::Identity(), 0.4 * (1 + 0.3 * climb));
    });
    ASSERT_TRUE(world->contact().flown);
    EXPECT_TRUE(world->truth().motors_running);
    world->advance_to(from_seconds(13));
    // Without a velocity the firmware only descends, and nothing stops its motors.
    EXPECT_EQ(world->truth().motors_running, !external_pose);
    EXPECT_LT(world->truth().X_IB.translation().z(), 0.5) << external_pose;
    EXPECT_FALSE(world->contact().struck) << world->contact().struck_what;
  }
}

TEST(World, JudgesALandingByTheMotionThatMetThePad) {
  const auto world = fly::make(fly::calm());
  fly::take_off(*world, 3);
  EXPECT_FALSE(world->contact().touched_down);
  const Pose start = world->truth().X_NB;
  fly::run(*world, 9, [&](const TruthState& x) {
    const Vector3 p = x.X_NB.translation();
    return fly::velocity({-p.x(), -p.y(), -0.3});
  });
  const ContactReport& report = world->contact();
  ASSERT_TRUE(report.touched_down) << start.translation().z();
  EXPECT_NEAR(report.relative_speed_m_s, 0.3, 0.2);
  EXPECT_LT(report.tilt_deg, 6);
  EXPECT_FALSE(report.struck) << report.struck_what;
  EXPECT_FALSE(report.landed_elsewhere);
  world->send(AutopilotOrder::disarm, world->truth().t);
  world->advance_to(from_seconds(10));
  EXPECT_FALSE(world->truth().motors_running);
  EXPECT_TRUE(world->standing_on_pad());
}

TEST(World, BurningHoverShareDoesNotLift) {
  const auto world = fly::make(fly::calm());
  world->send(AutopilotOrder::arm, 0);
  fly::run(*world, 2,
           [](const TruthState&) { return fly::attitude(Matrix3::Identity(), 0.3); });
  EXPECT_TRUE(world->standing_on_pad());
  EXPECT_FALSE(world->contact().flown);
}

}  // namespace
}  // namespace alight
