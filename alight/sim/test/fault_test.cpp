#include "alight/sim/fault.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "alight/sim/camera_faults.h"
#include "alight/sim/camera_renderer.h"
#include "alight/sim/radio.h"
#include "alight/sim/test/fly.h"

namespace alight {
namespace {

constexpr Time kTick = 10'000'000;

std::vector<FaultKind> all_kinds() {
  std::vector<FaultKind> all;
  for (int k = 0; k < kFaultKinds; ++k) all.push_back(static_cast<FaultKind>(k));
  return all;
}

TEST(Fault, EveryNameIsFoundAgainAndOccursOnce) {
  std::set<std::string> names;
  for (const FaultKind kind : all_kinds()) {
    EXPECT_EQ(fault_kind(to_string(kind)), kind);
    EXPECT_TRUE(names.insert(to_string(kind)).second);
  }
  EXPECT_FALSE(fault_kind("led_deaf"));
}

TEST(Fault, DefaultsLieWithinTheBoundsAndNothingBesides) {
  for (const FaultKind kind : all_kinds()) {
    Scenario scenario;
    scenario.faults = {{.kind = kind, .at_s = 1}};
    EXPECT_TRUE(scenario.validate()) << to_string(kind);
    for (const FaultParameter& p : fault_parameters(kind)) {
      for (const double bad : {p.low - 1, p.high + 1, std::nan("")}) {
        scenario.faults[0] = {.kind = kind};
        scenario.faults[0].*p.value = bad;
        const auto refused = scenario.validate();
        ASSERT_FALSE(refused) << to_string(kind) << ' ' << p.name << ' ' << bad;
        EXPECT_EQ(refused.error().detail.find(std::string("faults[0].") + p.name), 0u);
      }
    }
  }
}

TEST(Fault, ALedIsAWholeNumberThatTheRigHas) {
  Scenario scenario = fly::calm();
  scenario.faults = {{.kind = FaultKind::led_dead}};
  scenario.faults[0].led = 1.5;
  ASSERT_FALSE(scenario.validate());
  EXPECT_EQ(scenario.validate().error().detail, "faults[0].led must be a whole number");
  scenario.faults[0].led = 6;
  const auto world = World::create(scenario, alan_rig(), 1);
  ASSERT_FALSE(world);
  EXPECT_EQ(world.error().detail, "faults[0].led is 6, the rig has LEDs 0 to 5");
}

TEST(Fault, IsOnFromItsBeginToJustBeforeItsEnd) {
  const std::vector<FaultScenario> faults{
      {.kind = FaultKind::gust, .at_s = 2, .for_s = 1}};
  const auto on = [&](double t) {
    return active_fault(faults, FaultKind::gust, from_seconds(t)) != nullptr;
  };
  EXPECT_FALSE(on(1.999));
  EXPECT_TRUE(on(2));
  EXPECT_TRUE(on(2.999));
  EXPECT_FALSE(on(3));
  EXPECT_EQ(active_fault(faults, FaultKind::radio_out, from_seconds(2.5)), nullptr);
}

/// What the brain is told and what the drone does, as numbers, from a flight.
std::vector<double> story(const std::vector<FaultScenario>& faults, unsigned seed) {
  Scenario scenario;
  scenario.faults = faults;
  const auto world = fly::make(scenario, seed);
  std::vector<double> all;
  SensorBatch batch;
  const auto listen = [&](const TruthState& x) {
    batch.clear();
    world->collect(x.t, batch);
    for (const auto& o : batch.odometry) {
      all.push_back(o.X_IN.translation().x());
      all.push_back(o.v_IN_N.y());
      all.push_back(o.resets);
    }
    for (const auto& a : batch.telemetry) {
      all.push_back(a.q_IB.z());
      all.push_back(a.armed ? 1 : 0);
      all.push_back(a.battery);
      all.push_back(static_cast<double>(a.mode));
      all.push_back(static_cast<double>(a.received));
    }
  };
  world->send(AutopilotOrder::arm, 0);
  const double floor = world->truth().X_IB.translation().z();
  fly::run(
      *world, 4,
      [&](const TruthState& x) {
        const double climb = floor + 1.5 - x.X_IB.translation().z();
        return fly::velocity(Vector3(0, 0, std::clamp(climb, -0.5, 0.8)));
      },
      listen);
  const Pose X = world->truth().X_IB;
  all.insert(all.end(), X.data(), X.data() + 16);
  return all;
}

TEST(Fault, EachOfTheWorldsChangesTheStoryAndTheSameSeedRepeatsIt) {
  const std::set<FaultKind> the_callers{
      FaultKind::led_dead,         FaultKind::led_flicker,
      FaultKind::led_dim,          FaultKind::camera_out,
      FaultKind::camera_late,      FaultKind::camera_repeat,
      FaultKind::camera_freeze,    FaultKind::camera_noise,
      FaultKind::camera_glare,     FaultKind::camera_exposure,
      FaultKind::camera_occlusion, FaultKind::other_drone,
      FaultKind::depth_out,        FaultKind::depth_wrong,
      FaultKind::computer_stall,   FaultKind::planner_late,
      FaultKind::operator_hold,    FaultKind::operator_abort};
  for (const unsigned seed : {1u, 2u}) {
    const auto well = story({}, seed);
    for (const FaultKind kind : all_kinds()) {
      // Before the start for what would come too late to be noticed.
      const bool early = kind == FaultKind::autopilot_refuse;
      const std::vector<FaultScenario> fault{
          {.kind = kind, .at_s = early ? 0.0 : 2.7, .for_s = 1}};
      const auto with = story(fault, seed);
      EXPECT_EQ(with, story(fault, seed)) << to_string(kind);
      EXPECT_EQ(with == well, the_callers.contains(kind)) << to_string(kind);
    }
  }
}

TEST(Fault, NothingHappensBeforeItsTime) {
  for (const FaultKind kind : all_kinds()) {
    EXPECT_EQ(story({{.kind = kind, .at_s = 4.5}}, 3), story({}, 3)) << to_string(kind);
  }
}

TEST(Fault, AStalledRadioLetsGoAllAtOnce) {
  RadioScenario config{.latency_ms = 20, .jitter_ms = 5, .loss = 0};
  Radio radio(config, Rng(1));
  const Time begin = 100 * kTick, end = 130 * kTick;
  int late = 0, at_end = 0;
  for (Time t = 0; t < 200 * kTick; t += kTick) {
    if (t >= begin && t < end) radio.hold(end);
    radio.send(Setpoint{}, RadioEnd::drone, t);
    while (const auto got = radio.receive(RadioEnd::drone, t)) {
      late += t >= begin && t < end;
      at_end += t == end;
    }
  }
  EXPECT_EQ(late, 0);
  EXPECT_GE(at_end, 27);  // 30 sent within, and what was under way; the queue holds 32
  EXPECT_LE(at_end, 32);
}

TEST(Fault, WhatIsLostOneWayStillGoesTheOther) {
  for (const bool up : {true, false}) {
    Scenario scenario = fly::calm();
    scenario.faults = {{.kind = up ? FaultKind::uplink_out : FaultKind::telemetry_out,
                        .at_s = 0.5,
                        .for_s = 10}};
    const auto world = fly::make(scenario);
    SensorBatch batch;
    world->advance_to(from_seconds(0.6));
    world->collect(world->truth().t, batch);
    batch.clear();
    world->send(AutopilotOrder::arm, world->truth().t);
    world->advance_to(from_seconds(1.4));
    world->collect(world->truth().t, batch);
    EXPECT_EQ(world->truth().motors_running, !up);
    EXPECT_EQ(batch.telemetry.empty(), !up);
  }
}

/// How far the drone gets over the ground and how fast it sinks once the radio is gone.
struct Alone {
  double drift = 0, sink = 0;
  bool stopped = false;
  AutopilotMode mode = AutopilotMode::manual;
};
Alone left_alone(LinkLossAction action, bool external_pose, double wind = 0) {
  Scenario scenario = fly::calm();
  scenario.autopilot.external_pose = external_pose;
  scenario.autopilot.link_loss = action;
  scenario.wind.mean_m_s = wind;
  scenario.faults = {{.kind = FaultKind::radio_out, .at_s = 6, .for_s = 1000}};
  const auto world = fly::make(scenario);
  fly::take_off(*world, 6);
  const Vector3 from = world->truth().X_IB.translation();
  Alone alone;
  for (double t = 6; t < 16; t += 0.02) {
    world->advance_to(from_seconds(t));
    const TruthState& x = world->truth();
    if (x.mode == AutopilotMode::failsafe) alone.mode = x.mode;
    if (world->contact().feet_on_pad + world->contact().feet_on_floor > 0) break;
    alone.drift = std::max(alone.drift, (x.X_IB.translation() - from).head<2>().norm());
    alone.sink = std::max(alone.sink, -x.v_IB.z());
  }
  world->advance_to(from_seconds(25));
  alone.stopped = !world->truth().motors_running;
  return alone;
}

TEST(LostLink, WithExternalPoseItLandsAndDisarms) {
  const Alone calm = left_alone(LinkLossAction::land, true);
  EXPECT_EQ(calm.mode, AutopilotMode::failsafe);
  EXPECT_TRUE(calm.stopped);
  EXPECT_LT(calm.drift, 0.5);
  EXPECT_GT(calm.sink, 0.45);
  EXPECT_LT(calm.sink, 0.7);
}

/// What its autopilot takes for hover thrust, of what is; 0 is right.
double hover_off(const Scenario& scenario, std::uint64_t seed) {
  const auto world = fly::make(scenario, seed);
  world->send(AutopilotOrder::arm, world->truth().t);
  double share = 0;
  int n = 0;
  fly::run(
      *world, 0.9, [](const TruthState&) { return fly::velocity(Vector3::Zero()); },
      [&](const TruthState& x) {
        if (x.t < from_seconds(0.6)) return;
        share += x.rotor_share;
        ++n;
      });
  const DroneSpec nominal = alan_rig().drone;
  const TrueRig& truth = world->true_rig();
  const double hover = truth.rig.drone.mass_kg / nominal.mass_kg /
                       truth.extras.thrust_scale / nominal.thrust_to_weight;
  return share / n / hover - 1;
}

TEST(LostLink, ItsHoverThrustIsThatOfTheDroneThatFliesNotOfTheRigFile) {
  Scenario scenario = fly::calm();
  scenario.rig_error.mass = 0.1;
  scenario.rig_error.thrust = 0.1;
  double mean = 0, spread = 0;
  const int seeds = 20;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    scenario.autopilot.hover_error = 0;
    const double known = hover_off(scenario, seed);
    scenario.autopilot.hover_error = 0.03;
    const double off = hover_off(scenario, seed) - known;
    EXPECT_LT(std::abs(off), 0.035) << seed;
    mean += known / seeds;
    spread += off * off / seeds;
  }
  EXPECT_NEAR(mean, 0, 0.03);  // its velocity's noise, and the motors' lag
  EXPECT_NEAR(std::sqrt(spread), 0.03 / std::sqrt(3), 0.007);
}

TEST(LostLink, ItBrakesForAsLongAsItBelievesItsVelocity) {
  const auto speed_after = [](double blind_after_ms) {
    Scenario scenario = fly::calm();
    scenario.autopilot.blind_after_ms = blind_after_ms;
    scenario.faults = {{.kind = FaultKind::radio_out, .at_s = 6, .for_s = 1000}};
    const auto world = fly::make(scenario);
    fly::take_off(*world, 5);
    fly::run(*world, 6,
             [](const TruthState&) { return fly::velocity(Vector3(1.5, 0, 0)); });
    world->advance_to(from_seconds(7.8));
    return world->truth().v_IB.head<2>().norm();
  };
  EXPECT_LT(speed_after(2000), 0.6 * speed_after(400));
}

TEST(LostLink, BeforeTheTakeOffItStandsOnTheMovingPadAndDisarms) {
  Scenario scenario = fly::calm(PlatformKind::circle);
  scenario.start.platform_moving = true;
  scenario.faults = {{.kind = FaultKind::radio_out, .at_s = 2, .for_s = 1000}};
  const auto world = fly::make(scenario);
  world->advance_to(from_seconds(1));
  world->send(AutopilotOrder::arm, world->truth().t);
  Setpoint level;  // no thrust
  level.kind = Setpoint::Kind::attitude;
  fly::run(*world, 2, [&](const TruthState&) { return level; });
  ASSERT_TRUE(world->truth().motors_running);
  ASSERT_GT(world->truth().v_IB.norm(), 0.2) << "the pad stands";
  const Vector3 stood = world->truth().X_NB.translation();
  world->advance_to(from_seconds(6));
  EXPECT_FALSE(world->truth().motors_running);
  EXPECT_LT((world->truth().X_NB.translation() - stood).norm(), 0.003);
}

TEST(LostLink, WithoutPoseItSinksAMetreAndAHalfInThreeSecondsAndNeverStops) {
  const Alone blind = left_alone(LinkLossAction::land, false);
  EXPECT_FALSE(blind.stopped);
  EXPECT_NEAR(blind.sink, 0.5, 0.15);
}

TEST(LostLink, ToDriftIsToStayUpAndGoWithTheWind) {
  const Alone adrift = left_alone(LinkLossAction::drift, false, 2);
  EXPECT_FALSE(adrift.stopped);
  EXPECT_GT(adrift.drift, 1.5);
  EXPECT_LT(adrift.sink, 0.5);
}

// Pictures.

SceneAt in_view() {
  SceneAt scene;
  scene.X_IN = make_pose(Matrix3::Identity(), Vector3(0, 0, 0.3));
  scene.X_NB = make_pose(from_rpy(0, 0, 0), Vector3(-0.9, 0.05, 0.5));
  return scene;
}

struct Pictures {
  ColorBuffer color;
  DepthBuffer depth;
};

Pictures picture(const std::vector<FaultScenario>& faults, std::uint64_t index = 3) {
  CameraSimConfig config;
  config.lights = 0;
  auto renderer = CameraRenderer::create(config, alan_rig(), 1);
  EXPECT_TRUE(renderer);
  const CameraFaults camera(faults, Rng(1));
  const PictureTrouble trouble = camera.at(from_seconds(1), index);
  const std::vector<SceneAt> exposure(3, in_view());
  Pictures p;
  EXPECT_TRUE(renderer->render(index, exposure, p.color, &p.depth, nullptr, &trouble));
  return p;
}

long light_of(const Pictures& p) {
  long sum = 0;
  for (const std::uint8_t c : p.color.pixels()) sum += c > 40 ? c : 0;
  return sum;
}

double mean_of(const Pictures& p) {
  double sum = 0;
  for (const std::uint8_t c : p.color.pixels()) sum += c;
  return sum / static_cast<double>(p.color.pixels().size());
}

FaultScenario of(FaultKind kind) { return {.kind = kind, .at_s = 0, .for_s = 10}; }

TEST(CameraFaults, NothingWrongIsNoChange) {
  CameraSimConfig config;
  auto renderer = CameraRenderer::create(config, alan_rig(), 1);
  ASSERT_TRUE(renderer);
  const std::vector<SceneAt> exposure(3, in_view());
  ColorBuffer a, b;
  const PictureTrouble none = CameraFaults({}, Rng(1)).at(0, 3);
  ASSERT_TRUE(renderer->render(3, exposure, a));
  ASSERT_TRUE(renderer->render(3, exposure, b, nullptr, nullptr, &none));
  EXPECT_EQ(a.pixels(), b.pixels());
}

TEST(CameraFaults, EachDeadLedTakesItsLight) {
  const long all = light_of(picture({}));
  long sum = 0;
  for (int led = 0; led < 6; ++led) {
    FaultScenario dead = of(FaultKind::led_dead);
    dead.led = led;
    const long taken = all - light_of(picture({dead}));
    EXPECT_GT(taken, 0) << led;
    sum += taken;
    FaultScenario dim = of(FaultKind::led_dim);
    dim.led = led;
    const long dimmed = all - light_of(picture({dim}));
    EXPECT_GT(dimmed, 0) << led;
    EXPECT_LT(dimmed, taken) << led;
  }
  EXPECT_NEAR(static_cast<double>(sum) / static_cast<double>(all), 1, 0.3);
}

TEST(CameraFaults, FlickerIsLitAsOftenAsAsked) {
  for (const double share : {0.2, 0.7}) {
    FaultScenario flicker = of(FaultKind::led_flicker);
    flicker.lit_share = share;
    const CameraFaults camera({flicker}, Rng(9));
    int lit = 0;
    for (std::uint64_t k = 0; k < 2000; ++k) lit += camera.at(0, k).led_gain[0] > 0;
    EXPECT_NEAR(lit / 2000.0, share, 0.04);
  }
}

TEST(CameraFaults, PicturesAreSpoiltAsSaid) {
  const Pictures well = picture({});
  const double plain = mean_of(well);

  FaultScenario noise = of(FaultKind::camera_noise);
  const Pictures noisy = picture({noise});
  double square = 0;
  int n = 0;
  for (std::size_t i = 0; i < well.color.pixels().size(); i += 7) {
    if (well.color.pixels()[i] > 200) continue;
    const double d = noisy.color.pixels()[i] - well.color.pixels()[i];
    if (d <= -2 || noisy.color.pixels()[i] == 0) continue;  // cut off at black
    square += d * d;
    ++n;
  }
  EXPECT_NEAR(std::sqrt(square / n), 20, 3);

  EXPECT_GT(mean_of(picture({of(FaultKind::camera_glare)})), plain + 10);

  FaultScenario dark = of(FaultKind::camera_exposure);
  dark.exposure_factor = 0.1;
  EXPECT_LT(light_of(picture({dark})), light_of(well) / 2);
  EXPECT_GT(light_of(picture({of(FaultKind::camera_exposure)})), light_of(well));

  FaultScenario cover = of(FaultKind::camera_occlusion);
  cover.covered_share = 1;
  const Pictures covered = picture({cover});
  EXPECT_EQ(light_of(covered), 0);
  EXPECT_EQ(
      *std::max_element(covered.depth.pixels().begin(), covered.depth.pixels().end()),
      0);
}

TEST(CameraFaults, WrongDepthIsWrongByTheFactor) {
  const Pictures well = picture({}), wrong = picture({of(FaultKind::depth_wrong)});
  int known = 0;
  for (std::size_t i = 0; i < well.depth.pixels().size(); ++i) {
    EXPECT_EQ(wrong.depth.pixels()[i], std::lround(1.5 * well.depth.pixels()[i]));
    known += well.depth.pixels()[i] > 0;
  }
  EXPECT_GT(known, 1000);
  EXPECT_EQ(wrong.color.pixels(), well.color.pixels());
}

}  // namespace
}  // namespace alight
