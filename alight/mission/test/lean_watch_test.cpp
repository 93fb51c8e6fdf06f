#include "alight/mission/lean_watch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "alight/base/rng.h"
#include "alight/geometry/so3.h"

namespace alight {
namespace {

constexpr Time kPicture = 16'666'667;

/// Pictures of a drone whose LEDs stand askew in it, and of what telemetry tells.
struct Watch {
  LeanWatch lean;
  Time now = kPicture;
  Vector2 askew_deg = Vector2(3.5, -4);
  double noise_deg = 1;
  Rng rng{1};
  Seconds contrary_after = -1;

  void run(Seconds s, const Vector2& more_deg = Vector2::Zero()) {
    for (Seconds t = 0; t < s; t += to_seconds(kPicture)) {
      now += kPicture;
      const Vector2 deg =
          askew_deg + more_deg + noise_deg * Vector2(rng.normal(), rng.normal());
      lean.add(now, 1.1 * Vector3(std::sin(deg.x() * kDegree),
                                  std::sin(deg.y() * kDegree), 0.99));
      if (lean.contrary() && contrary_after < 0) contrary_after = t;
    }
  }
};

TEST(LeanWatch, LedsThatStandAskewAreUsual) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    Watch w;
    w.rng = Rng(seed);
    w.noise_deg = 2;
    w.run(20);
    EXPECT_LT(w.contrary_after, 0) << seed;
  }
}

TEST(LeanWatch, AMomentInTheWindIsNoOtherDrone) {
  Watch w;
  w.run(2);
  w.run(0.25, {8, 0});
  w.run(3);
  w.run(0.6, {0, -5});
  w.run(3);
  EXPECT_LT(w.contrary_after, 0);
}

TEST(LeanWatch, AnotherDroneLeansOtherwise) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(seed);
    const double way = 0.2 * seed;
    const Vector2 there(std::cos(way), std::sin(way));
    const auto contrary_after = [&](double deg, Seconds s) {
      Watch w;
      w.rng = Rng(seed);
      w.run(3);
      w.run(s, deg * there);
      return w.contrary_after;
    };
    const Seconds fast = contrary_after(16, 1.5);
    EXPECT_GE(fast, 0);
    EXPECT_LT(fast, 0.4);
    const Seconds slow = contrary_after(7.5, 4);
    EXPECT_GE(slow, 0.3);
    EXPECT_LT(slow, 2.5);
  }
}

// It does not become usual, however long it is followed.
TEST(LeanWatch, AnotherDroneIsNotGotUsedTo) {
  Watch w;
  w.run(3);
  w.run(60, {12, 0});
  EXPECT_TRUE(w.lean.contrary());
  w.run(3);
  EXPECT_FALSE(w.lean.contrary()) << "the drone again";
}

TEST(LeanWatch, AfterAGapItBeginsFromWhatIsUsual) {
  Watch w;
  w.run(3);
  w.run(0.12, {16, 0});
  w.lean.pause();
  w.now += from_seconds(1);
  w.run(0.12, {16, 0});
  EXPECT_LT(w.contrary_after, 0);
  w.run(0.5, {16, 0});
  EXPECT_GE(w.contrary_after, 0);
}

TEST(LeanWatch, WhatIsOldOrNoNumberChangesNothing) {
  Watch w;
  w.run(3);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int k = 0; k < 200; ++k) {
    w.lean.add(w.now, Vector3(1, 0, 1));
    w.lean.add(w.now - k, Vector3(1, 0, 1));
    w.lean.add(w.now + k, Vector3(nan, 0, 1));
    w.lean.add(w.now + k, Vector3::Zero());
  }
  EXPECT_FALSE(w.lean.contrary());
}

}  // namespace
}  // namespace alight
