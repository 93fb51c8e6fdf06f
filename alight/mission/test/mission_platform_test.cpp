#include <cmath>
#include <vector>

#include "alight/mission/test/flight.h"

namespace alight {
namespace {

/// Aborted while it follows, up to where its autopilot lands it.
bool abort_to_land(Flight& f) {
  if (!bring(f, State::follow)) return false;
  f.wish = OperatorWish::abort;
  for (int i = 0; i < 500 && f.orders_land == 0; ++i) f.step();
  f.mode = AutopilotMode::land;
  return f.orders_land > 0;
}

// Blown back towards it, it is left after all.
TEST(Mission, APlatformThatWaitsBesideADroneDrivesOnFromOneThatIsBlownNear) {
  for (const bool blown : {false, true}) {
    Flight f;
    ASSERT_TRUE(abort_to_land(f));
    f.run(0.5);
    ASSERT_EQ(f.state(), State::aborted);
    ASSERT_LT(f.c.platform_speed_wish, 1);
    for (int i = 0; i < 30; ++i) {
      if (blown) f.x().v_NB = Vector3(1, 0, 0);
      f.step();
    }
    EXPECT_EQ(f.c.platform_speed_wish == 1, blown);
  }
}

// The platform neither stops beneath a drone that lands by itself nor runs into it
// later.
TEST(Mission, ThePlatformWaitsForADroneThatLandsBesideIt) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  EXPECT_EQ(f.c.platform_speed_wish, 1);
  f.wish = OperatorWish::abort;
  f.run(10);
  ASSERT_EQ(f.state(), State::aborted);
  ASSERT_GT(f.orders_land, 0);
  EXPECT_EQ(f.c.platform_speed_wish, 0);
  f.motors_stop = true;
  f.run(5);
  EXPECT_EQ(f.c.platform_speed_wish, 0) << "it lies there";
}

// Low when it is left, it stands there before the platform is out of its way.
TEST(Mission, ThePlatformDoesNotDriveOverADroneThatStandsBesideIt) {
  for (const bool stopped_by_itself : {false, true}) {
    Flight f;
    ASSERT_TRUE(abort_to_land(f));
    f.run(0.5);
    ASSERT_GT(f.c.platform_speed_wish, 0);
    (stopped_by_itself ? f.motors_stop : f.stands_on_floor) = true;
    f.run(0.1);
    EXPECT_EQ(f.c.platform_speed_wish, 0);
    f.run(5);
    EXPECT_EQ(f.state(), State::aborted);
    EXPECT_EQ(f.c.platform_speed_wish, 0);
  }
}

// What has stopped it may let it go again.
TEST(Mission, APlatformThatStandsBesideADroneThatComesDownIsAskedToStay) {
  for (const bool stands : {false, true}) {
    Flight f;
    ASSERT_TRUE(abort_to_land(f));
    f.run(0.3);
    if (stands) f.platform_speed = 0.1;
    f.step();
    EXPECT_EQ(f.c.platform_speed_wish == 0, stands);
  }
}

// The wind blows a drone that its autopilot lands after a platform that stops in its
// lee: then the platform had better drive on.
TEST(Mission, ThePlatformDoesNotStopWhereTheWindBlowsTheDrone) {
  for (const double push : {0.0, -1.2, 1.2}) {
    SCOPED_TRACE(push);
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    f.push_N = Vector3(push, 0, 0);
    f.wish = OperatorWish::abort;
    const Vector3 aborted_at = f.x().p_NB;
    f.run(0.5);
    ASSERT_TRUE(f.until(State::aborted, 1) || f.state() == State::aborted);
    for (int i = 0; i < 400 && f.orders_land == 0; ++i) f.step();
    ASSERT_GT(f.orders_land, 0);
    f.mode = AutopilotMode::land;
    // In wind after the platform it is led farther away first.
    if (push > 0) f.x().p_NB = aborted_at;
    f.run(1);
    if (push > 0) {
      EXPECT_EQ(f.c.platform_speed_wish, 1) << "blown after it";
    } else {
      EXPECT_LT(f.c.platform_speed_wish, 0.5) << "to be seen to the floor";
    }
  }
}

/// The platform's wish, step by step, from when the link goes at a height of `z` above
/// the pad's middle.
std::vector<double> wishes_without_link(double z, double speed, Seconds silent_s) {
  Flight f;
  EXPECT_TRUE(bring(f, State::land));
  f.platform_speed = speed;
  f.x().p_NB = Vector3(0, 0, z);
  f.off = f.x().p_NB - f.mission().reference(f.now() + kStep).p_NB;
  f.link_up = false;
  std::vector<double> wishes;
  for (const Time end = f.now() + from_seconds(silent_s); f.now() < end;) {
    f.x().p_NB = Vector3(0, 0, z);
    f.x().v_NB = Vector3(0, 0, -1);  // not as it is told
    f.step();
    wishes.push_back(f.c.platform_speed_wish);
  }
  f.link_up = true;
  f.run(0.3);
  wishes.push_back(f.c.platform_speed_wish);
  return wishes;
}

TEST(Mission, APlatformThatStopsBeneathALandingIsAskedToStay) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  EXPECT_EQ(f.c.platform_speed_wish, 1);
  f.platform_speed = 0.5;  // slower, for a bend
  f.run(0.1);
  EXPECT_EQ(f.c.platform_speed_wish, 1);
  f.platform_speed = 0.1;
  f.run(0.1);
  EXPECT_EQ(f.c.platform_speed_wish, 0);
  f.platform_speed = 0.9;  // Whatever it does: it is not told to go.
  while (f.state() == State::land || f.state() == State::shut_down) {
    EXPECT_EQ(f.c.platform_speed_wish, 0);
    f.step();
  }
  ASSERT_EQ(f.state(), State::complete);
  EXPECT_EQ(f.c.platform_speed_wish, 1);

  Flight around;
  ASSERT_TRUE(around.reach(State::land));
  around.platform_speed = 0;
  around.run(0.1);
  EXPECT_EQ(around.c.platform_speed_wish, 0);
  around.off = Vector3(0.4, 0, 0);
  ASSERT_TRUE(around.until(State::go_around, 3));
  EXPECT_EQ(around.c.platform_speed_wish, 1);

  // Its odometry drifts meanwhile, which alone stops nothing.
  Flight drifts;
  ASSERT_TRUE(drifts.reach(State::land));
  drifts.platform_slip = 0.3;
  drifts.run(0.1);
  EXPECT_EQ(drifts.c.platform_speed_wish, 1);
  drifts.platform_speed = 0;
  drifts.run(0.1);
  EXPECT_EQ(drifts.c.platform_speed_wish, 0);

  Flight still;
  still.platform_speed = 0.15;
  ASSERT_TRUE(still.reach(State::land));
  still.platform_speed = 0;
  still.run(0.1);
  EXPECT_EQ(still.c.platform_speed_wish, 1) << "nothing has stopped";
}

TEST(Mission, LowOverThePadThePlatformBrakesAsTheSilentDroneDoes) {
  for (const double speed : {0.3, 0.9, 2.0}) {
    SCOPED_TRACE(speed);
    const auto wishes = wishes_without_link(0.1, speed, 2.5);
    double before = 1;
    for (std::size_t i = 0; i + 1 < wishes.size(); ++i) {
      EXPECT_LE(wishes[i], before);
      before = wishes[i];
      // Nothing for a gap that a healthy link may have, and then as PX4 brakes.
      const Seconds silent = 0.01 * static_cast<double>(i + 1);
      const double as_it_brakes = std::exp(-(silent - 0.2) / 0.55);
      EXPECT_NEAR(wishes[i], silent < 0.2 ? 1 : as_it_brakes, 0.03);
    }
    EXPECT_LT(before, 0.02);
    EXPECT_EQ(wishes.back(), 1) << "the link is back";
  }
}

// The first that is seen of an autopilot that brakes by itself.
TEST(Mission, BeneathASilentDroneThatFallsBehindThePlatformBrakes) {
  for (const double behind : {0.1, 0.2}) {
    SCOPED_TRACE(behind);
    Flight f;
    ASSERT_TRUE(bring(f, State::land));
    ASSERT_TRUE(f.until_below(0.3));
    f.link_up = false;
    for (int i = 0; i < 50; ++i) {
      f.x().v_NB = f.mission().reference(f.now() + kStep).v_NB - Vector3(behind, 0, 0);
      f.step();
    }
    if (behind < 0.15) {
      EXPECT_EQ(f.c.platform_speed_wish, 1) << "as told, if not exactly";
    } else {
      EXPECT_LT(f.c.platform_speed_wish, 0.7);
    }
    EXPECT_EQ(f.state(), State::land);
  }
}

TEST(Mission, ASilentDroneThatAGustCarriesAlongStopsNoPlatform) {
  for (const Vector3& gust : {Vector3(0.4, 0, 0), Vector3(0, 0.4, 0.1)}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::land));
    ASSERT_TRUE(f.until_below(0.3));
    f.link_up = false;
    for (int i = 0; i < 50; ++i) {
      f.x().v_NB = f.mission().reference(f.now() + kStep).v_NB + gust;
      f.step();
    }
    EXPECT_EQ(f.state(), State::land);
    EXPECT_EQ(f.c.platform_speed_wish, 1);
  }
}

// Once it brakes along with the drone that falls behind no more.
TEST(Mission, APlatformThatBrakesBeneathASilentDroneGoesOnBraking) {
  Flight f;
  ASSERT_TRUE(bring(f, State::land));
  ASSERT_TRUE(f.until_below(0.3));
  f.link_up = false;
  const double drove = f.platform_speed;
  for (int i = 0; i < 45; ++i) {
    const double slower = i < 25 ? 0.2 : 0.05;
    if (i >= 25) f.platform_speed = drove - 0.15;
    f.x().v_NB = f.mission().reference(f.now() + kStep).v_NB - Vector3(slower, 0, 0);
    f.step();
  }
  EXPECT_EQ(f.state(), State::land);
  EXPECT_LT(f.c.platform_speed_wish, 0.85);
}

TEST(Mission, ThePadIsKeptBeneathASilentDroneThatBrakesHarder) {
  Flight f;
  ASSERT_TRUE(bring(f, State::land));
  ASSERT_TRUE(f.until_below(0.3));
  f.link_up = false;
  const auto fall_behind = [&](double slower, double behind, Seconds silent_s) {
    for (const Time end = f.now() + from_seconds(silent_s); f.now() < end;) {
      f.x().p_NB = f.mission().reference(f.now() + kStep).p_NB - Vector3(behind, 0, 0);
      f.x().v_NB = f.mission().reference(f.now() + kStep).v_NB - Vector3(slower, 0, 0);
      f.step();
    }
    return f.c.platform_speed_wish;
  };
  EXPECT_EQ(fall_behind(0.45, 0, 0.1), 1) << "a gap that a healthy link may have";
  const double kept = fall_behind(0.45, 0, 0.15);
  EXPECT_GT(kept, 0.3);
  EXPECT_LT(kept, 0.6) << "half as fast as the pad";
  EXPECT_LT(fall_behind(0.45, 0.1, 0.02), kept - 0.15) << "and behind its middle";
  f.sight = false;
  f.run(0.2);
  const double unseen = f.c.platform_speed_wish;
  EXPECT_GT(unseen, kept) << "as the autopilot is known to brake";
  f.run(0.1);
  EXPECT_LT(f.c.platform_speed_wish, unseen);
}

TEST(Mission, FromBeneathADroneThatIsHighItDrivesOn) {
  for (const double speed : {0.9, 2.0}) {
    for (const double wish : wishes_without_link(0.9, speed, 2.5)) EXPECT_EQ(wish, 1);
  }
  // A slow one does not get away in time.
  const auto slow = wishes_without_link(0.9, 0.1, 2.5);
  EXPECT_LT(slow[slow.size() - 2], 0.05);
}

TEST(Mission, APilotWhoTakesOverLowOverThePadIsNotRunInto) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.2));
  f.mode = AutopilotMode::hold;
  f.run(0.5);
  ASSERT_EQ(f.state(), State::pilot);
  EXPECT_LT(f.c.platform_speed_wish, 0.5);
  f.run(4);
  EXPECT_EQ(f.c.platform_speed_wish, 0) << "nor does it come round";
  f.mode = AutopilotMode::offboard;
  f.run(0.1);
  EXPECT_EQ(f.c.platform_speed_wish, 1);
}

}  // namespace
}  // namespace alight
