#include "alight/mission/mission_config.h"

#include <gtest/gtest.h>

#include "alight/geometry/test/turned_rig.h"
#include "alight/mission/into_view.h"
#include "alight/planning/rig_fit.h"

namespace alight {
namespace {

/// The authors' rig with the camera `up_m` above the pad, pitched down by `down_deg`.
Rig mast_rig(double up_m, double down_deg) {
  Rig rig = alan_rig();
  Vector3 p_NC = rig.camera.X_NC.translation();
  p_NC.z() = up_m;
  rig.camera.X_NC =
      optical_from_housing(make_pose(from_rpy(0, down_deg * kDegree, kPi), p_NC));
  return rig;
}

TEST(Places, LieOnTheOpticalAxisWhereThatLeadsUp) {
  const Rig rig = alan_rig();
  const MissionConfig placed = places_for({}, rig);
  for (const Vector3& place : {placed.follow_point, placed.rendezvous_point}) {
    const Vector3 p_CB = rig.camera.X_NC.inverse() * place;
    EXPECT_LT(p_CB.head<2>().norm(), 1e-9);
    EXPECT_GT(p_CB.z(), rig.camera.X_NC.translation().norm());
  }
  EXPECT_TRUE(check_places({}, rig));
}

TEST(Places, TurnWithTheRig) {
  const MissionConfig ahead = places_for({}, alan_rig());
  for (const double angle : {0.5, kPi / 2, kPi, -2.0}) {
    const Matrix3 turn = from_rpy(0, 0, angle);
    const MissionConfig placed = places_for({}, test::turned_rig(angle));
    EXPECT_TRUE(placed.follow_point.isApprox(turn * ahead.follow_point, 1e-9));
    EXPECT_TRUE(placed.rendezvous_point.isApprox(turn * ahead.rendezvous_point, 1e-9));
  }
}

TEST(Places, AreAboveThePadAndInViewHoweverHighTheCamera) {
  int down = 0, refused = 0;
  for (double up = 0.05; up < 0.8; up += 0.05) {
    for (double pitch = -20; pitch <= 40; pitch += 5) {
      const Rig rig = mast_rig(up, pitch);
      const double lowest = fitted_to({}, rig).touch_down_height_m;
      if (!check_places({}, rig)) {
        ++refused;
        continue;
      }
      const MissionConfig placed = places_for({}, rig);
      down += pitch > 0 ? 1 : 0;
      for (const Vector3& place : {placed.follow_point, placed.rendezvous_point}) {
        EXPECT_GE(place.z(), lowest) << up << ' ' << pitch;
        EXPECT_TRUE(in_view(rig.camera, rig.leds, place)) << up << ' ' << pitch;
      }
    }
  }
  EXPECT_GT(down, 20);
  EXPECT_GT(refused, 0);
}

TEST(Places, BehindAHighPadNoneStartsFromTheFloor) {
  Rig rig = alan_rig();
  MissionConfig config;
  for (const bool floor : {false, true}) {
    config.start_on_floor = floor;
    rig.pad.above_floor_m = 0.6;
    EXPECT_TRUE(check_places(config, rig));
    rig.pad.above_floor_m = 0.61;
    const auto good = check_places(config, rig);
    ASSERT_EQ(good.has_value(), !floor);
    if (floor) {
      EXPECT_NE(good.error().detail.find("start it from the pad"), std::string::npos);
    }
  }
}

TEST(Places, ACameraThatSeesNoneIsToldWhatToTurn) {
  const auto good = check_places({}, mast_rig(0.5, 50));
  ASSERT_FALSE(good);
  EXPECT_EQ(good.error().fault, Fault::invalid_config);
  EXPECT_NE(good.error().detail.find("turn the camera up"), std::string::npos)
      << good.error().detail;
}

// Far from the lens a drone is seen less well, and behind a platform that turns it
// must be fast.
TEST(Places, ALensFartherOffDoesNotTakeThemFartherBeyondThePad) {
  double beyond = 0;
  for (const double away : {0.6, 1.0, 1.5, 2.0}) {
    Rig rig = alan_rig();
    rig.camera.X_NC.translation().x() = away;
    const Vector3 place = places_for({}, rig).follow_point;
    if (beyond > 0) {
      EXPECT_LE(-place.x(), beyond + 1e-9) << away;
    }
    beyond = -place.x();
    EXPECT_GT(beyond, 0.5 * rig.pad.size_m) << away;
  }
}

TEST(Places, TheRoomForAMissIsThePads) {
  Rig rig = alan_rig();
  EXPECT_NEAR(places_for({}, rig).commit_error_m, 0.1, 1e-12);
  double last = 0;
  for (const double size : {0.2, 0.3, 0.43, 0.6, 1.0, 5.0}) {
    rig.pad.size_m = size;
    const double room = places_for({}, rig).commit_error_m;
    EXPECT_GE(room, last);
    EXPECT_LE(room, std::max(0.04, 0.5 * (size - rig.drone.size_m)));
    last = room;
  }
  EXPECT_LE(last, 0.2);
  MissionConfig given;
  given.commit_error_m = 0.07;
  EXPECT_EQ(places_for(given, rig).commit_error_m, 0.07);
}

}  // namespace
}  // namespace alight
