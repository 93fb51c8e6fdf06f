#include <cmath>
#include <map>
#include <vector>

#include "run_scenarios.h"

namespace alight {
namespace {

/// What reaches the brain of pictures, and when it runs.
struct Watch : RunObserver {
  struct Picture {
    Time captured, received;
    std::uint64_t sum;
    bool depth;
  };
  std::vector<Picture> pictures;
  std::vector<Time> steps;

  void on_picture(const CameraFrame& frame) override {
    std::uint64_t sum = 0;
    for (int v = 0; v < frame.color.height; ++v) {
      for (int i = 0; i < frame.color.width * 3; ++i) {
        sum = 31 * sum + frame.color.data[v * frame.color.stride + i];
      }
    }
    pictures.push_back(
        {frame.captured, frame.received, sum, frame.depth.data != nullptr});
  }
  void on_step(const Output&, const TruthState& truth, double) override {
    steps.push_back(truth.t);
  }
};

/// The first two seconds of a flight; the fault is on from 1 s to 1.5 s.
Watch watch(FaultScenario fault, bool with = true) {
  LandingRunOptions options = test::options_of("still", 3);
  options.timeout_s = 2;
  fault.at_s = 1;
  fault.for_s = 0.5;
  if (with) options.scenario.faults = {fault};
  Watch seen;
  EXPECT_TRUE(run_landing(options, &seen));
  return seen;
}
Watch watch(FaultKind kind) { return watch({.kind = kind}); }

int within(const Watch& seen, double from_s, double to_s) {
  int count = 0;
  for (const auto& p : seen.pictures) {
    count += p.captured >= from_seconds(from_s) && p.captured < from_seconds(to_s);
  }
  return count;
}

TEST(LandingFaults, PicturesAreLostOrComeTwice) {
  EXPECT_EQ(within(watch({}, false), 1, 1.5), 30);
  EXPECT_EQ(within(watch(FaultKind::camera_out), 1, 1.5), 0);
  EXPECT_EQ(within(watch(FaultKind::camera_out), 0.5, 1), 30);
  EXPECT_EQ(within(watch(FaultKind::camera_repeat), 1, 1.5), 60);
}

TEST(LandingFaults, PicturesAreLateAndStayInOrder) {
  const Watch seen = watch({.kind = FaultKind::camera_late, .late_ms = 100});
  Time last = 0;
  int late = 0;
  for (const auto& p : seen.pictures) {
    EXPECT_GE(p.captured, last);
    last = p.captured;
    late += p.received - p.captured > from_seconds(0.12);
  }
  EXPECT_GE(late, 30);
  EXPECT_LE(late, 31);
}

TEST(LandingFaults, PicturesThatComeTwiceStayLateNoLongerThanOthers) {
  LandingRunOptions options = test::options_of("still", 3);
  options.timeout_s = 2;
  options.scenario.faults = {
      {.kind = FaultKind::camera_late, .at_s = 0.5, .for_s = 0.5, .late_ms = 150},
      {.kind = FaultKind::camera_repeat, .at_s = 0.5, .for_s = 1.5}};
  Watch seen;
  ASSERT_TRUE(run_landing(options, &seen));
  Time received = 0;
  for (const auto& p : seen.pictures) {
    EXPECT_GE(p.received, received);
    received = p.received;
    if (p.captured < from_seconds(1.2)) continue;
    EXPECT_LT(p.received - p.captured, from_seconds(0.05));
  }
  EXPECT_GT(within(seen, 1.2, 1.9), 80);
}

TEST(LandingFaults, AFrozenPictureStaysTheSameUnderNewTimes) {
  const Watch seen = watch(FaultKind::camera_freeze);
  std::map<std::uint64_t, int> same;
  for (const auto& p : seen.pictures) ++same[p.sum];
  int most = 0;
  for (const auto& [sum, count] : same) most = std::max(most, count);
  EXPECT_EQ(most, 31);
  for (std::size_t i = 1; i < seen.pictures.size(); ++i) {
    EXPECT_GT(seen.pictures[i].captured, seen.pictures[i - 1].captured);
  }
}

TEST(LandingFaults, DepthStaysAway) {
  int without = 0, with = 0;
  for (const auto& p : watch(FaultKind::depth_out).pictures) {
    (p.depth ? with : without) += 1;
  }
  EXPECT_EQ(without, 30);
  EXPECT_GT(with, 60);
}

TEST(LandingFaults, AStalledComputerDoesNotStepAndThenGoesOn) {
  const Watch seen = watch(FaultKind::computer_stall);
  Time widest = 0;
  for (std::size_t i = 1; i < seen.steps.size(); ++i) {
    widest = std::max(widest, seen.steps[i] - seen.steps[i - 1]);
  }
  EXPECT_NEAR(to_seconds(widest), 0.5, 0.011);
  // Eight waited, and two were still on their way when it went on.
  EXPECT_GE(within(seen, 1, 1.5), 8);
  EXPECT_LE(within(seen, 1, 1.5), 11);
}

/// A whole landing on a still pad with one fault.
struct Story : RunObserver {
  std::vector<MissionTransition> told;
  LandingResult result;

  void on_step(const Output& out, const TruthState&, double) override {
    for (const MissionTransition& t : out.transitions) told.push_back(t);
  }
  bool says(const std::string& words) const {
    for (const MissionTransition& t : told) {
      if (words == t.reason) return true;
    }
    return false;
  }
};

Story story(const FaultScenario& fault, unsigned seed) {
  LandingRunOptions options = test::options_of("still", seed);
  options.timeout_s = 40;
  options.scenario.faults = {fault};
  Story told;
  const auto result = run_landing(options, &told);
  EXPECT_TRUE(result);
  if (result) told.result = *result;
  return told;
}

TEST(LandingFaults, EachIsToldByItsOwnReason) {
  struct Case {
    FaultScenario fault;
    const char* told;
  };
  const Case cases[] = {
      {{.kind = FaultKind::computer_stall, .at_s = 5, .for_s = 1},
       "the computer stood still"},
      {{.kind = FaultKind::autopilot_mode, .at_s = 5, .for_s = 2},
       "the pilot has taken over"},
      {{.kind = FaultKind::camera_late, .at_s = 5, .for_s = 2, .late_ms = 400},
       "the pictures come too late"},
      {{.kind = FaultKind::camera_out, .at_s = 5, .for_s = 1},
       "no pictures come from the camera"},
      {{.kind = FaultKind::battery_low, .at_s = 5, .charge = 0.1},
       "the battery is low: it lands without waiting"},
      {{.kind = FaultKind::operator_hold, .at_s = 5, .for_s = 1}, "the operator holds"},
  };
  for (const Case& c : cases) {
    const Story s = story(c.fault, 5);
    EXPECT_TRUE(s.says(c.told)) << c.told;
    EXPECT_EQ(s.result.outcome, Outcome::landed) << c.told << ": " << s.result.reason;
  }
}

// The first pictures after a while say where the drone is and not how fast: told so,
// its autopilot would lean against a drift that there is not.
TEST(LandingFaults, TheAutopilotIsToldNoSpeedThatIsNotKnown) {
  struct Poses : RunObserver {
    int told = 0, again = 0, vague = 0, wrong = 0;
    void on_step(const Output& out, const TruthState& truth, double) override {
      if (!out.has_external_pose) return;
      const ExternalPose& pose = out.external_pose;
      ++told;
      again += truth.t > from_seconds(5.6) && truth.t < from_seconds(6.6);
      vague += largest_sd(pose.cov.bottomRightCorner<3, 3>()) > 0.31;
      // I is the odometry's own frame: what is alike in both is how fast.
      wrong += std::abs(pose.v_IB.norm() - truth.v_IB.norm()) > 0.5;
    }
  };
  for (unsigned seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    LandingRunOptions options = test::options_of("circle", seed);
    options.timeout_s = 8;
    options.scenario.faults = {
        {.kind = FaultKind::camera_out, .at_s = 5, .for_s = 0.6}};
    Poses poses;
    ASSERT_TRUE(run_landing(options, &poses));
    EXPECT_GT(poses.told, 380);
    EXPECT_GT(poses.again, 50);  // as soon as it is known
    EXPECT_EQ(poses.vague, 0);
    EXPECT_EQ(poses.wrong, 0);
  }
}

// What was learnt of the wind holds for a drone that its autopilot flies, too.
TEST(LandingFaults, TheWindIsKeptInMindWhenTheAutopilotTakesOver) {
  struct Pushes : RunObserver {
    bool alone = false;
    Vector3 before = Vector3::Zero();
    double before_level = 0, change = 0;
    void on_step(const Output& out, const TruthState&, double) override {
      const bool now_alone = out.mission.state == MissionState::lost_link;
      const Vector3& d_N = out.trace.disturbance_N;
      if (now_alone && !alone) before_level = before.head<2>().norm();
      if (now_alone && out.trace.estimate_valid) {
        change = std::max(change, (d_N - before).head<2>().norm());
      }
      alone = now_alone;
      before = d_N;
    }
  };
  for (unsigned seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    LandingRunOptions options = test::options_of("circle", seed);
    options.timeout_s = 8;
    options.scenario.faults = {
        {.kind = FaultKind::uplink_out, .at_s = 6, .for_s = 1000},
        {.kind = FaultKind::camera_out, .at_s = 6.2, .for_s = 1000}};
    Pushes pushes;
    ASSERT_TRUE(run_landing(options, &pushes));
    EXPECT_GT(pushes.before_level, 0.25);
    EXPECT_LT(pushes.change, 0.4 * pushes.before_level);
  }
}

/// How far a drone is from where it is thought to be, m.
double prediction_off(const Output& out, const TruthState& truth) {
  return (out.trace.predicted.p_NB - truth.X_NB.translation()).norm();
}

// The camera fails half a second after lift-off, where wind and thrust are hardly
// known. By the model alone and from higher up the wind blew each of these into the
// platform; its autopilot's own velocity says where a drone is, and how it is blown.
TEST(LandingFaults, WithoutPicturesADroneIsNotLeftToBeBlownIntoThePlatform) {
  struct Places : RunObserver {
    double off_m = 0;  // once it is given up, until it is left
    bool left = false;
    void on_step(const Output& out, const TruthState& truth, double) override {
      left = left || truth.mode == AutopilotMode::land;
      if (left || out.mission.state != MissionState::aborted) return;
      off_m = prediction_off(out, truth);
    }
  };
  for (const unsigned seed : {327u, 358u, 361u, 374u, 379u, 387u, 398u, 424u}) {
    SCOPED_TRACE(seed);
    LandingRunOptions options = test::options_of("circle", seed);
    options.scenario.faults = {
        {.kind = FaultKind::camera_out, .at_s = 2.2, .for_s = 1000}};
    Places places;
    const auto result = run_landing(options, &places);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->outcome, Outcome::aborted) << result->reason;
    EXPECT_TRUE(places.left);
    EXPECT_GT(places.off_m, 0);
    EXPECT_LT(places.off_m, 0.7);
  }
}

// The same where pictures come, in which something hides it: by the model alone these
// were up to 2.3 m from where they were thought to be, and two met the platform.
TEST(LandingFaults, AHiddenDroneIsNotLeftToBeBlownIntoThePlatform) {
  struct Places : RunObserver {
    Time lost = 0;
    double off_m = 0;  // most, in the 2 s after it was lost
    void on_step(const Output& out, const TruthState& truth, double) override {
      if (out.mission.state == MissionState::lost_target && lost == 0) lost = truth.t;
      if (lost == 0 || truth.t > lost + from_seconds(2)) return;
      if (!out.trace.estimate_valid) return;
      off_m = std::max(off_m, prediction_off(out, truth));
    }
  };
  for (const unsigned seed : {2u, 7u, 9u, 11u, 19u, 20u}) {
    SCOPED_TRACE(seed);
    LandingRunOptions options = test::options_of("circle", seed);
    options.scenario.faults = {
        {.kind = FaultKind::camera_occlusion, .at_s = 2.2, .for_s = 3},
        {.kind = FaultKind::camera_exposure, .at_s = 2.5, .for_s = 3}};
    Places places;
    const auto result = run_landing(options, &places);
    ASSERT_TRUE(result);
    EXPECT_NE(result->outcome, Outcome::crashed) << result->reason;
    EXPECT_GT(places.off_m, 0);
    EXPECT_LT(places.off_m, 0.75);
  }
}

// With the same LEDs, while its own are out of sight: of 27 such landings that crashed
// these are some.
TEST(LandingFaults, AnotherDroneIsNotFlownBy) {
  const struct {
    Vector3 p_NB;
    FaultKind hides;
    double at_s, for_s;
    unsigned seed;
  } cases[] = {{{-1.2, 0.6, 0.5}, FaultKind::camera_occlusion, 1.8, 3, 1},
               {{-1.2, 0.6, 0.5}, FaultKind::camera_occlusion, 4, 3, 2},
               {{-1.2, 0.6, 0.5}, FaultKind::camera_glare, 7.6, 3, 1},
               {{-1.2, 0.6, 0.5}, FaultKind::camera_out, 4, 1.8, 1},
               {{-0.9, 0.35, 0.35}, FaultKind::camera_occlusion, 7.6, 3, 1},
               {{-0.9, 0.35, 0.35}, FaultKind::camera_out, 1.8, 1, 2},
               {{-1, 0, 0.8}, FaultKind::camera_out, 9.3, 1, 1}};
  for (const auto& c : cases) {
    SCOPED_TRACE(std::string(to_string(c.hides)) + " at " + std::to_string(c.at_s));
    LandingRunOptions options = test::options_of("circle", c.seed);
    options.scenario.faults = {
        {.kind = FaultKind::other_drone,
         .at_s = c.at_s,
         .for_s = 1000,
         .other_x_m = c.p_NB.x(),
         .other_y_m = c.p_NB.y(),
         .other_z_m = c.p_NB.z()},
        {.kind = c.hides, .at_s = c.at_s + 0.05, .for_s = c.for_s}};
    const auto result = run_landing(options);
    ASSERT_TRUE(result);
    EXPECT_TRUE(result->outcome == Outcome::landed ||
                result->outcome == Outcome::aborted)
        << result->reason;
  }
}

TEST(LandingFaults, AnotherDroneInViewDisturbsNoLanding) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    const Story s =
        story({.kind = FaultKind::other_drone, .at_s = 2, .for_s = 1000}, seed);
    EXPECT_EQ(s.result.outcome, Outcome::landed) << s.result.reason;
  }
}

// Its heading and its velocity jump where no picture shows that they do not.
TEST(LandingFaults, AnEstimatorThatBeginsAnewUnseenIsNoticed) {
  struct Watched : RunObserver {
    double before = 0, turned = 0, off_m = 0;
    void on_step(const Output& out, const TruthState& truth, double) override {
      if (truth.t < from_seconds(5.45)) before = out.trace.heading_offset;
      if (truth.t < from_seconds(5.7) || truth.t > from_seconds(5.95)) return;
      turned = wrap_angle(out.trace.heading_offset - before);
      off_m = std::max(off_m, prediction_off(out, truth));
    }
  };
  for (unsigned seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    LandingRunOptions options = test::options_of("circle", seed);
    options.timeout_s = 8;
    options.scenario.faults = {
        {.kind = FaultKind::camera_out, .at_s = 5, .for_s = 1},
        {.kind = FaultKind::autopilot_reset, .at_s = 5.5, .turn_deg = 30}};
    Watched watched;
    ASSERT_TRUE(run_landing(options, &watched));
    EXPECT_NEAR(watched.turned, 30 * kDegree, 4 * kDegree);
    EXPECT_LT(watched.off_m, 0.4);
  }
}

// What the autopilot did meanwhile was taken for the leaning of another drone.
TEST(LandingFaults, AComputerThatStallsAsItLiftsKnowsItsDroneAgain) {
  const struct {
    double at_s;
    unsigned seed;
  } cases[] = {{1.9, 104}, {1.9, 108}, {2.1, 102}, {2.1, 104}, {2.1, 105}};
  for (const auto& [at_s, seed] : cases) {
    SCOPED_TRACE(seed);
    LandingRunOptions options = test::options_of("circle", seed);
    options.scenario.faults = {
        {.kind = FaultKind::computer_stall, .at_s = at_s, .for_s = 1}};
    const auto result = run_landing(options);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->outcome, Outcome::landed) << result->reason;
  }
}

// Without odometry nobody tells how the deck leans: it is not the drone that does.
TEST(LandingFaults, OnADeckWithoutOdometryADroneIsHeldInSight) {
  for (const unsigned seed : {53u, 54u}) {
    SCOPED_TRACE(seed);
    LandingRunOptions options = test::options_of("boat", seed);
    options.timeout_s = 20;
    options.scenario.faults = {
        {.kind = FaultKind::odometry_out, .at_s = 4, .for_s = 1000}};
    const auto result = run_landing(options);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->outcome, Outcome::held) << result->reason;
    EXPECT_EQ(result->reason, "no platform odometry comes");
    EXPECT_GT(result->estimate.tracked_fraction, 0.99);
  }
}

TEST(LandingFaults, TheOperatorsAbortEndsOffThePad) {
  const Story s = story({.kind = FaultKind::operator_abort, .at_s = 5}, 5);
  EXPECT_EQ(s.result.outcome, Outcome::aborted);
  EXPECT_EQ(s.result.reason, "the operator aborted: the autopilot lands");
}

// The first was blown into the platform, which had stopped in its lee; the others leant
// on the floor, where the pad hides them, against a drift that there was not.
TEST(LandingFaults, AnAbortedDroneStandsOnTheFloorBesideThePlatform) {
  const struct {
    unsigned seed;
    double abort_s;
  } cases[] = {{504, 5}, {802, 2.5}, {802, 7.6}};
  for (const auto& c : cases) {
    SCOPED_TRACE(c.seed);
    LandingRunOptions options = test::options_of("circle", c.seed);
    options.scenario.faults = {{.kind = FaultKind::operator_abort, .at_s = c.abort_s}};
    const auto result = run_landing(options);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->outcome, Outcome::aborted) << result->reason;
  }
}

TEST(LandingFaults, APilotWhoKeepsItHasIt) {
  const Story s =
      story({.kind = FaultKind::autopilot_mode, .at_s = 5, .for_s = 1000}, 5);
  EXPECT_EQ(s.result.outcome, Outcome::held);
  EXPECT_EQ(s.result.reason.find("the pilot"), 0u) << s.result.reason;
  // Also one of whom nothing is heard.
  LandingRunOptions options = test::options_of("circle", 1);
  options.timeout_s = 14;
  options.scenario.faults = {
      {.kind = FaultKind::telemetry_out, .at_s = 8.6, .for_s = 1000},
      {.kind = FaultKind::autopilot_mode, .at_s = 8.9, .for_s = 1000}};
  const auto result = run_landing(options);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->outcome, Outcome::held) << result->reason;
}

// Set-points come again, and are obeyed before the autopilot says so: for want of them
// the climb that they had asked for was taken for a wind from below, of 3.5 m/s^2, and
// what was sent against it had the drone sink beside the platform and fly into it.
TEST(LandingFaults, WhatIsAskedForAsTheLinkComesBackIsNoWind) {
  double most = 0;
  for (const unsigned seed : {2u, 3u, 6u, 9u, 14u}) {
    SCOPED_TRACE(seed);
    struct : RunObserver {
      double most = 0;
      bool touches = false;  // then the pad pushes it
      void on_step(const Output& out, const TruthState& truth, double) override {
        if (truth.t < from_seconds(9.6) || truth.t > from_seconds(10.6)) return;
        touches = touches || truth.X_NB.translation().z() < 0.12;
        if (touches || truth.mode != AutopilotMode::offboard) return;
        most = std::max(most, std::abs(out.trace.disturbance_N.z()));
      }
    } watch;
    LandingRunOptions options = test::options_of("circle", seed);
    options.scenario.faults = {
        {.kind = FaultKind::uplink_out, .at_s = 8.6, .for_s = 1}};
    const auto result = run_landing(options, &watch);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->outcome, Outcome::landed) << result->reason;
    EXPECT_LT(watch.most, 2.2);
    most = std::max(most, watch.most);
  }
  EXPECT_GT(most, 1) << "they all stood on the pad before";
}

// Nothing gets to a drone any more whose pad stops beneath it: it flies on into what
// stands ahead, and nobody can help it. Where the radio is back in time somebody could.
TEST(LandingFaults, WhoCouldStillAbortIsNotHelpless) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    SCOPED_TRACE(seed);
    const auto lost = [&](double for_s) {
      LandingRunOptions options = test::options_of("circle", seed);
      options.scenario.faults = {
          {.kind = FaultKind::uplink_out, .at_s = 9.4, .for_s = for_s},
          {.kind = FaultKind::pad_stop, .at_s = 9.4, .for_s = 1000}};
      const auto result = run_landing(options);
      EXPECT_TRUE(result);
      return *result;
    };
    const LandingResult good = lost(1000);
    ASSERT_TRUE(good.lost_link);
    EXPECT_EQ(good.outcome, Outcome::crashed);
    EXPECT_TRUE(good.lost_link->helpless);
    EXPECT_NE(good.reason.find("no abort was possible"), std::string::npos);
    const LandingResult brief = lost(0.3);
    EXPECT_FALSE(brief.lost_link && brief.lost_link->helpless) << brief.reason;
  }
}

}  // namespace
}  // namespace alight
