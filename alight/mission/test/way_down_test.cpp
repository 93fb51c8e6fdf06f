#include "alight/mission/way_down.h"

#include <gtest/gtest.h>

#include <limits>

#include "alight/mission/into_view.h"

namespace alight {
namespace {

constexpr double kDrivesOn = std::numeric_limits<double>::infinity();
const Vector3 kBehind(-1.2, 0, 0.6);

PlatformState driving(double v, double w = 0) {
  PlatformState platform;
  platform.v_IN_N = Vector3(v, 0, 0);
  platform.w_IN_N = Vector3(0, 0, w);
  return platform;
}

/// At rest over the pad's way: as fast over the ground as the platform.
LeftDrone carried_along(const Vector3& p_NB, double v) {
  return {p_NB, Vector3(v, 0, 0), Vector3::Zero()};
}

TEST(WayDown, WithoutWindNothingComesNearer) {
  const WayDown way_down(alan_rig());
  EXPECT_NEAR(
      way_down.nearest({kBehind, Vector3::Zero(), Vector3::Zero()}, {}, kDrivesOn),
      kBehind.head<2>().norm(), 1e-12);
  EXPECT_TRUE(way_down.clear({kBehind, Vector3::Zero(), Vector3::Zero()}, {}));
}

TEST(WayDown, ItBrakesOverTheGroundAndThePlatformDrivesAway) {
  const WayDown way_down(alan_rig());
  EXPECT_NEAR(way_down.nearest(carried_along(kBehind, 0.9), driving(0.9), kDrivesOn),
              1.2, 1e-6);
  EXPECT_TRUE(way_down.clear(carried_along(kBehind, 0.9), driving(0.9)));
  // Ahead of it both meet.
  const Vector3 ahead(1.6, 0, 0.6);
  EXPECT_FALSE(way_down.clear(carried_along(ahead, 0.9), driving(0.9)));
}

TEST(WayDown, ItFliesOnOverAPlatformThatIsStopped) {
  const WayDown way_down(alan_rig());
  const auto clear = [&](double behind, double speed, double push) {
    LeftDrone drone = carried_along({-behind, 0, 0.6}, speed);
    drone.push_N = Vector3(push, 0, 0);
    return way_down.clear_of_stop(drone, driving(speed));
  };
  // 0.9 m/s: 0.68 m in its 0.2 and 0.55 s, less 0.14 m of the platform.
  EXPECT_TRUE(clear(0.54 + way_down.reach() + 0.02, 0.9, 0));
  EXPECT_FALSE(clear(0.54 + way_down.reach() - 0.02, 0.9, 0));
  EXPECT_TRUE(clear(way_down.reach() + 0.02, 0, 0));
  EXPECT_FALSE(clear(0.54 + way_down.reach() + 0.02, 0.9, 0.5)) << "blown farther";
  EXPECT_TRUE(clear(0.54 + way_down.reach() - 0.02, 0.9, -0.5));
}

TEST(WayDown, WindTowardsAPlatformThatStandsIsNoPlaceToBeLeft) {
  const WayDown way_down(alan_rig());
  LeftDrone drone{kBehind, Vector3::Zero(), Vector3(1.5, 0, 0)};
  EXPECT_FALSE(way_down.clear(drone, {}));
  // As it does not where that drives away faster, nor blown off, nor aside.
  EXPECT_TRUE(
      way_down.clear({kBehind, Vector3(1.5, 0, 0), drone.push_N}, driving(1.5)));
  drone.push_N = Vector3(-1.5, 0, 0);
  EXPECT_TRUE(way_down.clear(drone, {}));
  EXPECT_TRUE(
      way_down.clear({kBehind + Vector3(0, 1.6, 0), Vector3::Zero(), {1.5, 0, 0}}, {}));
}

TEST(WayDown, APlatformThatComesBackIsSeenToCome) {
  const WayDown way_down(alan_rig());
  EXPECT_FALSE(way_down.clear(carried_along(kBehind, -0.7), driving(-0.7)));
  EXPECT_TRUE(
      way_down.clear(carried_along(kBehind + Vector3(0, 1.2, 0), -0.7), driving(-0.7)));
  // One that brakes does not get there.
  EXPECT_GT(
      way_down.nearest({kBehind, Vector3::Zero(), Vector3::Zero()}, driving(-0.5), 1),
      way_down.nearest({kBehind, Vector3::Zero(), Vector3::Zero()}, driving(-0.5),
                       kDrivesOn) +
          0.3);
}

TEST(WayDown, ATurnIsFollowedOnItsArc) {
  // Once round in the time that is looked at, a platform is back where it was; a
  // straight way would be far off.
  const WayDown way_down(alan_rig());
  const Vector3 beside(0, 1.2, 0.6);  // the circle's middle is there
  const double v = 0.9, w = 0.9 / 1.2;
  EXPECT_NEAR(way_down.nearest({beside, Vector3::Zero(), Vector3::Zero()},
                               driving(v, w), kDrivesOn),
              1.2, 0.02);
}

TEST(WayDown, TheLowerTheLessItIsBlown) {
  const WayDown way_down(alan_rig());
  double before = 0;
  for (const double z : {1.5, 1.0, 0.5, 0.1}) {
    const double near = way_down.nearest(
        {Vector3(-3, 0, z), Vector3::Zero(), Vector3(1, 0, 0)}, {}, kDrivesOn);
    EXPECT_GT(near, before);
    before = near;
  }
}

TEST(WayDown, PlacesAreInSightAndBesideThePlatform) {
  const Rig rig = alan_rig();
  const WayDown way_down(rig);
  const PlatformOutline outline(rig);
  const auto places = way_down.places(kBehind);
  ASSERT_GE(places.size(), 5u);
  EXPECT_EQ(places[0], kBehind);
  int left = 0, right = 0;
  for (std::size_t k = 1; k < places.size(); ++k) {
    EXPECT_TRUE(outline.clear(places[k]));
    EXPECT_TRUE(in_view(rig.camera, rig.leds, places[k]));
    left += places[k].y() > 0.5;
    right += places[k].y() < -0.5;
  }
  EXPECT_GE(left, 1);
  EXPECT_GE(right, 1);
}

}  // namespace
}  // namespace alight
