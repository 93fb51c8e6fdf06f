#include <algorithm>
#include <iterator>
#include <string>

#include "alight/mission/test/flight.h"

namespace alight {
namespace {

TEST(Mission, NormalLife) {
  Flight f;
  f.run(1);
  EXPECT_EQ(f.state(), State::idle);
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
  EXPECT_EQ(f.orders_arm, 0);
  ASSERT_TRUE(f.reach(State::complete)) << to_string(f.state()) << f.reason();

  const struct {
    State from, to;
    const char* reason;
  } life[] = {
      {State::idle, State::armed, "all is ready: arming"},
      {State::armed, State::taken_off, "armed: taking off"},
      {State::taken_off, State::follow, "clear of the pad: to the follow point"},
      {State::follow, State::rendezvous, "following well: to the rendezvous"},
      {State::rendezvous, State::land, "the landing is planned"},
      {State::land, State::land, "past the commit height: it lands"},
      {State::land, State::shut_down, "stands on the pad"},
      {State::shut_down, State::complete, "motors stopped"},
  };
  ASSERT_EQ(f.transitions.size(), std::size(life));
  for (std::size_t i = 0; i < std::size(life); ++i) {
    EXPECT_EQ(f.transitions[i].from, life[i].from) << i;
    EXPECT_EQ(f.transitions[i].to, life[i].to) << i;
    EXPECT_STREQ(f.transitions[i].reason, life[i].reason) << i;
    if (i == 0) continue;
    EXPECT_GT(f.transitions[i].t, f.transitions[i - 1].t);
  }
  EXPECT_LT(f.reference_jump_m, 1e-6);
  EXPECT_EQ(f.mission().status().attempts, 1);
  ASSERT_GE(f.requests.size(), 1u);
  EXPECT_FALSE(f.requests[0].keep_jerk);
  EXPECT_FALSE(f.armed());
  EXPECT_FALSE(f.mission().flying());
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
  // Complete stays complete.
  f.wish = OperatorWish::go;
  f.run(2);
  f.wish = OperatorWish::abort;
  f.run(2);
  EXPECT_EQ(f.state(), State::complete);
  EXPECT_EQ(f.c.order, AutopilotOrder::none);
}

TEST(Mission, CommandsFollowTheState) {
  Flight f;
  f.wish = OperatorWish::go;
  bool lifted = false;
  double ramp = 0;
  for (int i = 0; i < 6000 && f.state() != State::complete; ++i) {
    f.step();
    SCOPED_TRACE(to_string(f.state()));
    switch (f.state()) {
      case State::idle:
      case State::complete:
        EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
        EXPECT_TRUE(f.c.on_ground);
        break;
      case State::taken_off:
        if (f.c.lifted) {
          EXPECT_FALSE(lifted) << "lifts off once";
          lifted = true;
          // Thrust at the weight, then a rise of lift_m with the third power of time.
          EXPECT_NEAR(f.c.lifted_since, 0.174, 0.01);
        } else if (f.c.mode == MissionCommand::Mode::ramp) {
          EXPECT_FALSE(lifted);
          EXPECT_GE(f.c.ramp_share, ramp);
          ramp = f.c.ramp_share;
        }
        if (!f.transitions.empty() && f.now() > f.transitions.back().t) {
          EXPECT_EQ(f.c.on_ground, !lifted);
        }
        break;
      case State::follow:
      case State::rendezvous:
        EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
        EXPECT_FALSE(f.c.on_ground);
        EXPECT_TRUE(f.mission().flying());
        break;
      default:
        break;
    }
    const bool leaves = f.c.thrust_least > 0;  // the ground
    EXPECT_TRUE(!leaves || f.state() == State::taken_off);
    EXPECT_GT(f.c.tilt_limit, 30 * kDegree);
    EXPECT_EQ(f.c.platform_speed_wish, 1);
  }
  EXPECT_TRUE(lifted);
  EXPECT_EQ(f.state(), State::complete);
}

TEST(Mission, WhatTheOperatorSaidStandsWhateverComesBetween) {
  for (const bool link : {false, true}) {
    Flight f;
    ASSERT_TRUE(f.reach(State::rendezvous));
    f.wish = OperatorWish::hold;
    f.step();
    ASSERT_EQ(f.state(), State::hold);
    (link ? f.link_up : f.sight) = false;
    f.run(link ? 1.5 : 0.5);
    EXPECT_EQ(f.state(), link ? State::lost_link : State::lost_target);
    (link ? f.link_up : f.sight) = true;
    f.run(20);
    EXPECT_EQ(f.state(), State::hold) << link;
    f.wish = OperatorWish::go;
    EXPECT_TRUE(f.until(State::complete, 60));
  }
  Flight early;
  ASSERT_TRUE(early.reach(State::taken_off));
  early.wish = OperatorWish::hold;
  early.run(20);
  EXPECT_EQ(early.state(), State::hold);

  Flight abort;
  ASSERT_TRUE(bring(abort, State::lost_link));
  abort.mode = AutopilotMode::failsafe;
  abort.link_up = true;
  abort.step();
  abort.wish = OperatorWish::abort;
  abort.step();
  abort.mode = AutopilotMode::offboard;
  abort.run(5);
  EXPECT_EQ(abort.state(), State::aborted);
  EXPECT_GT(abort.orders_land, 0);
}

TEST(Mission, OnAPlatformThatBecomesTooFastItEndsSoonAsTheUserWants) {
  for (const WhenFailed wanted : {WhenFailed::hold, WhenFailed::leave}) {
    for (const State state : {State::follow, State::go_around, State::rendezvous}) {
      SCOPED_TRACE(to_string(state));
      MissionConfig config;
      config.safety.when_failed = wanted;
      Flight f(config);
      ASSERT_TRUE(bring(f, state));
      f.platform_speed = 1.01 * f.rig().limits.speed_m_s;
      const State end = wanted == WhenFailed::hold ? State::hold : State::aborted;
      ASSERT_TRUE(f.until(end, 1));
      EXPECT_EQ(f.reason(), kTooFastSaid);
    }
  }
}

TEST(Mission, APlatformThatIsTooFastForAMomentIsNone) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.platform_speed = 1.5 * f.rig().limits.speed_m_s;
  f.run(0.4);
  f.platform_speed = 0.9;
  EXPECT_TRUE(f.until(State::complete));
}

TEST(Mission, WithoutOdometryItHoldsUntilThereIsSomeAgain) {
  for (const State state : {State::follow, State::rendezvous}) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.platform = false;
    ASSERT_TRUE(f.until(State::hold, 10));
    EXPECT_EQ(f.reason(), "no platform odometry comes");
    f.run(30);
    EXPECT_EQ(f.state(), State::hold);
    // A burst of losses does not change why it holds.
    f.mode = AutopilotMode::failsafe;
    f.run(0.3);
    EXPECT_EQ(f.reason(), "set-points do not arrive: the autopilot acts alone");
    f.mode = AutopilotMode::offboard;
    f.step();
    EXPECT_EQ(f.state(), State::hold);
    EXPECT_EQ(f.reason(), "no platform odometry comes");
    f.platform = true;
    f.step();
    expect_last(f, State::hold, State::follow, "the platform odometry is back");
    EXPECT_TRUE(f.until(State::complete));
  }
}

TEST(Mission, OdometryThatComesBackDoesNotOverruleTheOperator) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.platform = false;
  ASSERT_TRUE(f.until(State::hold, 10));
  f.wish = OperatorWish::hold;
  f.step();
  f.platform = true;
  f.run(5);
  EXPECT_EQ(f.state(), State::hold);
  f.wish = OperatorWish::go;
  EXPECT_TRUE(f.until(State::complete));
}

// What it is thrown out of its way by, it goes on from where it is: a reference that
// has run away would be flown after through whatever is between.
TEST(Mission, FarOffItsWayTheReferenceComesToTheDrone) {
  for (const State state :
       {State::follow, State::go_around, State::hold, State::rendezvous}) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    const std::string before = f.reason();
    f.off = Vector3(-0.5, 0.3, 0.4);
    f.run(0.03);
    if (state == State::hold) {
      EXPECT_EQ(f.reason(), before) << "why it holds";
    }
    EXPECT_LT((f.mission().reference(f.now()).p_NB - f.x().p_NB).norm(), 0.75);
    EXPECT_TRUE(std::any_of(f.transitions.begin(), f.transitions.end(), [](auto& t) {
      return std::string(t.reason) == "far off its way: it goes on from where it is";
    }));
    f.off.setZero();
    if (state == State::hold) f.wish = OperatorWish::go;
    EXPECT_TRUE(f.until(State::complete));
  }
}

TEST(Mission, TheOperatorHoldsAndGoesOn) {
  for (const State state :
       {State::follow, State::rendezvous, State::land, State::go_around}) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.wish = OperatorWish::hold;
    f.step();
    expect_last(f, state, State::hold, "the operator holds");
    f.run(20);
    EXPECT_EQ(f.state(), State::hold);
    f.wish = OperatorWish::go;
    f.step();
    expect_last(f, State::hold, State::follow, "the operator goes on");
    EXPECT_TRUE(f.until(State::complete));
    EXPECT_LT(f.reference_jump_m, 1e-6);
  }
}

TEST(Mission, ALowBatteryEndsTheWaitingAndThenTheFlight) {
  Flight waits;
  ASSERT_TRUE(bring(waits, State::hold));
  waits.battery = 0.1;
  waits.run(0.2);
  EXPECT_EQ(waits.state(), State::hold) << "a dip of the voltage";
  ASSERT_TRUE(waits.until(State::follow, 1));
  EXPECT_EQ(waits.reason(), "the battery is low: it lands without waiting");
  waits.wish = OperatorWish::hold;
  ASSERT_TRUE(waits.until(State::complete, 20)) << waits.reason();

  Flight fails;
  ASSERT_TRUE(bring(fails, State::follow));
  fails.battery = 0.1;
  fails.plans_feasible = false;
  ASSERT_TRUE(fails.until(State::aborted, 20));
  EXPECT_EQ(fails.reason(),
            "the battery is low and the landing failed: the autopilot lands");

  Flight lands;
  ASSERT_TRUE(bring(lands, State::land));
  lands.battery = 0.03;
  lands.run(0.5);
  EXPECT_EQ(lands.state(), State::land);
  EXPECT_EQ(lands.reason(), "the battery is low: the landing goes on");
  EXPECT_TRUE(lands.until(State::complete, 10));

  Flight empty;
  ASSERT_TRUE(bring(empty, State::follow));
  empty.battery = 0.03;
  empty.run(0.5);
  EXPECT_EQ(empty.state(), State::aborted);
  EXPECT_EQ(empty.reason(), "the battery is empty: the autopilot lands");

  MissionConfig config;
  config.safety.when_battery_low = WhenBatteryLow::leave;
  Flight leaves(config);
  ASSERT_TRUE(bring(leaves, State::follow));
  leaves.battery = 0.1;
  leaves.run(0.5);
  EXPECT_EQ(leaves.state(), State::aborted);
  EXPECT_EQ(leaves.reason(), "the battery is low: the autopilot lands");
}

// However often landings fail, with a low battery it does not stay up.
TEST(Mission, ALowBatteryAfterTooManyLandingsTriesOnceMore) {
  MissionConfig config;
  config.safety.landings_max = 2;
  Flight f(config);
  f.plans_feasible = false;
  ASSERT_TRUE(f.reach(State::hold));
  f.battery = 0.1;
  ASSERT_TRUE(f.until(State::rendezvous, 20));
  ASSERT_TRUE(f.until(State::aborted, 20));
}

TEST(Mission, WhatDoesNotComeToRestHolds) {
  Flight f;
  ASSERT_TRUE(f.reach(State::follow));
  f.off = Vector3(0.2, 0, 0);
  ASSERT_TRUE(f.until(State::hold, 30));
  EXPECT_EQ(f.reason(), "it does not come to rest at the follow point");
}

TEST(Mission, AComputerThatStoodStillIsToldOnceAndTheWayTakenUpAnew) {
  for (const double off : {0.1, 0.5}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    const std::size_t before = f.transitions.size();
    f.computer_was_late = true;
    f.off = Vector3(0, 0, -off);
    f.x().p_NB.z() -= off;
    f.step();
    f.off.setZero();
    ASSERT_EQ(f.transitions.size(), before + 1);
    EXPECT_EQ(f.reason(), "the computer stood still");
    EXPECT_EQ(f.state(), off > 0.35 ? State::go_around : State::follow);
    f.run(0.3);
    EXPECT_EQ(f.transitions.size(), before + 1);
    f.computer_was_late = false;
    EXPECT_TRUE(f.until(State::complete));
  }
}

// One fault of any kind and length, at any moment: never a disarm away from the pad,
// never a set-point against the autopilot's own landing, and an end that is told.
TEST(Mission, AnyOneFaultAtAnyMomentEndsWell) {
  int complete = 0, aborted = 0;
  for (int fault = 0; fault < 6; ++fault) {
    for (int moment = 0; moment < 24; ++moment) {
      for (const double lasting : {0.15, 0.6, 8.0}) {
        SCOPED_TRACE(testing::Message()
                     << "fault " << fault << " at " << moment << " for " << lasting);
        Flight f;
        f.wish = OperatorWish::go;
        const Time begin = f.now() + from_seconds(0.7 * moment + 0.005);
        const Time end = begin + from_seconds(lasting);
        for (int i = 0; i < 6000; ++i) {
          const bool on = f.now() >= begin && f.now() < end;
          f.sight = !(fault == 0 && on);
          f.link_up = !(fault == 1 && on);
          f.planner_answers = !(fault == 2 && on);
          f.plans_feasible = !(fault == 3 && on);
          f.mode = fault == 4 && on ? AutopilotMode::failsafe : AutopilotMode::offboard;
          f.off = fault == 5 && on && f.mission().flying() ? Vector3(0, 0.4, 0)
                                                           : Vector3::Zero();
          const bool flew = f.mission().flying();
          f.step();
          if (f.c.order == AutopilotOrder::disarm && flew) {
            EXPECT_LT(f.x().p_NB.z(), f.rig().drone.gear_height_m + 0.03);
            EXPECT_LT(f.x().p_NB.head<2>().norm(), 0.45);
          }
          // Once the autopilot has been left to itself nothing interferes.
          if (f.state() == State::lost_link || f.orders_land > 0) {
            EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
          }
          EXPECT_STRNE(f.mission().status().reason, "");
          if (f.state() == State::complete || f.state() == State::aborted) break;
        }
        complete += f.state() == State::complete;
        aborted += f.state() == State::aborted;
        EXPECT_TRUE(f.state() == State::complete || f.state() == State::aborted ||
                    f.state() == State::refused)
            << to_string(f.state()) << ": " << f.reason();
      }
    }
  }
  EXPECT_GT(complete, 300);
  EXPECT_GT(aborted, 5);
}

}  // namespace
}  // namespace alight
