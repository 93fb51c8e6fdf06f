#include <algorithm>
#include <cmath>
#include <string>

#include "alight/mission/test/flight.h"

namespace alight {
namespace {

constexpr State kInTheAir[] = {State::follow, State::rendezvous, State::land,
                               State::hold,   State::go_around,  State::lost_target};

TEST(Mission, AbortInTheAirLandsByTheAutopilot) {
  for (const State state : kInTheAir) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.wish = OperatorWish::abort;
    f.step();
    expect_last(f, state, State::aborted, "the operator aborted: the autopilot lands");
    // Clear of the platform and, unseen, at rest over the ground; then ordered again
    // and again, until the motors stand; never a disarm in the air.
    f.run(3);
    EXPECT_GE(f.orders_land, 8);
    EXPECT_EQ(f.orders_disarm, 0);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
    f.mode = AutopilotMode::land;
    EXPECT_TRUE(f.mission().flying());
    f.motors_stop = true;
    f.run(0.1);
    EXPECT_FALSE(f.mission().flying());
    const int ordered = f.orders_land;
    f.run(1);
    EXPECT_EQ(f.orders_land, ordered);
    EXPECT_EQ(f.state(), State::aborted);
  }
}

TEST(Mission, AbortWhileClimbingLandsByTheAutopilot) {
  Flight f;
  ASSERT_TRUE(f.reach(State::taken_off));
  while (!f.mission().flying() && f.state() == State::taken_off) f.step();
  ASSERT_TRUE(f.mission().flying());
  f.wish = OperatorWish::abort;
  f.step();
  expect_last(f, State::taken_off, State::aborted,
              "the operator aborted: the autopilot lands");
}

TEST(Mission, ALostTargetThatReturnsGoesAround) {
  for (const State state :
       {State::follow, State::rendezvous, State::land, State::go_around}) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.sight = false;
    f.run(0.2);
    EXPECT_EQ(f.state(), state) << "a few pictures are no loss";
    f.run(0.1);
    expect_last(f, state, State::lost_target, "the LEDs are out of sight");
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::track) << "flies on by the prediction";
    EXPECT_TRUE(f.mission().flying());
    f.run(1);
    EXPECT_EQ(f.state(), State::lost_target);
    f.sight = true;
    f.step();
    expect_last(f, State::lost_target, State::go_around, "the LEDs are in sight again");
    EXPECT_TRUE(f.until(State::complete)) << to_string(f.state());
    EXPECT_LT(f.reference_jump_m, 1e-6);
  }
}

TEST(Mission, TheSearchGetsFromAboveThePadToWhereItSearchesInTime) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.25));
  f.sight = false;
  ASSERT_TRUE(f.until(State::lost_target, 1));
  f.run(MissionConfig{}.give_up_s - 0.1);
  ASSERT_EQ(f.state(), State::lost_target);
  const Vector3 goal = places_for({}, f.rig()).search_point;
  EXPECT_LT((f.x().p_NB - goal).norm(), 0.02);
}

TEST(Mission, ADroneThatIsGivenUpIsTakenBackWhenItIsSeenBeforeItIsLeft) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_target));
  ASSERT_TRUE(f.until(State::aborted, 8));
  ASSERT_EQ(f.orders_land, 0);
  f.sight = true;
  f.run(0.1);
  expect_last(f, State::aborted, State::go_around, "the LEDs are in sight again");
  EXPECT_TRUE(f.until(State::land, 20));
  EXPECT_EQ(f.orders_land, 0);

  Flight told;
  ASSERT_TRUE(bring(told, State::lost_target));
  ASSERT_TRUE(told.until(State::aborted, 8));
  told.wish = OperatorWish::abort;
  told.sight = true;
  told.run(1);
  EXPECT_EQ(told.state(), State::aborted);
}

// The wind takes it to the lens, where a climb would pass over the picture's edge.
TEST(Mission, ADroneLostBesideTheLensGoesBackIntoThePictureBeforeItClimbs) {
  MissionConfig config;
  config.give_up_s = 6;
  Flight f(config);
  ASSERT_TRUE(f.reach(State::taken_off));
  while (f.state() == State::taken_off && f.x().p_NB.z() < 0.2) f.step();
  ASSERT_EQ(f.state(), State::taken_off);
  const Rig& rig = f.rig();
  f.off = Vector3(0.4, 0.2, 0);
  f.sight = false;
  ASSERT_TRUE(f.until(State::lost_target, 1));
  f.off.setZero();
  const Vector3 from = f.x().p_NB;
  ASSERT_FALSE(in_view(rig.camera, rig.leds, from));
  while (!in_view(rig.camera, rig.leds, f.x().p_NB) &&
         f.state() == State::lost_target) {
    f.step();
  }
  ASSERT_EQ(f.state(), State::lost_target);
  EXPECT_LT(f.x().p_NB.z(), from.z() + 0.15);
  f.run(4);
  EXPECT_TRUE(f.x().p_NB.isApprox(places_for({}, rig).search_point, 1e-6));
}

TEST(Mission, ALostTargetThatStaysAwayIsLeftToTheAutopilot) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_target));
  const Time since = f.now();
  ASSERT_TRUE(f.until(State::aborted, 8));
  EXPECT_EQ(f.reason(), "the LEDs stay out of sight: the autopilot lands");
  EXPECT_NEAR(to_seconds(f.now() - since), MissionConfig{}.give_up_s, 0.05);
  while (f.orders_land == 0 && f.state() == State::aborted) f.step();
  f.sight = true;
  f.run(1);
  EXPECT_EQ(f.state(), State::aborted);
  EXPECT_GE(f.orders_land, 5);
}

TEST(Mission, ALostLinkLeavesTheAutopilotAlone) {
  for (const State state : kInTheAir) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.link_up = false;
    double limit = f.c.tilt_limit;
    bool silent_too_soon = false;
    const Time since = f.now();
    while (f.state() != State::lost_link && f.now() - since < 2'000'000'000) {
      f.x().v_NB.z() -= 1;  // What it is told does not reach it.
      f.step();
      // As the link ages the tilt that may be commanded shrinks.
      EXPECT_LE(f.c.tilt_limit, limit);
      limit = f.c.tilt_limit;
      silent_too_soon |=
          f.state() != State::lost_link && f.c.mode == MissionCommand::Mode::silent;
    }
    ASSERT_EQ(f.state(), State::lost_link);
    EXPECT_EQ(f.reason(), "nothing heard from the drone: its autopilot acts alone");
    EXPECT_FALSE(silent_too_soon);
    EXPECT_LE(limit, 3.01 * kDegree);
    f.run(3);
    EXPECT_EQ(f.state(), State::lost_link);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
    EXPECT_TRUE(f.mission().flying());
  }
}

TEST(Mission, ALinkThatReturnsGoesAround) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_link));
  f.sight = false;
  f.run(0.5);
  f.sight = true;
  f.link_up = true;
  f.step();
  expect_last(f, State::lost_link, State::go_around, "the link is back");
  EXPECT_TRUE(f.until(State::complete));
}

// It waits for set-points, and in sight it is taken back; not so near above the pad
// that it may as well land, nor where set-points have come for long and changed
// nothing.
TEST(Mission, ALinkThatReturnsEndsTheFailsafe) {
  for (const bool low : {false, true}) {
    SCOPED_TRACE(low);
    Flight f;
    ASSERT_TRUE(bring(f, State::lost_link));
    f.x().p_NB = Vector3(0, 0, f.rig().drone.gear_height_m + (low ? 0.05 : 0.4));
    f.mode = AutopilotMode::failsafe;
    f.link_up = true;
    f.run(0.05);
    EXPECT_EQ(f.state(), low ? State::lost_link : State::go_around);
    if (low) continue;
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
    f.run(0.5);
    EXPECT_EQ(f.state(), State::go_around);
    f.mode = AutopilotMode::offboard;
    EXPECT_TRUE(f.until(State::complete));
  }
  Flight deaf;
  ASSERT_TRUE(bring(deaf, State::lost_link));
  deaf.x().p_NB.z() = 0.5;
  deaf.mode = AutopilotMode::failsafe;
  deaf.link_up = true;
  deaf.run(1.2);
  EXPECT_EQ(deaf.state(), State::lost_link);
  EXPECT_EQ(deaf.reason(), "the autopilot's failsafe has taken over");
  deaf.run(5);
  EXPECT_EQ(deaf.state(), State::lost_link);
}

TEST(Mission, ALinkThatReturnsToABlindDroneGivesUpInTime) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_link));
  f.sight = false;
  f.run(0.5);
  f.link_up = true;
  f.step();
  expect_last(f, State::lost_link, State::lost_target,
              "the link is back, the LEDs are out of sight");
  EXPECT_TRUE(f.until(State::aborted, 8));
  f.run(2);
  EXPECT_GT(f.orders_land, 0);
}

TEST(Mission, TheAutopilotsFailsafeTakesOver) {
  for (const State state : kInTheAir) {
    SCOPED_TRACE(to_string(state));
    Flight landing;
    ASSERT_TRUE(bring(landing, state));
    landing.mode = AutopilotMode::land;
    landing.step();
    expect_last(landing, state, State::lost_link,
                "the autopilot's failsafe has taken over");
  }
  // A burst of losses passes.
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.mode = AutopilotMode::failsafe;
  f.run(0.9);
  f.mode = AutopilotMode::offboard;
  f.run(0.2);
  f.mode = AutopilotMode::failsafe;
  f.run(0.9);
  for (const auto& t : f.transitions) EXPECT_NE(t.to, State::lost_link);
  f.run(0.3);
  EXPECT_EQ(f.state(), State::lost_link);
  EXPECT_EQ(f.reason(), "the autopilot's failsafe has taken over");
}

// Beside the platform the autopilot does not see that it stands, and leans until it
// tips over.
TEST(Mission, MotorsStopOnceADroneStandsOnTheFloor) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.wish = OperatorWish::abort;
  f.run(5);
  ASSERT_EQ(f.state(), State::aborted);
  ASSERT_GT(f.orders_land, 0);
  f.mode = AutopilotMode::land;
  EXPECT_EQ(f.orders_disarm, 0);
  f.stands_on_floor = true;
  f.run(0.3);
  EXPECT_GT(f.orders_disarm, 0);
  EXPECT_FALSE(f.armed());
  EXPECT_EQ(f.state(), State::aborted);
  EXPECT_EQ(f.reason(), "the operator aborted: the autopilot lands");
  EXPECT_EQ(std::count_if(f.transitions.begin(), f.transitions.end(),
                          [](const MissionTransition& t) {
                            return std::string(t.reason) ==
                                   "stands on the floor: its motors are stopped";
                          }),
            1);
}

TEST(Mission, MotorsStopOnTheFloorAlsoWhereTheLinkWasLostAndIsBack) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.mode = AutopilotMode::failsafe;
  ASSERT_TRUE(f.until(State::lost_link, 3));
  f.run(1);
  EXPECT_EQ(f.orders_disarm, 0);
  f.stands_on_floor = true;
  f.run(0.3);
  EXPECT_GT(f.orders_disarm, 0);
  EXPECT_EQ(f.state(), State::complete);
}

TEST(Mission, MotorsThatStopInTheAirEndIt) {
  for (const State state : kInTheAir) {
    if (state == State::land) continue;
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.motors_stop = true;
    f.run(0.05);
    expect_last(f, state, State::aborted, "the autopilot stopped its motors");
    EXPECT_FALSE(f.mission().flying());
    EXPECT_EQ(f.orders_land, 0);
  }
}

TEST(Mission, MotorsThatStopDuringTheApproachEndItToo) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  f.run(0.3);
  f.motors_stop = true;
  for (int i = 0; i < 100 && f.state() != State::aborted; ++i) {
    f.off.z() = -0.5 * kGravity * i * i * 1e-4;
    f.step();
  }
  EXPECT_EQ(f.state(), State::aborted);
  EXPECT_EQ(f.reason(), "the autopilot stopped its motors");
}

// Not seen, it may be lower than it is believed to be: low it had better climb, the
// more, the longer that lasts. High up there is room, and seen there is no doubt.
TEST(Mission, UnseenAndLowItIsFlownAsIfItHadSunk) {
  for (const double above : {0.1, 0.3, 0.8}) {
    SCOPED_TRACE(above);
    Flight f;
    ASSERT_TRUE(f.reach(State::taken_off));
    f.run(0.5);
    f.lifts = false;
    const double z = f.rig().drone.gear_height_m + above;
    f.x().p_NB.z() = z;
    f.step();
    EXPECT_EQ(f.c.raise_m, 0);
    f.sight = false;
    double raise = 0;
    for (int i = 0; i < 80; ++i) {
      f.x().p_NB.z() = z;
      f.step();
      ASSERT_EQ(f.c.mode, MissionCommand::Mode::track);
      EXPECT_GE(f.c.raise_m, raise);
      EXPECT_LE(f.c.raise_m - raise, 0.01) << "a jump";
      EXPECT_TRUE(f.c.raise_m_s == 0 || f.c.raise_m > 0);
      raise = f.c.raise_m;
    }
    EXPECT_EQ(f.state(), State::lost_target);
    EXPECT_NEAR(raise, std::clamp(0.3 - above + 0.15, 0.0, 0.3), 0.02);
    f.sight = true;
    f.step();
    EXPECT_EQ(f.c.raise_m, 0);
    EXPECT_EQ(f.c.raise_m_s, 0);
  }
}

// Blind, the autopilot leans on the floor until its motors stop.
TEST(Mission, ADroneThatIsAbortedInSightIsSeenToTheFloor) {
  for (const bool seen : {true, false}) {
    SCOPED_TRACE(seen);
    Flight f;
    ASSERT_TRUE(f.reach(State::rendezvous));
    f.wish = OperatorWish::abort;
    while (f.orders_land == 0) f.step();
    f.sight = seen;
    f.run(0.5);
    f.mode = AutopilotMode::land;
    f.step();
    f.run(1);
    EXPECT_NEAR(f.c.platform_speed_wish, seen ? std::exp(-1.0) : 1, 0.02);
    f.run(4);
    EXPECT_EQ(f.c.platform_speed_wish, 0) << "nor does it come round again";
  }
}

TEST(Mission, LedsLostWhileTheComputerStoodStillStayItsFault) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.sight = false;
  f.computer_was_late = true;
  f.blindness = Blindness::computer;
  ASSERT_TRUE(f.until(State::lost_target, 2));
  f.run(1);
  f.computer_was_late = false;
  f.blindness = Blindness::leds;
  ASSERT_TRUE(f.until(State::aborted, 4));
  EXPECT_EQ(f.reason(),
            "the computer stood still, the LEDs are lost: the autopilot lands");
}

TEST(Mission, LedsLostAfterTheAutopilotActedAloneAreLostForWantOfSetPoints) {
  for (const Seconds until_lost : {0.4, 3.0}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    f.mode = AutopilotMode::failsafe;
    f.run(0.3);
    EXPECT_EQ(f.state(), State::follow);
    EXPECT_EQ(f.reason(), "set-points do not arrive: the autopilot acts alone");
    const std::size_t told = f.transitions.size();
    f.run(0.2);
    EXPECT_EQ(f.transitions.size(), told) << "once";
    f.mode = AutopilotMode::offboard;
    f.run(until_lost);
    f.sight = false;
    ASSERT_TRUE(f.until(State::aborted, 6));
    EXPECT_EQ(f.reason(),
              until_lost < 1
                  ? "set-points did not arrive, the LEDs are lost: the autopilot lands"
                  : "the LEDs stay out of sight: the autopilot lands");
  }
}

TEST(Mission, SightLostForAReasonIsToldByIt) {
  struct Case {
    Blindness why;
    const char *lost, *given_up;
  };
  const Case cases[] = {
      {Blindness::pictures, "no pictures come from the camera",
       "no pictures come from the camera: the autopilot lands"},
      {Blindness::late, "the pictures come too late",
       "the pictures come too late: the autopilot lands"},
      {Blindness::frozen, "the camera repeats its picture",
       "the camera repeats its picture: the autopilot lands"},
      {Blindness::computer, "the computer stood still",
       "the computer stood still, the LEDs are lost: the autopilot lands"}};
  for (const Case& c : cases) {
    for (const State state : {State::follow, State::rendezvous, State::land}) {
      Flight f;
      ASSERT_TRUE(bring(f, state));
      f.sight = false;
      f.blindness = c.why;
      f.run(0.3);
      expect_last(f, state, State::lost_target, c.lost);
      ASSERT_TRUE(f.until(State::aborted, 8));
      EXPECT_EQ(f.reason(), c.given_up);
    }
  }
  // What is known later is told later, once.
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_target));
  f.blindness = Blindness::late;
  const std::size_t before = f.transitions.size();
  f.run(1.5);
  EXPECT_EQ(f.state(), State::lost_target);
  EXPECT_EQ(f.reason(), "the pictures come too late");
  EXPECT_EQ(f.transitions.size(), before + 1);
}

TEST(Mission, TheSearchGoesUpInView) {
  MissionConfig config;
  config.give_up_s = 6;
  Flight f(config);
  ASSERT_TRUE(bring(f, State::lost_target));
  f.run(4);
  const MissionConfig placed = places_for({}, f.rig());
  EXPECT_GT(placed.search_point.z(), placed.follow_point.z() + 0.1);
  EXPECT_TRUE(f.x().p_NB.isApprox(placed.search_point, 1e-6));
  for (int i = 0; i < f.rig().leds.size(); ++i) {
    EXPECT_TRUE(project_led(f.rig().camera,
                            make_pose(Matrix3::Identity(), placed.search_point),
                            f.rig().leds.p_BL(i)));
  }
}

// Given up unseen on a moving platform: at rest over the ground when the autopilot,
// which does not know its speed, takes over; without a jump on the way.
TEST(Mission, AnUnseenDroneIsStoppedOverTheGroundBeforeTheAutopilotLands) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_target));
  ASSERT_TRUE(f.until(State::aborted, 8));
  EXPECT_EQ(f.orders_land, 0);
  Vector3 v = f.x().v_NB;
  while (f.orders_land == 0 && f.state() == State::aborted) {
    v = f.x().v_NB;
    f.step();
    EXPECT_LT((f.x().v_NB - v).norm(), 0.05);
  }
  const Vector3 platform(0.9, 0, 0);  // Flight's
  EXPECT_LT((v + platform).norm(), 0.2);
  EXPECT_LT(to_seconds(f.now() - f.transitions.back().t), 1.5);
}

/// With which speed over the ground, in N, a blind drone is left to its autopilot.
Vector3 left_blind_with(Flight& f, Blindness why = Blindness::pictures) {
  f.blindness = why;
  f.sight = false;
  EXPECT_TRUE(f.until(State::aborted, 8));
  Vector3 v_N = Vector3::Zero();
  while (f.orders_land == 0 && f.state() == State::aborted) {
    v_N = f.x().v_NB + Vector3(f.platform_speed, 0, 0);
    f.step();
  }
  EXPECT_LT(to_seconds(f.now() - f.transitions.back().t), 2);
  return v_N;
}

// Its autopilot keeps it level and the wind blows it away until it is down.
TEST(Mission, ABlindDroneIsLeftMovingAgainstTheWindThatIsKnown) {
  for (const Vector3& push : {Vector3(0, 0.3, 0), Vector3(-0.2, -0.15, 0.4)}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::rendezvous));
    f.push_N = push;
    const Vector3 v_N = left_blind_with(f);
    const Vector3 level(push.x(), push.y(), 0);
    EXPECT_LT((v_N + 1.1 * level).norm(), 0.25) << v_N.transpose();
    EXPECT_LT(v_N.dot(level), -0.05);
  }
  // No faster than it can be sure of.
  Flight stormy;
  ASSERT_TRUE(bring(stormy, State::rendezvous));
  stormy.push_N = Vector3(0, 3, 0);
  EXPECT_NEAR(left_blind_with(stormy).norm(), 0.8, 0.2);
  // What it met in its first second of flight may have been a gust.
  Flight early;
  ASSERT_TRUE(early.reach(State::taken_off));
  while (!early.mission().flying()) early.step();
  early.run(0.8);
  early.push_N = Vector3(0, 0.5, 0);
  EXPECT_LT(left_blind_with(early).norm(), 0.2);
  // Or it goes on to be told.
  Flight told;
  ASSERT_TRUE(told.reach(State::taken_off));
  while (!told.mission().flying()) told.step();
  told.run(0.8);
  told.push_N = Vector3(0, 0.5, 0);
  told.told_of = true;
  EXPECT_LT(left_blind_with(told).y(), -0.3);
  // As long as pictures come it may be seen again.
  Flight hidden;
  ASSERT_TRUE(bring(hidden, State::rendezvous));
  hidden.push_N = Vector3(0, 0.5, 0);
  EXPECT_LT(left_blind_with(hidden, Blindness::leds).norm(), 0.2);
}

TEST(Mission, WhereNoPicturesComeTheSearchIsShorter) {
  for (const Blindness why : {Blindness::pictures, Blindness::frozen}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    f.blindness = why;
    f.sight = false;
    ASSERT_TRUE(f.until(State::lost_target, 1));
    const Time since = f.now();
    ASSERT_TRUE(f.until(State::aborted, 8));
    EXPECT_NEAR(to_seconds(f.now() - since), MissionConfig{}.give_up_dark_s, 0.05);
  }
}

// Height helps to be seen, and is the longer to fall.
TEST(Mission, WhereNoPicturesComeItDoesNotClimbToBeSeen) {
  const auto lost = [](Flight& f, Blindness why) {
    ASSERT_TRUE(bring(f, State::follow));
    f.blindness = why;
    f.sight = false;
    ASSERT_TRUE(f.until(State::lost_target, 1));
    f.run(0.9);
    ASSERT_EQ(f.state(), State::lost_target);
  };
  Flight lit;
  lost(lit, Blindness::leds);
  for (const Blindness why : {Blindness::pictures, Blindness::frozen}) {
    Flight f;
    lost(f, why);
    const double before = f.x().p_NB.z();
    EXPECT_LT(before, lit.x().p_NB.z() - 0.1);
    // Pictures come again, and show no LEDs.
    f.blindness = Blindness::leds;
    f.run(1);
    EXPECT_EQ(f.state(), State::lost_target);
    EXPECT_GT(f.x().p_NB.z(), before + 0.1);
  }
}

TEST(Mission, LostRightAfterTheTakeOffItIsLeftToTheAutopilotSoon) {
  Flight f;
  ASSERT_TRUE(f.reach(State::taken_off));
  while (!f.mission().flying()) f.step();
  f.run(0.3);
  f.sight = false;
  const Time lost = f.now();
  while (f.orders_land == 0 && f.now() - lost < from_seconds(5)) f.step();
  EXPECT_EQ(f.state(), State::aborted);
  EXPECT_GT(to_seconds(f.now() - lost), 1.1) << "pictures may miss for a second";
  EXPECT_LT(to_seconds(f.now() - lost), 1.3);
}

TEST(Mission, AnAbortedLandingLeavesThePlatformFirst) {
  const PlatformOutline outline(alan_rig());
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.25));
  ASSERT_FALSE(outline.clear(f.x().p_NB));
  f.wish = OperatorWish::abort;
  f.step();
  ASSERT_EQ(f.state(), State::aborted);
  while (f.orders_land == 0) {
    f.step();
    ASSERT_LT(to_seconds(f.now() - f.transitions.back().t), 4.1);
  }
  EXPECT_TRUE(outline.clear(f.x().p_NB));
  EXPECT_LT(f.reference_jump_m, 1e-6);
  // Not where the autopilot has taken over.
  Flight g;
  ASSERT_TRUE(g.reach(State::land));
  ASSERT_TRUE(g.until_below(0.25));
  g.mode = AutopilotMode::failsafe;
  g.run(0.3);
  g.wish = OperatorWish::abort;
  g.run(0.3);
  EXPECT_GT(g.orders_land, 0);
}

// Unheard a drone may hear all the same; one that flies by itself may as well be told
// to.
TEST(Mission, AnAbortedDroneIsNotLeftWhereTheWindBlowsItOntoThePlatform) {
  // Behind a platform that stands, the wind from behind: it is led aside first.
  for (const double side : {1.0, -1.0}) {
    Flight f;
    f.platform_speed = 0;
    ASSERT_TRUE(f.reach(State::rendezvous));
    f.push_N = Vector3(1.5, 0.2 * side, 0);
    f.wish = OperatorWish::abort;
    f.run(0.3);
    EXPECT_EQ(f.state(), State::aborted);
    EXPECT_EQ(f.orders_land, 0);
    f.run(3.5);
    EXPECT_GT(f.orders_land, 0);
    const WayDown way_down(f.rig());
    EXPECT_TRUE(way_down.clear({f.x().p_NB, Vector3::Zero(), f.push_N}, {}))
        << f.x().p_NB.transpose();
  }
  // Of a platform that drives on it is clear where it is.
  Flight f;
  ASSERT_TRUE(f.reach(State::follow));
  f.run(1.5);
  f.push_N = Vector3(0.5, 0, 0);
  f.wish = OperatorWish::abort;
  f.run(1);
  EXPECT_GT(f.orders_land, 0);
}

// Who aborts a landing stops the platform, too: a drone that is carried along by its
// speed, or by the wind, is let fall behind first.
TEST(Mission, AnAbortedDroneIsLeftWhereAPlatformThatStopsIsNotInItsWay) {
  for (const double push : {0.0, 0.5, 1.0}) {
    SCOPED_TRACE(push);
    Flight f;
    f.platform_speed = 1.2;
    ASSERT_TRUE(f.reach(State::rendezvous));
    f.push_N = Vector3(push, 0, 0);
    const WayDown way_down(f.rig());
    PlatformState platform;
    platform.v_IN_N = Vector3(f.platform_speed, 0, 0);
    const auto clear = [&] {
      return way_down.clear_of_stop(
          {f.x().p_NB, f.x().v_NB + platform.v_IN_N, f.push_N}, platform);
    };
    EXPECT_FALSE(clear());
    f.wish = OperatorWish::abort;
    f.run(0.3);
    EXPECT_EQ(f.state(), State::aborted);
    EXPECT_EQ(f.orders_land, 0);
    for (int i = 0; i < 250 && f.orders_land == 0; ++i) f.step();
    EXPECT_GT(f.orders_land, 0) << "not for ever";
    EXPECT_TRUE(clear()) << f.x().p_NB.transpose();
    EXPECT_LT(f.reference_jump_m, 1e-6);
  }
}

// It does not fly on while it slows down for a platform that then stands.
TEST(Mission, AnAbortedDroneStaysNearAPlatformThatStopsMeanwhile) {
  for (const double push : {0.0, 0.6, -0.6}) {
    for (const double later : {0.1, 0.3, 0.6}) {
      SCOPED_TRACE(testing::Message() << push << " " << later);
      Flight f;
      f.platform_speed = 1.2;
      ASSERT_TRUE(f.reach(State::rendezvous));
      f.push_N = Vector3(push, 0, 0);
      f.wish = OperatorWish::abort;
      f.run(later);
      f.platform_speed = 0;
      for (int i = 0; i < 450 && f.orders_land == 0; ++i) {
        f.step();
        ASSERT_LT(f.x().v_NB.norm(), 1.5);
      }
      EXPECT_GT(f.orders_land, 0);
      EXPECT_LT(f.x().p_NB.norm(), 2.5);
      EXPECT_LT(f.reference_jump_m, 1e-6);
    }
  }
}

// From where it is told to be left it falls behind all the same.
TEST(Mission, AnAbortedDroneThatFallsBehindWhereItIsToBeLeftDoesNotFlyOn) {
  MissionConfig config;
  config.safety.leave_at_m = Vector3(-0.8, 0, 0.6);
  Flight f(config);
  f.platform_speed = 2;
  ASSERT_TRUE(f.reach(State::follow));
  f.push_N = Vector3(1.2, 0, 0);
  f.wish = OperatorWish::abort;
  for (int i = 0; i < 450 && f.orders_land == 0; ++i) {
    f.step();
    ASSERT_LT(f.x().v_NB.norm(), 2.1);
  }
  EXPECT_GT(f.orders_land, 0);
  EXPECT_LT(f.x().p_NB.norm(), 2.5) << f.x().p_NB.transpose();
  EXPECT_LT(f.reference_jump_m, 1e-6);
}

// What begins to brake is slow before the drone is seen to come nearer.
TEST(Mission, AnAbortedDroneIsLeftOnceItHasBeenClearForAWhile) {
  Flight f;
  ASSERT_TRUE(f.reach(State::follow));
  f.run(1.5);
  f.wish = OperatorWish::abort;
  f.run(0.1);
  EXPECT_EQ(f.state(), State::aborted);
  EXPECT_EQ(f.orders_land, 0);
  f.run(0.3);
  EXPECT_GT(f.orders_land, 0);
}

TEST(Mission, AnAbortedDroneThatIsSeenAgainMustHaveBeenClearForAWhileThen) {
  Flight f;
  ASSERT_TRUE(f.reach(State::follow));
  f.run(1.5);
  f.wish = OperatorWish::abort;
  f.run(0.1);
  f.sight = false;
  f.run(0.4);
  ASSERT_EQ(f.state(), State::aborted);
  ASSERT_EQ(f.orders_land, 0);
  f.sight = true;
  f.run(0.15);
  EXPECT_EQ(f.orders_land, 0);
  f.run(0.25);
  EXPECT_GT(f.orders_land, 0);
}

TEST(Mission, WhereNoPlaceIsClearOfTheWindItIsLeftInTimeAllTheSame) {
  Flight f;
  f.platform_speed = 0;
  ASSERT_TRUE(f.reach(State::rendezvous));
  f.push_N = Vector3(30, 0, 0);
  f.wish = OperatorWish::abort;
  f.run(MissionConfig{}.leave_max_s + 0.3);
  EXPECT_GT(f.orders_land, 0);
}

TEST(Mission, AbortedUnheardItIsLedAwayWhileItDoesAsItIsTold) {
  const PlatformOutline outline(alan_rig());
  for (const bool obeys : {true, false}) {
    SCOPED_TRACE(obeys);
    Flight f;
    ASSERT_TRUE(f.reach(State::taken_off));
    while (f.x().p_NB.z() < 0.2) f.step();
    f.link_up = false;
    f.wish = OperatorWish::abort;
    if (!obeys) f.off_m_s = Vector3(0, 0.7, 0);
    const Time begun = f.now();
    while (f.orders_land == 0) {
      f.step();
      ASSERT_EQ(f.state(), State::aborted);
      ASSERT_LT(to_seconds(f.now() - begun), 4.1);
    }
    EXPECT_EQ(outline.clear(f.x().p_NB), obeys);
    if (!obeys) {
      EXPECT_LT(to_seconds(f.now() - begun), 1);
    }
  }
}

TEST(Mission, ThePilotsSwitchWinsInEveryStateAndNothingIsOrdered) {
  for (const AutopilotMode mode : {AutopilotMode::hold, AutopilotMode::manual}) {
    for (const State state : kInTheAir) {
      SCOPED_TRACE(to_string(state));
      Flight f;
      ASSERT_TRUE(bring(f, state));
      f.mode = mode;
      f.step();
      expect_last(f, state, State::pilot, "the pilot has taken over");
      f.wish = OperatorWish::abort;
      for (int i = 0; i < 300; ++i) {
        f.x().p_NB += Vector3(0.002, 0.001, 0.001);  // the pilot's
        const Vector3 p = f.x().p_NB;
        f.step();
        EXPECT_EQ(f.c.order, AutopilotOrder::none);
        EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
        EXPECT_LT((f.mission().reference(f.now()).p_NB - p).norm(), 1e-9)
            << "asks for nothing but to go on";
      }
      EXPECT_EQ(f.state(), State::pilot);
      f.mode = AutopilotMode::offboard;
      f.run(0.1);
      EXPECT_EQ(f.state(), State::aborted) << "what the operator said stands";
    }
  }
}

// There what a turn of the platform asks for is no way to begin with.
TEST(Mission, GivenBackFarFromAPlatformThatTurnsItIsLeftToItsAutopilot) {
  for (const double turn : {0.0, 0.6, 1.2}) {
    SCOPED_TRACE(turn);
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    f.platform_turn = turn;
    f.mode = AutopilotMode::hold;
    f.run(1);
    f.x().p_NB += Vector3(-0.9, 1.5, 0);
    f.x().v_NB = Vector3(0.4, 0.3, 0);
    f.run(0.1);
    f.mode = AutopilotMode::offboard;
    f.run(0.1);
    EXPECT_EQ(f.state(), turn < 1 ? State::go_around : State::aborted) << f.reason();
  }
}

TEST(Mission, ThePilotGivesItBack) {
  Flight seen;
  ASSERT_TRUE(bring(seen, State::land));
  seen.mode = AutopilotMode::hold;
  seen.run(2);
  seen.mode = AutopilotMode::offboard;
  seen.step();
  expect_last(seen, State::pilot, State::go_around, "the pilot has given it back");
  EXPECT_TRUE(seen.until(State::complete));

  Flight unseen;
  ASSERT_TRUE(bring(unseen, State::follow));
  unseen.mode = AutopilotMode::hold;
  unseen.run(1);
  unseen.sight = false;
  unseen.run(3);
  EXPECT_EQ(unseen.state(), State::pilot);
  EXPECT_EQ(unseen.reason(), "the pilot flies, the LEDs are out of sight");
  unseen.mode = AutopilotMode::offboard;
  unseen.step();
  EXPECT_EQ(unseen.state(), State::aborted);
  EXPECT_EQ(unseen.reason(),
            "the pilot has given it back out of sight: the autopilot lands");

  Flight lands;
  ASSERT_TRUE(bring(lands, State::follow));
  lands.mode = AutopilotMode::hold;
  lands.run(1);
  lands.motors_stop = true;
  ASSERT_TRUE(lands.until(State::complete, 1));
  EXPECT_EQ(lands.reason(), "the pilot stopped the motors");
}

// Autopilots take up set-points from a stream that runs, and only then.
TEST(Mission, ThePilotCanGiveItBackHoweverLongItWasNotSeen) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.mode = AutopilotMode::hold;
  f.run(1);
  f.sight = f.estimate = false;
  for (int i = 0; i < 1000; ++i) {
    f.step();
    ASSERT_EQ(f.state(), State::pilot);
    ASSERT_EQ(f.c.mode, MissionCommand::Mode::ramp);  // level,
    ASSERT_EQ(f.c.ramp_share, 1);                     // as it hovers
    ASSERT_EQ(f.c.order, AutopilotOrder::none);
  }
  f.mode = AutopilotMode::offboard;
  f.run(0.2);
  EXPECT_EQ(f.state(), State::aborted);
  EXPECT_EQ(f.reason(),
            "the pilot has given it back out of sight: the autopilot lands");
  EXPECT_GT(f.orders_land, 0);
}

TEST(Mission, GivenBackByThePilotWithoutSetpointsItIsTheAutopilots) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.mode = AutopilotMode::hold;
  f.run(2);
  f.mode = AutopilotMode::failsafe;
  f.step();
  expect_last(f, State::pilot, State::lost_link,
              "the autopilot's failsafe has taken over");
  f.motors_stop = true;
  ASSERT_TRUE(f.until(State::complete, 1));
  EXPECT_EQ(f.reason(), "set-points did not arrive: the autopilot landed by itself");
}

}  // namespace
}  // namespace alight
