#include <algorithm>

#include "alight/mission/test/flight.h"

namespace alight {
namespace {

constexpr const char* kOffItsFeet =
    "it stands, but is seen higher or lower than its gear height: the camera's mount "
    "or the gear height is not as the rig file has it";

// Refused before it has left the ground; nothing but a disarm is ever ordered.
struct Refusing {
  const char* name;
  void (*set)(Flight&);
  const char* reason;
};
class MissionRefuses : public testing::TestWithParam<Refusing> {};

TEST_P(MissionRefuses, AndSaysWhy) {
  Flight f;
  GetParam().set(f);
  ASSERT_TRUE(f.reach(State::refused)) << to_string(f.state());
  EXPECT_EQ(f.reason(), GetParam().reason);
  EXPECT_FALSE(f.mission().flying());
  EXPECT_EQ(f.orders_land, 0);
  // For good.
  f.link_up = f.telemetry = f.platform = f.sight = f.arms = f.lifts = true;
  f.battery = 1;
  f.seen_higher = 0;
  const int arms_before = f.orders_arm;
  f.wish = OperatorWish::go;
  f.run(12);
  EXPECT_EQ(f.state(), State::refused);
  EXPECT_EQ(f.orders_arm, arms_before);
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
  EXPECT_FALSE(f.armed());
}
INSTANTIATE_TEST_SUITE_P(
    Cases, MissionRefuses,
    testing::Values(
        Refusing{"NoLink", [](Flight& f) { f.link_up = false; },
                 "the radio link is not healthy"},
        Refusing{"NoTelemetry", [](Flight& f) { f.telemetry = false; },
                 "the autopilot sends no telemetry"},
        Refusing{"NoOdometry", [](Flight& f) { f.platform = false; },
                 "there is no platform odometry"},
        Refusing{
            "NoSight", [](Flight& f) { f.sight = false; },
            "the LEDs are not seen on the pad, or not where the rig file has them"},
        Refusing{"SeenTooHigh", [](Flight& f) { f.seen_higher = 0.06; }, kOffItsFeet},
        Refusing{"SeenTooLow", [](Flight& f) { f.seen_higher = -0.06; }, kOffItsFeet},
        Refusing{"LowBattery", [](Flight& f) { f.battery = 0.1; },
                 "the battery is too low to start"},
        Refusing{"DoesNotArm", [](Flight& f) { f.arms = false; },
                 "the autopilot does not arm"},
        Refusing{"DoesNotLift", [](Flight& f) { f.lifts = false; },
                 "did not leave the ground"}),
    [](const auto& case_of) { return case_of.param.name; });

TEST(Mission, WaitsForWhatIsMissingAndThenStarts) {
  Flight f;
  f.sight = false;
  f.wish = OperatorWish::go;
  f.run(5);
  EXPECT_EQ(f.state(), State::idle);
  EXPECT_EQ(f.orders_arm, 0);
  f.sight = true;
  EXPECT_TRUE(f.until(State::follow));
}

TEST(Mission, WhatHowItStandsHasCorrectedDoesNotKeepItFromStarting) {
  for (const double by : {-0.06, 0.06}) {
    SCOPED_TRACE(by);
    Flight f;
    f.seen_higher = by;
    ASSERT_TRUE(f.reach(State::armed));
    f.seen_higher = 0;
    EXPECT_TRUE(f.until(State::follow));
  }
}

TEST(Mission, SeenOffItsGearHeightNoMotorTurns) {
  for (const bool armed_before : {false, true}) {
    SCOPED_TRACE(armed_before);
    Flight f;
    if (armed_before) f.arm_late();
    f.seen_higher = -0.06;
    ASSERT_TRUE(f.reach(State::refused));
    EXPECT_EQ(f.orders_arm, 0);
    f.run(1);
    EXPECT_FALSE(f.armed());
  }
}

TEST(Mission, WhileTheRadioStallsNoneStarts) {
  Flight f;
  f.run(1);
  f.stall(0.5);
  f.wish = OperatorWish::go;
  for (int n = 0; n < 20 && f.state() == State::idle; ++n) {
    f.run(1);
    f.stall(0.5);
  }
  EXPECT_EQ(f.state(), State::refused);
  EXPECT_EQ(f.reason(), "the radio link stalls again and again");
  EXPECT_EQ(f.orders_arm, 0);

  Flight calm;
  calm.run(1);
  calm.stall(0.5);
  calm.wish = OperatorWish::go;
  calm.run(2);
  EXPECT_EQ(calm.orders_arm, 0);
  EXPECT_TRUE(calm.until(State::follow));
}

TEST(Mission, AnOldSightIsNone) {
  Flight f;
  f.run(1);
  f.sight = false;
  f.run(1);
  f.wish = OperatorWish::go;
  ASSERT_TRUE(f.until(State::refused));
  EXPECT_EQ(f.reason(),
            "the LEDs are not seen on the pad, or not where the rig file has them");
}

TEST(Mission, AbortBeforeTheStartIsARefusal) {
  for (const State state : {State::idle, State::armed, State::taken_off}) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    ASSERT_FALSE(f.mission().flying());
    f.wish = OperatorWish::abort;
    f.step();
    EXPECT_EQ(f.state(), State::refused);
    if (state != State::taken_off) {
      EXPECT_EQ(f.reason(), "the operator aborted before the start");
    }
    EXPECT_EQ(f.c.order,
              state == State::idle ? AutopilotOrder::none : AutopilotOrder::disarm);
    EXPECT_EQ(f.orders_land, 0);
    f.run(1);
    EXPECT_FALSE(f.armed());
  }
}

// The order to arm is still on its way, and the first one to disarm lost.
TEST(Mission, WhatArmsAfterItWasToldToDisarmIsToldAgain) {
  for (const OperatorWish wish : {OperatorWish::abort, OperatorWish::hold}) {
    Flight f;
    f.arms = false;
    ASSERT_TRUE(bring(f, State::armed));
    f.step();
    ASSERT_EQ(f.orders_arm, 1);
    f.wish = wish;
    f.run(0.2);
    f.arm_late();
    f.run(0.5);
    EXPECT_FALSE(f.armed());
    const int orders = f.orders_disarm;
    f.run(2);
    EXPECT_EQ(f.orders_disarm, orders);
    EXPECT_EQ(f.state(), wish == OperatorWish::hold ? State::idle : State::refused);
  }
}

// One that has hardly lifted has not been to where it landed.
TEST(Mission, WhatItsAutopilotHasSetDownAtTheTakeOffStartsAnew) {
  for (const bool abort : {false, true}) {
    SCOPED_TRACE(abort);
    Flight f;
    ASSERT_TRUE(f.reach(State::taken_off));
    for (int i = 0; i < 500 && !f.mission().flying(); ++i) f.step();
    ASSERT_TRUE(f.mission().flying());
    f.mode = AutopilotMode::failsafe;
    f.run(0.2);
    ASSERT_EQ(f.state(), State::lost_link) << f.reason();
    f.mode = AutopilotMode::offboard;
    const auto on_pad = [&] {
      f.x().p_NB = Vector3(0.02, 0, f.rig().drone.gear_height_m + 0.004);
      f.x().v_NB.setZero();
      f.x().R_NB.setIdentity();
      f.step();
    };
    for (int i = 0; i < 40 && f.armed(); ++i) on_pad();
    EXPECT_FALSE(f.armed());
    if (abort) f.wish = OperatorWish::abort;
    for (int i = 0; i < 60 && f.state() != State::refused; ++i) {
      if (f.state() == State::taken_off) break;
      on_pad();
    }
    if (abort) {
      EXPECT_EQ(f.state(), State::refused);
      EXPECT_EQ(f.reason(), "the operator aborted before the start");
      continue;
    }
    EXPECT_EQ(f.state(), State::taken_off);
    ASSERT_TRUE(f.until(State::complete)) << f.reason();
    EXPECT_EQ(f.mission().status().attempts, 1);
  }
}

TEST(Mission, APlatformThatIsTooFastIsRefusedBeforeTheStart) {
  Flight f;
  f.platform_speed = 1.01 * f.rig().limits.speed_m_s;
  ASSERT_TRUE(f.reach(State::refused));
  EXPECT_EQ(f.reason(), kTooFastSaid);
  EXPECT_EQ(f.orders_arm, 0);
}

// Light on its feet a drone slides or tips before it flies: feedback cannot wait.
TEST(Mission, SlippingOrTippingAtTakeOffCountsAsLifted) {
  struct Case {
    Vector3 slid;
    double tip_deg;
    bool lifts;
  };
  const MissionConfig config;
  const double slip = config.slip_m, tip = config.slip_tilt_deg;
  const Case cases[] = {{{1.1 * slip, 0, 0}, 0, true},
                        {{0, -1.1 * slip, 0}, 0, true},
                        {{0.9 * slip, 0, 0}, 0, false},
                        {{0, 0, 0}, 1.1 * tip, true},
                        {{0, 0, 0}, -1.1 * tip, true},
                        {{0, 0, 0}, 0.9 * tip, false},
                        {{0, 0, 0.014}, 0, true},
                        {{0, 0, 0.008}, 0, false},
                        // Over a foot: the middle rises, but it stands.
                        {{0, 0, 0.0155}, 0.8 * tip, false},
                        {{0, 0, 0.03}, 0.8 * tip, true}};
  for (const Case& c : cases) {
    SCOPED_TRACE(testing::Message() << c.slid.transpose() << " m, " << c.tip_deg);
    Flight f;
    f.lifts = false;
    f.slid = c.slid;
    f.tip = c.tip_deg * kDegree;
    ASSERT_TRUE(f.reach(State::taken_off));
    bool lifted = false;
    for (int i = 0; i < 1000 && f.state() == State::taken_off && !lifted; ++i) {
      f.step();
      lifted = f.c.lifted;
    }
    EXPECT_EQ(lifted, c.lifts);
    EXPECT_EQ(f.mission().flying(), c.lifts);
    if (!lifted) {
      EXPECT_EQ(f.state(), State::refused);
      EXPECT_EQ(f.reason(), "did not leave the ground");
      continue;
    }
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
    EXPECT_EQ(f.c.lifted_since > 0, c.slid.z() > 0) << "only a rise has a past";
    EXPECT_TRUE(f.until(State::complete));
  }
}

// How far it slid is told later than that it slides.
TEST(Mission, SlidingAtTakeOffIsAnsweredBeforeItHasComeFar) {
  const MissionConfig config;
  struct Case {
    double far, speed;
    bool lifts;
  };
  for (const Case& c : {Case{0.0015, 1.2 * config.slip_m_s, true},
                        Case{0.0015, 0.8 * config.slip_m_s, false},
                        Case{0.0005, 1.2 * config.slip_m_s, false}}) {
    SCOPED_TRACE(testing::Message() << c.far << " m, " << c.speed << " m/s");
    Flight f;
    f.lifts = false;
    ASSERT_TRUE(f.reach(State::taken_off));
    f.slid.y() = c.far;
    f.slides = Vector3(0, c.speed, 0);
    double share = 0;
    for (int i = 0; i < 1000 && f.state() == State::taken_off && !f.c.lifted; ++i) {
      f.step();
      share = f.c.ramp_share;
    }
    EXPECT_EQ(f.c.lifted, c.lifts);
    EXPECT_GT(share, 0.74) << "with its weight on its feet it cannot";
  }
}

// Seen to slide it may stand yet: leaning it would tip over, and what the ground
// carries must not keep thrust from growing.
TEST(Mission, WhatSlidesBeforeItLiftsGoesOnLeavingTheGround) {
  Flight f;
  f.lifts = false;
  f.slid = Vector3(1.1 * MissionConfig{}.slip_m, 0, 0);
  ASSERT_TRUE(f.reach(State::taken_off));
  while (!f.c.lifted && f.state() == State::taken_off) f.step();
  ASSERT_TRUE(f.c.lifted);
  const double gear = f.rig().drone.gear_height_m;
  double least = 0.8;
  for (int i = 0; i < 20; ++i) {
    f.x().p_NB.z() = gear;
    f.step();
    EXPECT_GT(f.c.thrust_least, least);
    least = f.c.thrust_least;
  }
  // Leaning, a foot of it stands there still.
  f.x().p_NB.z() = gear + 0.03;
  f.x().R_NB = from_rpy(0, 15 * kDegree, 0);
  f.step();
  EXPECT_GT(f.c.thrust_least, least);
  least = f.c.thrust_least;
  // Said to have left, it is not until a picture shows it.
  f.x().p_NB.z() = gear;
  f.x().R_NB = Matrix3::Identity();
  f.step();
  f.sight = false;
  f.x().p_NB.z() = gear + 0.1;
  f.step();
  EXPECT_GT(f.c.thrust_least, least);
  f.sight = true;
  f.x().p_NB.z() = gear + 0.03;
  f.step();
  EXPECT_LT(f.c.thrust_least, 1);
  EXPECT_GT(f.c.thrust_least, 0.85) << "or it comes down again";
  f.x().p_NB.z() = gear + 0.35;
  f.step();
  EXPECT_EQ(f.c.thrust_least, 0);
}

// What slides has not yet all its weight on its rotors: that says nothing of them.
TEST(Mission, OnlyARiseTellsWhatTheThrustIsWorth) {
  for (const bool slides : {true, false}) {
    SCOPED_TRACE(slides);
    Flight f;
    f.lifts = !slides;
    if (slides) f.slid = Vector3(1.1 * MissionConfig{}.slip_m, 0, 0);
    ASSERT_TRUE(f.reach(State::taken_off));
    while (!f.c.lifted && f.state() == State::taken_off) f.step();
    ASSERT_TRUE(f.c.lifted);
    EXPECT_EQ(f.c.carried, !slides);
  }
}

TEST(Mission, UnseenItIsNotThoughtToHaveLifted) {
  Flight f;
  ASSERT_TRUE(f.reach(State::taken_off));
  f.sight = false;
  double share = 0;
  while (f.state() == State::taken_off) {
    f.step();
    share = std::max(share, f.c.ramp_share);
  }
  // Thrust has not exceeded the weight for long enough to climb.
  EXPECT_LT(share, 1.05);
  EXPECT_EQ(f.state(), State::idle);
  EXPECT_EQ(f.reason(), "the LEDs are out of sight");
  f.run(1);
  EXPECT_FALSE(f.armed());
  ASSERT_TRUE(f.until(State::refused, 10));
  EXPECT_EQ(f.reason(),
            "the LEDs are not seen on the pad, or not where the rig file has them");
  EXPECT_FALSE(f.mission().flying());
}

TEST(Mission, ADroneThatIsNoLongerSeenAsItLiftsComesDownSoftly) {
  for (const double lost_at : {0.8, 0.95, 1.0, 1.1, 1.2}) {
    SCOPED_TRACE(lost_at);
    Flight f;
    ASSERT_TRUE(f.ramp_up_to(lost_at));
    f.sight = false;
    const Time lost = f.now();
    // Two pictures are missing: less than carries it, and for long enough to come down.
    while (f.c.ramp_share > 0.75 && f.state() == State::taken_off) f.step();
    EXPECT_LT(to_seconds(f.now() - lost), 0.12);
    const Time down = f.now();
    double wish = 1;
    while (f.state() == State::taken_off) {
      wish = f.c.platform_speed_wish;  // the wind brakes it
      EXPECT_EQ(f.c.mode, MissionCommand::Mode::ramp);
      EXPECT_LE(f.c.ramp_share, 0.75);
      EXPECT_GT(f.c.ramp_share, 0.5) << "it falls";
      EXPECT_EQ(f.orders_disarm, 0);
      f.step();
    }
    EXPECT_GT(to_seconds(f.now() - down), 0.4);
    EXPECT_LT(wish, 0.6);
    EXPECT_EQ(f.orders_disarm, 1);
    // Seen again it starts anew.
    f.sight = f.lifts = true;
    EXPECT_TRUE(f.until(State::follow, 20));
  }
}

// Of the drone's place and thrust nothing is known then but what pictures show.
// Images in a glossy pad may stand for LEDs that something hides.
TEST(Mission, ADroneThatWasSeenToFlyKeepsItsMotorsWhereverItSeemsToBe) {
  Flight f;
  ASSERT_TRUE(f.reach(State::taken_off));
  while (f.x().p_NB.z() < 0.15 && f.state() == State::taken_off) f.step();
  ASSERT_EQ(f.state(), State::taken_off);
  f.off.z() = -0.25;
  f.off_m_s.z() = -0.7;
  for (int i = 0; i < 5; ++i) f.step();
  ASSERT_LT(f.x().p_NB.z(), 0.07);
  f.sight = false;
  while (f.state() == State::taken_off) f.step();
  EXPECT_EQ(f.state(), State::lost_target);
  EXPECT_EQ(f.orders_disarm, 0);
}

TEST(Mission, ALinkThatFailsAsItLiftsEndsTheStartAndThePlatformBrakes) {
  for (const double lost_at : {0.8, 0.95, 1.0, 1.1}) {
    SCOPED_TRACE(lost_at);
    Flight f;
    f.slid.z() = 0.006;  // it may have
    ASSERT_TRUE(f.ramp_up_to(lost_at));
    f.link_up = false;
    double most = 0, wish = 1;
    const Time lost = f.now();
    const auto step = [&] {
      f.step();
      EXPECT_LE(f.c.platform_speed_wish, wish);
      wish = f.c.platform_speed_wish;
    };
    while (f.state() == State::taken_off) {
      step();
      if (to_seconds(f.now() - lost) > 0.25) most = std::max(most, f.c.ramp_share);
    }
    EXPECT_LT(most, 0.75) << "less than carries it";
    EXPECT_EQ(f.reason(), "the radio link is not healthy");
    EXPECT_EQ(f.orders_disarm, 1);
    EXPECT_LT(wish, 0.6);
    for (int i = 0; i < 300; ++i) step();
    EXPECT_LT(wish, 0.01) << "its motors may turn still";
    // Heard again it is disarmed, and starts anew.
    f.link_up = f.lifts = true;
    EXPECT_TRUE(f.until(State::follow, 20));
  }
}

// With less than its weight on its feet the wind would push it over the pad's edge.
TEST(Mission, ALinkThatFailsWhileItStandsEndsTheStartAtOnce) {
  for (const double lost_at : {0.75, 0.9}) {
    SCOPED_TRACE(lost_at);
    Flight f;
    f.slid = Vector3(0.0009, 0, 0.0015);  // what a drone that stands shows
    ASSERT_TRUE(f.ramp_up_to(lost_at));
    f.link_up = false;
    const Time lost = f.now();
    while (f.state() == State::taken_off) f.step();
    EXPECT_LT(to_seconds(f.now() - lost), 0.25);
    EXPECT_EQ(f.reason(), "the radio link is not healthy");
    EXPECT_EQ(f.orders_disarm, 1);
    f.link_up = f.lifts = true;
    EXPECT_TRUE(f.until(State::follow, 20));
  }
}

TEST(Mission, ItStartsOnlyOnItsFeetOnThePad) {
  const auto starts = [](auto&& place, bool anew) {
    Flight f;
    if (anew) {
      // The first start ends before it lifts, and has it where `place` says.
      EXPECT_TRUE(f.reach(State::taken_off));
      f.sight = false;
      EXPECT_TRUE(f.until(State::idle, 5));
      f.sight = true;
    }
    f.wish = OperatorWish::go;
    for (int i = 0; i < 1000 && f.state() == State::idle; ++i) {
      place(f);
      f.step();
    }
    if (f.state() != State::armed) {
      EXPECT_EQ(f.state(), State::refused);
      EXPECT_EQ(f.reason(), "the drone does not stand on the pad");
    }
    return f.state() == State::armed;
  };
  for (const bool anew : {false, true}) {
    SCOPED_TRACE(anew);
    EXPECT_TRUE(starts([](Flight&) {}, anew));
    EXPECT_FALSE(
        starts([](Flight& f) { f.x().R_NB = so3_exp(Vector3(kPi, 0, 0)); }, anew))
        << "upside down";
    EXPECT_FALSE(starts([](Flight& f) { f.x().p_NB = Vector3(-0.3, 0, 0.06); }, anew))
        << "beside";
    EXPECT_FALSE(starts([](Flight& f) { f.x().p_NB.z() = -0.2; }, anew)) << "fallen";
    EXPECT_EQ(starts([](Flight& f) { f.x().v_NB = Vector3(0.2, 0, 0); }, anew), !anew)
        << "sliding";
  }
  // Leaning on something; or of a rig that is off, until it has been seen to stand.
  const auto leans = [](Flight& f) {
    f.x().p_NB = Vector3(0, 0, 0.02);
    f.x().R_NB = so3_exp(Vector3(0, 0.35, 0));
  };
  EXPECT_FALSE(starts(leans, true));
  EXPECT_TRUE(starts(leans, false));
}

TEST(Mission, AFailsafeWithFeetOnThePadIsTheEnd) {
  for (const bool seen : {false, true}) {
    SCOPED_TRACE(seen);
    Flight f;
    f.slid = Vector3(0.02, 0, 0);
    f.lifts = false;
    ASSERT_TRUE(f.reach(State::taken_off));
    while (!f.c.lifted) f.step();  // for it slides
    f.sight = seen;
    f.run(0.1);
    f.mode = AutopilotMode::failsafe;
    f.step();
    ASSERT_EQ(f.state(), State::lost_link);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
    f.run(1);
    // Seen to stand there it is told to stop its motors.
    EXPECT_EQ(f.orders_disarm > 0, seen);
    if (seen) {
      EXPECT_EQ(f.state(), State::complete);
    } else {
      EXPECT_LT(f.c.platform_speed_wish, 0.2);
    }
  }
  // In the air a burst of losses may end.
  Flight high;
  ASSERT_TRUE(high.reach(State::follow));
  high.mode = AutopilotMode::failsafe;
  high.run(0.9);
  EXPECT_EQ(high.state(), State::follow);
}

TEST(Mission, ThrustThatMovesItAndPicturesThatDoNotChangeEndTheStart) {
  Flight f;
  f.lifts = false;
  f.picture_repeats = true;
  f.blindness = Blindness::frozen;
  ASSERT_TRUE(f.reach(State::taken_off));
  double most = 0;
  while (f.state() == State::taken_off) {
    f.step();
    most = std::max(most, f.c.ramp_share);
  }
  EXPECT_LT(most, 1.27);
  EXPECT_GT(most, 1.2) << "a heavy drone under a camera without noise still starts";
  EXPECT_EQ(f.reason(), "the camera repeats its picture");
  // The same without an end: it is refused, and stands disarmed.
  ASSERT_TRUE(f.until(State::refused, 60));
  f.run(2);
  EXPECT_FALSE(f.armed());
}

TEST(Mission, FromTheFloorTheClimbIsBlindAndEndsInSight) {
  MissionConfig config;
  config.start_on_floor = true;
  Flight f(config);
  f.sight = false;
  f.wish = OperatorWish::go;
  ASSERT_TRUE(f.until(State::taken_off));
  EXPECT_EQ(f.c.platform_speed_wish, 0) << "the platform waits";
  f.run(1);
  EXPECT_EQ(f.state(), State::taken_off);
  f.x().p_NB = Vector3(-1, 0, 0.5);
  f.sight = true;
  f.step();
  expect_last(f, State::taken_off, State::follow, "in sight: to the follow point");
  EXPECT_TRUE(f.c.lifted);
  EXPECT_EQ(f.c.platform_speed_wish, 1);
  EXPECT_LT((f.mission().reference(f.now()).p_NB - Vector3(-1, 0, 0.5)).norm(), 1e-9);
  EXPECT_TRUE(f.until(State::complete));
}

// A camera on a mast may see the floor: feedback would fight what the feet stand on.
TEST(Mission, SeenOnTheFloorItStillHasToLeaveIt) {
  for (const bool told : {false, true}) {
    SCOPED_TRACE(told);
    MissionConfig config;
    config.start_on_floor = true;
    Flight f(config);
    const double floor = f.rig().drone.gear_height_m - f.rig().pad.above_floor_m;
    f.x().p_NB = Vector3(-1, 0, floor + 0.04);
    if (told) f.climb = 0;
    ASSERT_TRUE(f.reach(State::taken_off));
    f.run(0.3);
    EXPECT_EQ(f.state(), State::taken_off);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::ramp);
    EXPECT_GT(f.c.ramp_share, 0.9);
    if (told) {
      f.climb = 0.4;
    } else {
      f.x().p_NB.z() = floor + 0.2;
    }
    f.run(0.05);
    expect_last(f, State::taken_off, State::follow, "in sight: to the follow point");
  }
}

TEST(Mission, FromTheFloorItClimbsNoFasterThanItIsToldTo) {
  MissionConfig config;
  config.start_on_floor = true;
  Flight f(config);
  f.sight = false;
  f.climb = 0;
  f.wish = OperatorWish::go;
  ASSERT_TRUE(f.until(State::taken_off));
  f.run(0.4);
  const double at_lift = f.c.ramp_share;
  EXPECT_GT(at_lift, 1);
  f.climb = 1.6;
  f.run(0.1);
  EXPECT_LT(f.c.ramp_share, at_lift - 0.1);
  f.climb = 0.3;
  f.run(0.4);
  EXPECT_GT(f.c.ramp_share, at_lift - 0.1);
}

TEST(Mission, FromTheFloorNeverInSightIsLandedByTheAutopilot) {
  MissionConfig config;
  config.start_on_floor = true;
  for (const Blindness why : {Blindness::leds, Blindness::late}) {
    Flight f(config);
    f.sight = false;
    f.blindness = why;
    f.wish = OperatorWish::go;
    ASSERT_TRUE(f.until(State::taken_off));
    // One that tells no climb may be fast by then.
    ASSERT_TRUE(f.until(State::aborted, 2.2));
    EXPECT_EQ(f.reason(), why == Blindness::leds
                              ? "the LEDs never came into sight: the autopilot lands"
                              : "the pictures come too late: the autopilot lands");
    EXPECT_TRUE(f.mission().flying()) << "it may, unseen";
    EXPECT_EQ(f.orders_disarm, 0);
    EXPECT_GE(f.orders_land, 1);
  }
}

TEST(Mission, AFailsafeBeforeThrustCarriesItIsNoFlight) {
  for (const Seconds after : {0.03, 0.4}) {
    SCOPED_TRACE(after);
    Flight f;
    f.lifts = false;
    ASSERT_TRUE(f.reach(State::taken_off));
    f.run(after);
    const bool may_fly = f.c.ramp_share > 0.9;
    f.mode = AutopilotMode::failsafe;
    f.step();
    EXPECT_EQ(f.state(), may_fly ? State::lost_link : State::idle);
    EXPECT_EQ(f.reason(), "the autopilot's failsafe has taken over");
    EXPECT_EQ(f.orders_disarm, may_fly ? 0 : 1);
    f.lifts = true;
    f.mode = AutopilotMode::offboard;
    EXPECT_TRUE(may_fly || f.until(State::follow, 20)) << "starts anew";
  }
}

// The radio stalls as the take-off begins: thrust was taken back before it carried, and
// an autopilot that has waited in vain for set-points meanwhile has not flown either.
TEST(Mission, AFailsafeOnceThrustWasTakenBackIsNoFlight) {
  Flight f;
  f.lifts = false;
  ASSERT_TRUE(f.reach(State::taken_off));
  f.run(0.03);
  f.sight = false;
  f.run(0.35);
  ASSERT_EQ(f.state(), State::taken_off);
  EXPECT_LT(f.c.ramp_share, 0.7);
  f.mode = AutopilotMode::failsafe;
  f.step();
  expect_last(f, State::taken_off, State::idle,
              "the autopilot's failsafe has taken over");
  EXPECT_EQ(f.orders_disarm, 1);
  f.lifts = f.sight = true;
  f.mode = AutopilotMode::offboard;
  EXPECT_TRUE(f.until(State::follow, 20)) << "starts anew";
  // One that has long acted alone may have lifted off.
  Flight late;
  late.lifts = false;
  ASSERT_TRUE(late.reach(State::taken_off));
  late.run(0.03);
  late.miss(1);
  late.computer_was_late = true;
  late.mode = AutopilotMode::failsafe;
  late.sight = false;
  late.run(0.15);
  EXPECT_EQ(late.state(), State::taken_off) << "a picture is to come";
  EXPECT_EQ(late.c.mode, MissionCommand::Mode::silent);
  late.run(0.1);
  EXPECT_EQ(late.state(), State::lost_link);
  EXPECT_EQ(late.orders_disarm, 0);
}

// Its autopilot waits for set-points: in sight and heard it is flown on, with what
// thrust it had, and not left to a landing mode that a platform carries along.
TEST(Mission, ATakeOffGoesOnWhereOnlyTheComputerStoodStill) {
  for (const bool stood_still : {true, false}) {
    SCOPED_TRACE(stood_still);
    Flight f;
    ASSERT_TRUE(f.ramp_up_to(0.9));
    const double had = f.c.ramp_share;
    f.miss(1);
    f.computer_was_late = stood_still;
    f.mode = AutopilotMode::failsafe;
    if (stood_still) {
      f.sight = false;
      f.step();
      EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
      f.sight = true;
    }
    f.step();
    ASSERT_EQ(f.state(), stood_still ? State::taken_off : State::lost_link);
    if (!stood_still) continue;
    EXPECT_TRUE(f.c.lifted);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
    f.mode = AutopilotMode::offboard;
    f.computer_was_late = false;
    f.x().p_NB.z() = f.rig().drone.gear_height_m;
    f.step();
    EXPECT_NEAR(f.c.thrust_least, had, 0.03);
    EXPECT_EQ(f.orders_disarm, 0);
    EXPECT_TRUE(f.until(State::follow, 20));
  }
}

// It may have been thrown off the pad meanwhile, or flown by its autopilot.
TEST(Mission, AfterALongStallNoMotorsAreStoppedBeforeItIsSeenToStand) {
  for (const AutopilotMode told : {AutopilotMode::offboard, AutopilotMode::failsafe}) {
    for (const double thrust : {0.72, 0.9}) {
      Flight f;
      ASSERT_TRUE(f.ramp_up_to(thrust));
      f.miss(3);
      f.computer_was_late = true;
      f.sight = false;
      f.mode = told;
      f.run(1);
      EXPECT_EQ(f.orders_disarm, 0);
      EXPECT_EQ(f.state(),
                told == AutopilotMode::offboard ? State::aborted : State::lost_link);
      EXPECT_EQ(f.reason(), "the computer stood still: the autopilot lands");
    }
  }
}

// Its autopilot has let it sink, and a pad that drove on has left it behind: what it
// was asked to do before would have it meet the pad's edge.
TEST(Mission, ATakeOffGoesOnFromWhereTheDroneHasComeMeanwhile) {
  for (const bool slept : {true, false}) {
    SCOPED_TRACE(slept);
    Flight f;
    ASSERT_TRUE(f.reach(State::taken_off));
    while (f.x().p_NB.z() < 0.25) f.step();
    ASSERT_EQ(f.state(), State::taken_off);
    if (slept) {
      f.miss(1);
      f.computer_was_late = true;
    }
    f.mode = AutopilotMode::failsafe;
    const auto come_to = [&] {
      f.x().p_NB = Vector3(-0.32, 0.15, 0.17);
      f.x().v_NB = Vector3(-0.5, 0.25, -0.4);
    };
    for (int i = 0; i < 3; ++i) {
      come_to();
      f.step();
    }
    ASSERT_EQ(f.state(), State::taken_off);
    const FlatState begins = f.mission().reference(f.now());
    EXPECT_LT((begins.p_NB - Vector3(-0.32, 0.15, 0.17)).norm(), 0.03);
    EXPECT_LT((begins.v_NB - Vector3(-0.5, 0.25, -0.4)).norm(), 0.2);
    f.mode = AutopilotMode::offboard;
    f.computer_was_late = false;
    double lowest = 1;
    while (f.state() == State::taken_off) {
      f.step();
      const FlatState& goal = f.mission().reference(f.now());
      lowest = std::min(lowest, goal.p_NB.z());
      if (goal.p_NB.z() < 0.25) {
        EXPECT_LT(goal.p_NB.x(), -0.3);
      }
      EXPECT_LT(goal.v_NB.norm(), 1);
    }
    EXPECT_GT(lowest, 0.09) << "its feet are 6 cm lower";
    EXPECT_EQ(f.state(), State::follow);
    EXPECT_LT(f.reference_jump_m, 0.6);
  }
}

// Over the pad it goes up as it would have gone.
TEST(Mission, OverThePadATakeOffGoesOnToWhereItLed) {
  Flight f;
  ASSERT_TRUE(f.reach(State::taken_off));
  while (f.x().p_NB.z() < 0.25) f.step();
  f.miss(1);
  f.computer_was_late = true;
  f.x().p_NB = Vector3(0, 0.05, 0.2);
  f.x().v_NB = Vector3(0, 0, -0.3);
  f.step();
  f.x().p_NB = Vector3(0, 0.05, 0.2);
  f.x().v_NB = Vector3(0, 0, -0.3);
  f.step();
  const FlatState goal = f.mission().reference(f.now() + 10'000'000'000);
  EXPECT_NEAR(goal.p_NB.x(), -MissionConfig{}.take_off_back_m, 1e-6);
  EXPECT_NEAR(goal.p_NB.y(), 0, 1e-6);
}

// It had just lifted. Where its autopilot has brought it down meanwhile, its thrust is
// to grow again: what the ground carries seems to need none.
TEST(Mission, WhatStandsAgainAfterTheComputerStoodStillIsLiftedAnew) {
  const struct {
    double x, rise;
    bool stands;
  } cases[] = {{0, 0.003, true},
               {0, 0.1, false},         // in the air
               {-0.22, -0.06, false}};  // beside the pad
  for (const auto& [x, rise, stands] : cases) {
    SCOPED_TRACE(rise);
    Flight f;
    f.lifts = false;
    f.slid = Vector3(1.1 * MissionConfig{}.slip_m, 0, 0);
    ASSERT_TRUE(f.reach(State::taken_off));
    while (!f.c.lifted) f.step();
    const double had = f.c.ramp_share;
    f.miss(1);
    f.computer_was_late = true;
    const auto step = [&] {
      f.x().p_NB = Vector3(x, 0, f.rig().drone.gear_height_m + rise);
      f.x().v_NB.setZero();
      f.step();
    };
    step();
    EXPECT_FALSE(f.c.lifted) << "no picture since";
    step();
    EXPECT_EQ(f.c.lifted, stands);
    if (stands) {
      EXPECT_GE(f.c.thrust_least, had);
    }
    step();
    EXPECT_FALSE(f.c.lifted) << "once";
  }
}

// It slid, so that it counts as lifted; what thrust makes of it no picture has shown.
TEST(Mission, ADroneThatIsLostAsItSlidesComesDownAsOneThatHasNotLifted) {
  struct Case {
    double rise, climb;
    bool comes_down;
  };
  for (const Case& c : {Case{0, 0, true}, Case{0.01, 0.05, true}, Case{0.03, 0, false},
                        Case{0.004, 0.25, false}}) {
    SCOPED_TRACE(testing::Message() << c.rise << " m, " << c.climb << " m/s");
    Flight f;
    f.lifts = false;
    f.slid = Vector3(1.1 * MissionConfig{}.slip_m, 0, 0);
    ASSERT_TRUE(f.reach(State::taken_off));
    while (!f.c.lifted) f.step();
    f.sight = false;
    const Time lost = f.now();
    const auto step = [&] {
      f.x().p_NB.z() = f.rig().drone.gear_height_m + c.rise;
      f.x().v_NB.z() = c.climb;
      f.step();
    };
    while (f.c.mode == MissionCommand::Mode::track && f.state() == State::taken_off &&
           to_seconds(f.now() - lost) < 0.2) {
      step();
    }
    if (!c.comes_down) {
      EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
      EXPECT_LT(f.c.thrust_least, 0.95) << "thrust does not grow unseen";
      continue;
    }
    EXPECT_LT(to_seconds(f.now() - lost), 0.12);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::ramp);
    EXPECT_NEAR(f.c.ramp_share, 0.6, 0.15);
    EXPECT_FALSE(f.mission().flying());
    while (f.state() == State::taken_off) step();
    EXPECT_EQ(f.state(), State::idle);
    EXPECT_EQ(f.orders_disarm, 1);
    f.sight = f.lifts = true;
    EXPECT_TRUE(f.until(State::follow, 20));
  }
}

// Its motors turn, for it was not heard; a second start would find it in the air.
TEST(Mission, NoStartBeginsWithMotorsThatStillTurn) {
  for (const bool seen : {true, false}) {
    SCOPED_TRACE(seen);
    Flight f;
    ASSERT_TRUE(f.ramp_up_to(0.8));
    f.link_up = false;
    ASSERT_TRUE(f.until(State::idle, 1));
    f.sight = seen;
    f.run(2);  // no order arrives
    ASSERT_TRUE(f.armed());
    const int orders = f.orders_disarm;
    f.link_up = true;
    if (seen) {
      f.step();
      EXPECT_FALSE(f.armed());
      f.lifts = true;
      EXPECT_TRUE(f.until(State::follow, 20)) << "starts anew";
      continue;
    }
    f.run(0.5);
    EXPECT_EQ(f.orders_disarm, orders) << "it may be in the air";
    EXPECT_EQ(f.state(), State::idle);
    ASSERT_TRUE(f.until(State::refused, 20));
    EXPECT_EQ(f.reason(), "the autopilot does not stop its motors");
    EXPECT_TRUE(f.armed());
  }
}

TEST(Mission, ThePilotsSwitchBeforeTheTakeOffRefusesAndOrdersNothing) {
  Flight f;
  ASSERT_TRUE(f.reach(State::taken_off));
  f.mode = AutopilotMode::hold;
  f.run(0.5);
  EXPECT_EQ(f.state(), State::refused);
  EXPECT_EQ(f.reason(), "the pilot took over before the take-off");
  EXPECT_EQ(f.orders_disarm, 0);
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
}

TEST(Mission, AHoldBeforeTheTakeOffWaitsOnThePad) {
  Flight f;
  ASSERT_TRUE(f.reach(State::armed));
  f.wish = OperatorWish::hold;
  f.run(1);
  EXPECT_EQ(f.state(), State::idle);
  EXPECT_FALSE(f.armed());
  f.run(20);
  EXPECT_EQ(f.state(), State::idle);
  f.wish = OperatorWish::go;
  EXPECT_TRUE(f.until(State::complete, 60));
}

}  // namespace
}  // namespace alight
