#include <cmath>
#include <vector>

#include "alight/mission/test/flight.h"
#include "alight/planning/planner.h"

namespace alight {
namespace {

TEST(Mission, TouchingDownThrustGoesToNothingBeforeTheMotorsStop) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  double share = 1;
  int settling = 0;
  while (f.state() == State::land) {
    f.step();
    if (f.c.mode != MissionCommand::Mode::settle) continue;
    ++settling;
    EXPECT_LE(f.c.ramp_share, share);
    share = f.c.ramp_share;
    EXPECT_LT(f.x().p_NB.z(), f.rig().drone.gear_height_m + 0.03);
    EXPECT_EQ(f.orders_disarm, 0);
  }
  EXPECT_GE(settling, 5);
  EXPECT_EQ(f.state(), State::shut_down);
}

TEST(Mission, UnheardButSeenToObeyALandingGoesOn) {
  Flight f;
  ASSERT_TRUE(bring(f, State::land));
  f.link_up = false;
  const double limit = f.c.tilt_limit;
  while (f.state() == State::land) {
    f.step();
    EXPECT_EQ(f.c.tilt_limit, limit) << "a landing needs its tilt";
    EXPECT_EQ(f.c.platform_speed_wish, 1);
  }
  EXPECT_EQ(f.state(), State::shut_down);
  ASSERT_TRUE(f.until(State::lost_link, 10));
  EXPECT_EQ(f.reason(),
            "nothing heard since touch-down: the autopilot stops its motors");
}

TEST(Mission, WaitsAboveThePadForAGustToPass) {
  const MissionConfig config;
  const double commit = alan_rig().drone.gear_height_m + config.commit_height_m;
  Flight f(config);
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(commit + config.wait_room_m));
  f.off = Vector3(2.5 * config.wait_error_m, 0, 0);
  f.run(0.5 * config.wait_more_s);
  EXPECT_EQ(f.state(), State::land);
  EXPECT_GT(f.x().p_NB.z(), commit);
  f.off.setZero();
  EXPECT_TRUE(f.until(State::complete, 3));

  // A miss that stays: the longer it waits, the less it asks for.
  Flight stays(config);
  ASSERT_TRUE(stays.reach(State::land));
  ASSERT_TRUE(stays.until_below(commit + config.wait_room_m));
  stays.off = Vector3(2.5 * config.wait_error_m, 0, 0);
  EXPECT_TRUE(stays.until(State::complete, 2 * config.wait_more_s));
}

TEST(Mission, OneThatStopsToWaitIsNotCommittedToLandWhereItComesToRest) {
  const MissionConfig config;
  const double commit = alan_rig().drone.gear_height_m + config.commit_height_m;
  Flight f(config);
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(commit + 0.055));
  f.off = Vector3(2.5 * config.wait_error_m, 0, 0);
  f.run(0.5 * config.wait_more_s);
  EXPECT_EQ(f.state(), State::land);
  EXPECT_NE(f.reason(), "past the commit height: it lands");
  EXPECT_LT(f.x().p_NB.z(), commit);
  f.off.setZero();
  EXPECT_TRUE(f.until(State::complete, 3));
}

TEST(Mission, ADroneThatSeldomMissesWaitsForLess) {
  const MissionConfig config;
  const double commit = alan_rig().drone.gear_height_m + config.commit_height_m;
  const double off = 0.5 * (4.0 / 3 * config.wait_least_m + config.wait_error_m);
  for (const double swing : {0.0, 8 * config.wait_error_m}) {
    Flight f(config);
    ASSERT_TRUE(f.reach(State::land));
    for (int i = 0; f.x().p_NB.z() > commit + config.wait_room_m; ++i) {
      f.off.x() = swing * std::sin(2 * kPi * i / 100);
      f.step();
      ASSERT_LT(i, 1000);
    }
    f.off = Vector3(off, 0, 0);
    const bool lands = f.until(State::shut_down, 1.5);
    EXPECT_EQ(lands, swing > 0) << f.x().p_NB.transpose();
    EXPECT_TRUE(lands || f.until(State::complete, 2 * config.wait_more_s));
  }
}

TEST(Mission, WhatFailsToBeSeenAboveTheCommitHeightIsNotCommittedTo) {
  for (const Blindness why : {Blindness::leds, Blindness::pictures, Blindness::late}) {
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    ASSERT_TRUE(f.until_below(f.rig().drone.gear_height_m + 0.115));
    ASSERT_NE(f.reason(), "past the commit height: it lands");
    f.sight = false;
    f.blindness = why;
    while (f.state() == State::land && f.now() < 60'000'000'000) f.step();
    // Pictures that come late are landed by, if only just.
    const bool lands = why == Blindness::late;
    EXPECT_EQ(f.state(), lands ? State::shut_down : State::lost_target);
    EXPECT_EQ(f.x().p_NB.z() > f.rig().drone.gear_height_m + 0.05, !lands);
  }
}

TEST(Mission, CommittedAndUnseenItSettlesByThePrediction) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(f.rig().drone.gear_height_m + 0.05));
  f.sight = false;
  double share = 2;
  bool settled = false;
  while (f.state() == State::land && f.now() < 60'000'000'000) {
    f.step();
    if (f.c.mode != MissionCommand::Mode::settle) continue;
    settled = true;
    EXPECT_LE(f.c.ramp_share, share);
    share = f.c.ramp_share;
  }
  EXPECT_TRUE(settled);
  expect_last(f, State::land, State::shut_down, "stands on the pad");
  EXPECT_LT(share, 0.2);
}

TEST(Mission, ALinkThatReturnsAfterTheLandingTellsSo) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_link));
  f.mode = AutopilotMode::land;
  f.run(3);
  const std::size_t transitions = f.transitions.size();
  f.link_up = true;
  f.run(1);
  EXPECT_EQ(f.state(), State::lost_link) << "the autopilot lands: nothing interferes";
  EXPECT_EQ(f.transitions.size(), transitions);
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
  f.motors_stop = true;
  ASSERT_TRUE(f.until(State::complete, 1));
  EXPECT_EQ(f.reason(), "the link was lost: the autopilot landed by itself");
  EXPECT_FALSE(f.mission().flying());
}

// Without set-points its autopilot came down on the pad; when they arrived again they
// asked it to fly on, light on its feet, and the pad went from under it.
TEST(Mission, WhatItsAutopilotHasSetDownOnThePadStaysThere) {
  const struct {
    double from, x, speed;
    AutopilotMode mode;
    bool stays;
    double leans_deg = 0;
  } cases[] = {
      {0.2, 0.05, 0, AutopilotMode::failsafe, true, 4},
      {0.5, 0.05, 0, AutopilotMode::failsafe, true},       // it goes around meanwhile
      {0.2, 0.19, 0, AutopilotMode::failsafe, false},      // a foot off the pad's edge
      {0.2, 0.05, 0.4, AutopilotMode::failsafe, false},    // stopped it would trip
      {0.2, 0.05, 0, AutopilotMode::failsafe, false, 11},  // or fall over
      {0.2, 0.05, 0, AutopilotMode::offboard, false},      // it is there as told
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(testing::Message() << c.from << " " << c.x << " " << c.speed);
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    ASSERT_TRUE(f.until_below(f.rig().drone.gear_height_m + c.from));
    f.mode = c.mode;
    for (int i = 0; i < 20 && f.state() != State::complete; ++i) {
      f.x().p_NB = Vector3(c.x, 0, f.rig().drone.gear_height_m + 0.004);
      f.x().v_NB = Vector3(-c.speed, 0, 0);
      f.x().R_NB = so3_exp(Vector3(0, c.leans_deg * kDegree, 0));
      f.step();
      if (i == 5) {
        EXPECT_EQ(f.orders_disarm, 0) << "it may be passing by";
      }
    }
    EXPECT_EQ(f.orders_disarm > 0, c.stays);
    EXPECT_EQ(f.state() == State::complete, c.stays);
    if (c.stays) {
      EXPECT_EQ(f.reason(), "motors stopped");
    }
  }
}

TEST(Mission, AnInfeasiblePlanIsTriedAgainAndThenFollowed) {
  Flight f;
  f.plans_feasible = false;
  ASSERT_TRUE(f.reach(State::rendezvous));
  ASSERT_TRUE(f.until(State::follow, 20));
  EXPECT_EQ(f.reason(), "no trajectory keeps the view");
  EXPECT_EQ(static_cast<int>(f.requests.size()), MissionConfig{}.plan_tries);
  EXPECT_EQ(f.mission().status().attempts, 1);
  for (std::size_t i = 1; i < f.requests.size(); ++i) {
    EXPECT_GT(f.requests[i].id, f.requests[i - 1].id);
    EXPECT_NEAR(to_seconds(f.requests[i].start - f.requests[i - 1].start),
                MissionConfig{}.plan_retry_s, 0.03);
  }
  ASSERT_TRUE(f.until(State::rendezvous, 20));
  f.plans_feasible = true;
  ASSERT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 2);
}

// Its autopilot acts alone in each, and over the pad that throws a landing.
TEST(Mission, NoLandingBeginsWhileTheRadioStallsAgainAndAgain) {
  Flight f;
  ASSERT_TRUE(f.reach(State::follow));
  for (int n = 0; n < 40 && f.state() != State::hold; ++n) {
    f.stall(0.5);
    f.run(0.5);
    ASSERT_NE(f.state(), State::land);
  }
  ASSERT_EQ(f.state(), State::hold);
  EXPECT_EQ(f.reason(), "the radio link stalls again and again");
  EXPECT_TRUE(f.requests.empty());
  f.wish = OperatorWish::go;
  EXPECT_TRUE(f.until(State::complete, 60));
}

TEST(Mission, AStallOfTheRadioNowAndThenKeepsNoneFromLanding) {
  Flight f;
  ASSERT_TRUE(f.reach(State::follow));
  f.stall(0.5);
  ASSERT_TRUE(f.until(State::land, 12));
}

TEST(Mission, APlanIsAskedFromWhereTheReferenceWillBe) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_EQ(f.requests.size(), 1u);
  const PlanRequest& request = f.requests[0];
  const MissionConfig placed = places_for({}, f.rig());
  EXPECT_TRUE(request.from.p_NB.isApprox(placed.rendezvous_point, 1e-9));
  EXPECT_EQ(request.platform.t, request.start);
  EXPECT_TRUE(request.platform.v_IN_N.isApprox(Vector3(0.9, 0, 0), 1e-9));
  // It ends, later, on the pad.
  const Vector3 end = f.mission().reference(f.now() + from_seconds(10)).p_NB;
  EXPECT_LT(end.head<2>().norm(), 1e-9);
}

TEST(Mission, APlannerThatIsLateOrSilentIsNamed) {
  Flight late;
  late.planner_delay = from_seconds(0.2);  // in force after 0.12 s
  ASSERT_TRUE(late.reach(State::rendezvous));
  ASSERT_TRUE(late.until(State::follow, 20));
  EXPECT_EQ(late.reason(), "the plan came too late");

  Flight silent;
  silent.planner_answers = false;
  ASSERT_TRUE(silent.reach(State::rendezvous));
  ASSERT_TRUE(silent.until(State::follow, 20));
  EXPECT_EQ(silent.reason(), "the planner does not answer");
}

// The answer to a question that is no longer asked.
TEST(Mission, AnAnswerToAnOlderQuestionIsNone) {
  Flight f;
  f.plan_age = 1;
  ASSERT_TRUE(f.reach(State::rendezvous));
  ASSERT_TRUE(f.until(State::follow, 20)) << to_string(f.state());
  EXPECT_EQ(f.reason(), "the planner does not answer");
}

TEST(Mission, AnOldPlanIsNotFlown) {
  Flight f;
  f.planner_delay = from_seconds(0.08);
  ASSERT_TRUE(f.reach(State::rendezvous));
  while (f.requests.empty()) f.step();
  f.wish = OperatorWish::hold;
  f.run(1);
  EXPECT_EQ(f.state(), State::hold);
  const Vector3 end = f.mission().reference(f.now() + from_seconds(10)).p_NB;
  EXPECT_TRUE(end.isApprox(places_for({}, f.rig()).follow_point, 1e-9));
}

TEST(Mission, TooFarFromTheTrajectoryGoesAround) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  f.run(0.3);
  f.off = Vector3(0.3, 0, 0);
  f.run(0.3);
  EXPECT_EQ(f.state(), State::land);
  f.off = Vector3(0.36, 0, 0);
  f.run(0.02);
  expect_last(f, State::land, State::go_around, "too far from the trajectory");
  f.off.setZero();
  ASSERT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 2);
}

TEST(Mission, NotOverThePadAtTheCommitHeightGoesAround) {
  for (const double way : {0.0, 1.0, 2.5, 4.0}) {
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    f.run(0.3);
    f.off = 0.13 * Vector3(std::cos(way), std::sin(way), 0);
    ASSERT_TRUE(f.until(State::go_around, 15)) << to_string(f.state());
    expect_last(f, State::land, State::go_around,
                "not over the pad at the commit height");
    EXPECT_GT(f.x().p_NB.z(), f.rig().drone.gear_height_m + 0.03);
    f.off.setZero();
    EXPECT_TRUE(f.until(State::complete));
  }
}

TEST(Mission, AMissThatPassesJustBelowTheCommitHeightIsNoReasonToLeave) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  f.run(0.3);
  // It waits, tires of waiting, and sinks.
  f.off = Vector3(0.13, 0, 0);
  const double below = f.rig().drone.gear_height_m + MissionConfig().commit_height_m;
  for (int i = 0; i < 3000 && f.x().p_NB.z() > below - 0.005; ++i) f.step();
  ASSERT_LT(f.x().p_NB.z(), below);
  EXPECT_EQ(f.state(), State::land);
  f.off.setZero();
  EXPECT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 1);
}

TEST(Mission, BelowTheCommitHeightItLandsWhateverComes) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.wish = OperatorWish::hold;
  f.off = Vector3(0.12, 0, 0);
  f.run(0.1);
  EXPECT_EQ(f.state(), State::land);
  EXPECT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 1);
}

TEST(Mission, PastTheCommitHeightBlownOffThePadItLeavesWhileThereIsRoom) {
  for (const bool room : {true, false}) {
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    ASSERT_TRUE(f.until_below(f.rig().drone.gear_height_m + (room ? 0.05 : 0.012)));
    // One pair of its feet would be off.
    f.off = Vector3(0.18, 0, 0);
    f.run(0.05);
    if (room) {
      EXPECT_EQ(f.state(), State::go_around);
      EXPECT_EQ(f.reason(), "the pad is not beneath it");
    } else {
      EXPECT_NE(f.state(), State::go_around);
    }
  }
}

TEST(Mission, WhatIsKnownTooVaguelyIsNotLandedBy) {
  for (const double sd : {0.04, 0.06}) {
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    f.run(0.5);
    f.miss_sd_m = sd;
    f.run(0.3);
    EXPECT_EQ(f.state(), sd < 0.05 ? State::land : State::go_around) << sd;
    if (sd > 0.05) {
      EXPECT_EQ(f.reason(), "too few LEDs are seen to land by");
    }
    f.miss_sd_m = 0.02;
    EXPECT_TRUE(f.until(State::complete));
  }
}

// To go around with an empty battery is to be left to its autopilot over the platform.
TEST(Mission, WithAnEmptyBatteryAVagueLandingGoesOn) {
  for (const double battery : {0.1, 0.03}) {
    SCOPED_TRACE(battery);
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    f.battery = battery;
    f.run(0.5);
    ASSERT_EQ(f.reason(), "the battery is low: the landing goes on");
    f.miss_sd_m = 0.06;
    f.run(0.3);
    EXPECT_EQ(f.state(), battery < 0.05 ? State::land : State::go_around);
    if (battery < 0.05) {
      EXPECT_TRUE(f.until(State::complete));
    }
  }
}

TEST(Mission, ACommittedLandingGoesOnHoweverVague) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.miss_sd_m = 0.2;
  EXPECT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 1);
}

TEST(Mission, NoTouchDownWhereThePadShouldBeGoesAround) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.off = Vector3(0, 0, 0.2);
  ASSERT_TRUE(f.until(State::go_around, 10));
  EXPECT_EQ(f.reason(), "no touch-down where the pad should be");
  EXPECT_EQ(f.orders_disarm, 0) << "motors run as long as it flies";
}

TEST(Mission, CarriedByWhatTheRigHasTooLowItStands) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.off = Vector3(0, 0, 0.12);  // at rest 4 cm above gear height, though pushed down
  ASSERT_TRUE(f.until(State::shut_down, 3));
  EXPECT_EQ(f.reason(), "stands on the pad");
}

TEST(Mission, TooManyFailedLandingsHold) {
  MissionConfig config;
  config.safety.landings_max = 3;
  Flight f(config);
  f.plans_feasible = false;
  ASSERT_TRUE(f.reach(State::hold));
  EXPECT_EQ(f.reason(), "no trajectory keeps the view") << "more plans will not help";
  EXPECT_EQ(f.mission().status().attempts, 3);
  f.plans_feasible = true;
  f.run(10);
  EXPECT_EQ(f.state(), State::hold) << "until the operator says otherwise";
  EXPECT_TRUE(f.x().p_NB.isApprox(places_for(config, f.rig()).follow_point, 1e-6));
  f.wish = OperatorWish::go;
  f.step();
  expect_last(f, State::hold, State::follow, "the operator goes on");
  EXPECT_EQ(f.mission().status().attempts, 0);
  EXPECT_TRUE(f.until(State::complete));
}

TEST(Mission, PlansThatFailOnAFastPlatformAreItsFault) {
  Flight f;
  f.plans_feasible = false;
  f.platform_speed = 0.9 * f.rig().limits.speed_m_s;
  ASSERT_TRUE(f.reach(State::hold));
  EXPECT_EQ(f.reason(), kTooFastSaid);
  EXPECT_EQ(f.mission().status().attempts, 1);
}

TEST(Mission, EachFailedLandingIsFollowedByALongerWait) {
  Flight f;
  f.plans_feasible = false;
  ASSERT_TRUE(f.reach(State::follow));
  Seconds last = 0;
  for (int i = 0; i < 2; ++i) {  // a third time without a plan is the last
    ASSERT_TRUE(f.until(State::rendezvous, 60));
    ASSERT_TRUE(f.until(State::follow, 60));
    const Time began = f.now();
    Flight copy = f;
    ASSERT_TRUE(copy.until(State::rendezvous, 60));
    const Seconds waited = to_seconds(copy.now() - began);
    if (i > 0) {
      EXPECT_NEAR(waited - last, MissionConfig{}.settle_more_s, 0.05);
    }
    last = waited;
  }
}

TEST(Mission, ADeckThatSwingsIsWaitedForUntilItIsLevelOrTheBatteryLow) {
  for (const bool battery_falls : {false, true}) {
    SCOPED_TRACE(battery_falls);
    Flight f;
    f.deck_swing = 1;
    f.deck_lean = 30 * kDegree;
    ASSERT_TRUE(f.reach(State::land));
    f.run(12);
    EXPECT_EQ(f.state(), State::land);
    EXPECT_NE(f.reason(), "past the commit height: it lands");
    EXPECT_GT(f.x().p_NB.z(), f.rig().drone.gear_height_m + 0.08);
    (battery_falls ? f.battery : f.deck_lean) = battery_falls ? 0.1 : 0;
    EXPECT_TRUE(f.until(State::complete, 5));
  }
}

// Only its words are lost: what throws it off its way for a moment does not have it
// left to its autopilot, over a pad that drives.
TEST(Mission, AGustIsNoReasonToLeaveALandingThatIsNotHeard) {
  for (const bool comes_back : {true, false}) {
    SCOPED_TRACE(comes_back);
    Flight f;
    ASSERT_TRUE(bring(f, State::land));
    ASSERT_TRUE(f.until_below(0.35));
    f.link_up = false;
    f.run(0.9);
    ASSERT_EQ(f.state(), State::land);
    for (int i = 0; i < 150 && f.state() == State::land; ++i) {
      const bool strays = !comes_back || i % 75 < 60;
      const Vector3 off = strays ? Vector3(0.3, 0, 0) : Vector3::Zero();
      f.x().p_NB = f.mission().reference(f.now() + kStep).p_NB;
      f.x().v_NB = f.mission().reference(f.now() + kStep).v_NB + off;
      f.step();
    }
    EXPECT_EQ(f.state() == State::lost_link, !comes_back) << f.reason();
  }
}

// Past the commit it may stand on the pad after a second without a computer, or have
// slid off: in the first case the next picture shows it.
TEST(Mission, NotSeenAfterTheComputerStoodStillItDoesNotStandOnThePad) {
  for (const bool seen : {true, false}) {
    SCOPED_TRACE(seen);
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    for (int i = 0; i < 3000 && f.reason() != "past the commit height: it lands"; ++i) {
      f.step();
    }
    ASSERT_EQ(f.reason(), "past the commit height: it lands");
    f.computer_was_late = true;
    f.blindness = Blindness::computer;
    f.miss(0.2);
    f.run(0.02);
    f.sight = false;
    f.miss(0.2);
    f.run(0.12);
    EXPECT_EQ(f.state(), State::land) << "stood still again";
    f.sight = seen;
    f.run(0.1);
    if (seen) {
      EXPECT_TRUE(f.until(State::complete));
      continue;
    }
    EXPECT_EQ(f.state(), State::lost_target);
    EXPECT_EQ(f.reason(), "the computer stood still");
    EXPECT_EQ(f.orders_disarm, 0);
  }
}

TEST(Mission, ThePaperCutsThrustAtTheEndOfTheTrajectory) {
  MissionConfig config;
  config.cut_height_m = 0.14;
  Flight f(config);
  ASSERT_TRUE(f.reach(State::shut_down));
  EXPECT_EQ(f.reason(), "over the pad: thrust is cut");
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::idle);
  EXPECT_TRUE(f.until(State::complete));
}

// Its reference waits above the commit height, where it was while nothing arrived.
TEST(Mission, LeftBesideThePadByItsAutopilotItGoesAroundWhereverItsReferenceIs) {
  struct Case {
    bool was_alone, obeys;
    double beside;
    bool leaves;
  };
  for (const Case& c :
       {Case{true, true, 0.25, true}, Case{true, false, 0.25, false},
        Case{false, true, 0.25, false}, Case{true, true, 0.15, false}}) {
    SCOPED_TRACE(testing::Message()
                 << c.was_alone << ", " << c.obeys << ", " << c.beside << " m");
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    ASSERT_TRUE(f.until_below(0.22));
    if (c.was_alone) f.mode = AutopilotMode::failsafe;
    f.step();
    f.off =
        Vector3(0, c.beside, 0.08 - f.mission().reference(f.now() + kStep).p_NB.z());
    ASSERT_LT(f.off.norm(), MissionConfig{}.go_around_error_m);
    if (c.obeys) f.mode = AutopilotMode::offboard;
    f.step();
    f.step();
    EXPECT_EQ(f.state(), c.leaves ? State::go_around : State::land);
    if (c.leaves) {
      EXPECT_EQ(f.reason(), "the pad is not beneath it");
    }
  }
}

TEST(Mission, PastTheCommitHeightAnAbortIsToldAndItLands) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.wish = OperatorWish::abort;
  f.run(0.05);
  EXPECT_EQ(f.state(), State::land);
  EXPECT_EQ(f.reason(), "the operator aborted past the commit height: it lands");
  ASSERT_TRUE(f.until(State::complete, 3));
  EXPECT_EQ(f.orders_land, 0);
  // Without a touch-down it is carried out after all.
  Flight misses;
  ASSERT_TRUE(misses.reach(State::land));
  ASSERT_TRUE(misses.until_below(0.11));
  misses.wish = OperatorWish::abort;
  misses.off = Vector3(0, 0, 0.2);
  ASSERT_TRUE(misses.until(State::aborted, 10));
}

TEST(Mission, PastTheCommitHeightALostLinkChangesNothing) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.link_up = false;
  ASSERT_TRUE(f.until(State::shut_down, 3));
  ASSERT_TRUE(f.until(State::lost_link, 5));
  EXPECT_EQ(f.reason(),
            "nothing heard since touch-down: the autopilot stops its motors");
}

TEST(Mission, TooManyFailedLandingsLeaveWhereTold) {
  MissionConfig config;
  config.safety.landings_max = 2;
  config.safety.when_failed = WhenFailed::leave;
  config.safety.leave_at_m = Vector3(-1.5, 0.4, 0.9);
  Flight f(config);
  f.plans_feasible = false;
  ASSERT_TRUE(f.reach(State::aborted));
  EXPECT_EQ(f.reason(), "too many landings have failed: the autopilot lands");
  // There, not where it is beside the platform already.
  f.run(0.2);
  EXPECT_EQ(f.orders_land, 0);
  f.run(3);
  EXPECT_GT(f.orders_land, 0);
  EXPECT_LT((f.x().p_NB - config.safety.leave_at_m).head<2>().norm(), 0.35);
}

TEST(Mission, ReplansWhileLandingWithoutAJumpAndLands) {
  const auto planner = Planner::create(PlannerConfig{}, alan_rig());
  ASSERT_TRUE(planner);
  Flight f;
  f.planner = &*planner;
  ASSERT_TRUE(f.reach(State::land));
  const std::size_t asked = f.requests.size();
  f.platform_speed = 0.5;  // It drives off: what was certified was for another motion.
  FlatState last = f.mission().reference(f.now());
  while (f.state() == State::land) {
    f.step();
    const FlatState ref = f.mission().reference(f.now());
    EXPECT_LT((ref.v_NB - last.v_NB).norm(), 0.12);  // 12 m/s^2 over a step
    EXPECT_LT((ref.a_NB - last.a_NB).norm(), 1.5);
    last = ref;
  }
  EXPECT_LT(f.reference_jump_m, 1e-6);
  ASSERT_GT(f.requests.size(), asked + 2);
  bool sweeps = false, single = false;
  for (std::size_t i = asked; i < f.requests.size(); ++i) {
    EXPECT_TRUE(f.requests[i].keep_jerk);
    EXPECT_NEAR(f.requests[i].platform.v_IN_N.x(), 0.5, 1e-9);
    (f.requests[i].durations[0] == 0 ? sweeps : single) = true;
  }
  EXPECT_TRUE(single);
  EXPECT_TRUE(sweeps);
  EXPECT_TRUE(f.until(State::complete));
}

TEST(Mission, PlansAnewThatComeLateOrNotChangeNothing) {
  const auto planner = Planner::create(PlannerConfig{}, alan_rig());
  ASSERT_TRUE(planner);
  std::vector<Vector3> paths[3];
  for (int kind = 0; kind < 3; ++kind) {
    Flight f;
    f.planner = &*planner;
    ASSERT_TRUE(f.reach(State::land));
    if (kind == 1) f.planner_answers = false;
    if (kind == 2) f.planner_delay = from_seconds(0.25);
    while (f.state() == State::land) {
      f.step();
      paths[kind].push_back(f.mission().reference(f.now()).p_NB);
    }
    EXPECT_EQ(f.state(), State::shut_down);
  }
  ASSERT_EQ(paths[1].size(), paths[2].size());
  for (std::size_t i = 0; i < paths[1].size(); ++i) {
    EXPECT_EQ(paths[1][i], paths[2][i]);
  }
}

TEST(Mission, GoesAroundOnACertifiedWayAndFromWhereItIsUntilThat) {
  const auto planner = Planner::create(PlannerConfig{}, alan_rig());
  ASSERT_TRUE(planner);
  Flight f;
  f.planner = &*planner;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.3));
  f.off = Vector3(0, 0.36, 0);
  ASSERT_TRUE(f.until(State::go_around, 5));
  f.off.setZero();
  const PlanRequest back = f.requests.back();
  EXPECT_TRUE(back.way_back);
  const PlanResult way = planner->plan(back);
  ASSERT_TRUE(way.ok());
  while (f.now() < back.start + from_seconds(0.2)) f.step();
  const FlatState ref = f.mission().reference(f.now());
  const FlatState certified = way.trajectory.at(to_seconds(f.now() - back.start));
  EXPECT_LT((ref.p_NB - certified.p_NB).norm(), 1e-9);
  EXPECT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 2);
}

// What comes down turns round within half the room that is left above the pad.
TEST(Mission, ALandingThatIsBrokenOffLowRisesBeforeItMoves) {
  for (const double from : {0.25, 0.2, 0.16}) {
    SCOPED_TRACE(from);
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    ASSERT_TRUE(f.until_below(from));
    f.wish = OperatorWish::hold;
    f.step();
    ASSERT_EQ(f.state(), State::hold);
    const FlatState begins = f.mission().reference(f.now());
    ASSERT_LT(begins.v_NB.z(), -0.1);
    const double room = begins.p_NB.z() - f.rig().drone.gear_height_m;
    double lowest = begins.p_NB.z();
    for (int i = 0; i < 200; ++i) {
      f.step();
      lowest = std::min(lowest, f.mission().reference(f.now()).p_NB.z());
    }
    EXPECT_GT(lowest, begins.p_NB.z() - 0.5 * room - 0.003);
  }
}

}  // namespace
}  // namespace alight
