#include "alight/mission/into_view.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "alight/base/rng.h"
#include "alight/mission/mission_config.h"

namespace alight {
namespace {

Vector3 search_point(const Rig& rig) { return places_for({}, rig).search_point; }

/// Metres on the straight way from `from` to `to` until the picture shows the drone;
/// all of it, if it does not.
double unseen_way(const Rig& rig, const Vector3& from, const Vector3& to) {
  constexpr int kSteps = 500;
  for (int i = 0; i < kSteps; ++i) {
    const Vector3 p = from + i * (to - from) / kSteps;
    if (in_view(rig.camera, rig.leds, p)) return (p - from).norm();
  }
  return (to - from).norm();
}

TEST(IntoView, WhatIsInThePictureGoesOnAtOnce) {
  const Rig rig = alan_rig();
  const Vector3 end = search_point(rig);
  const IntoView into_view(rig, end);
  const Vector3 seen = places_for({}, rig).rendezvous_point;
  ASSERT_TRUE(in_view(rig.camera, rig.leds, seen));
  EXPECT_EQ(into_view.first_N(seen), end);
}

TEST(IntoView, TheFirstPlaceIsInThePictureBelowTheEnd) {
  const Rig rig = alan_rig();
  const Vector3 end = search_point(rig);
  const IntoView into_view(rig, end);
  Rng rng(11);
  int lower = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vector3 p(rng.uniform(-3, 2), rng.uniform(-2, 2), rng.uniform(0, 2));
    const Vector3 first = into_view.first_N(p);
    EXPECT_TRUE(in_view(rig.camera, rig.leds, first)) << p.transpose();
    EXPECT_EQ(first.head<2>(), end.head<2>());
    EXPECT_GE(first.z(), std::min(p.z(), end.z())) << p.transpose();
    lower += first != end;
  }
  EXPECT_GT(lower, 200);
}

// As drones go that the wind takes at the take-off: towards the lens, out at a corner.
TEST(IntoView, FromBesideTheLensItComesIntoThePictureSooner) {
  const Rig rig = alan_rig();
  const Vector3 end = search_point(rig);
  const IntoView into_view(rig, end);
  Rng rng(12);
  std::vector<double> shares;
  while (shares.size() < 300) {
    const Vector3 p(rng.uniform(0.25, 0.4), rng.uniform(-0.25, 0.25),
                    rng.uniform(0.2, 0.4));
    if (in_view(rig.camera, rig.leds, p)) continue;
    const double straight = unseen_way(rig, p, end);
    const double by_first = unseen_way(rig, p, into_view.first_N(p));
    EXPECT_LT(by_first, straight + 0.1) << p.transpose();
    shares.push_back(by_first / straight);
  }
  std::nth_element(shares.begin(), shares.begin() + 150, shares.end());
  EXPECT_LT(shares[150], 0.8);
}

}  // namespace
}  // namespace alight
