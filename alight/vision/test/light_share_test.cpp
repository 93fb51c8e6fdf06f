#include "alight/vision/light_share.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr int kLeds = 6;
constexpr double kSd = 1.2;  // px

LightShare::Heights heights(double each) {
  LightShare::Heights out{};
  for (int i = 0; i < kLeds; ++i) {
    out[static_cast<std::size_t>(i)] = each * (1 + 0.3 * i);
  }
  return out;
}

/// After so many pictures of lights that flicker by `flicker` (sd, share).
struct Watched {
  LightShare share;
  Rng rng{7};
  double flicker;

  explicit Watched(double flicker_in = 0.01) : flicker(flicker_in) {
    for (int k = 0; k < 60; ++k) look(heights(400), 1);
  }
  void look(LightShare::Heights lights, double range_m) {
    for (double& height : lights) height *= 1 + rng.normal(0, flicker);
    share.look(lights, range_m);
    share.learn();
  }
  double displaced(int led) const { return share.displaced_px(led, kSd); }
};

double density(double a) {
  return std::exp(-a * a / 2) / std::sqrt(2 * std::numbers::pi);
}
double below(double a) { return 0.5 * std::erfc(-a / std::numbers::sqrt2); }

TEST(LightShare, WholeLightsAreWhereTheyAre) {
  Watched w;
  int displaced = 0;
  for (int k = 0; k < 200; ++k) {
    w.look(heights(400), 1);
    for (int i = 0; i < kLeds; ++i) displaced += w.displaced(i) > 0;
    EXPECT_TRUE(w.share.whole());
  }
  EXPECT_LT(displaced, 12);  // one of a hundred
}

// An edge that cuts a Gaussian at a times its spread leaves its middle off by
// density / share: what is said is no less, until half of the light is gone.
TEST(LightShare, ACutLightIsSaidToBeAsFarOffAsItIs) {
  for (double a = 1.4; a >= 0; a -= 0.2) {
    Watched w;
    LightShare::Heights cut = heights(400);
    cut[2] *= below(a);
    w.share.look(cut, 1);
    const double off = kSd * density(a) / below(a);
    EXPECT_GT(w.displaced(2), 0.7 * off) << a;
    EXPECT_LT(w.displaced(2), 1.6 * off) << a;
    for (const int other : {0, 1, 3, 4, 5}) EXPECT_EQ(w.displaced(other), 0);
    EXPECT_EQ(w.share.whole(), 1 - below(a) <= 0.15);
  }
}

TEST(LightShare, AllLightsChangeWithTheRange) {
  Watched w;
  double range = 1;
  for (int k = 0; k < 60; ++k) {
    range *= 1.02;
    w.look(heights(400 / (range * range)), range);
    for (int i = 0; i < kLeds; ++i) EXPECT_LT(w.displaced(i), 0.2) << k;
    EXPECT_TRUE(w.share.whole());
  }
}

TEST(LightShare, AllLightsChangeWithTheExposure) {
  Watched w;
  w.look(heights(150), 1);
  for (int i = 0; i < kLeds; ++i) EXPECT_LT(w.displaced(i), 0.2);
  EXPECT_TRUE(w.share.whole());
}

TEST(LightShare, LastLightIsJudgedByItself) {
  Watched w;
  LightShare::Heights last{};
  last[3] = heights(400)[3];
  w.look(last, 1);
  EXPECT_LT(w.displaced(3), 0.2);
  last[3] *= 0.6;
  w.share.look(last, 1);
  EXPECT_GT(w.displaced(3), 0.4);
  EXPECT_FALSE(w.share.whole());
}

// A light that shines less to this side is not cut for ever.
TEST(LightShare, WhatStaysDimIsDim) {
  Watched w;
  LightShare::Heights dim = heights(400);
  dim[1] *= 0.5;
  w.look(dim, 1);
  EXPECT_GT(w.displaced(1), 0.5);
  for (int k = 0; k < 90; ++k) w.look(dim, 1);
  EXPECT_LT(w.displaced(1), 0.15);
  EXPECT_TRUE(w.share.whole());
}

TEST(LightShare, WhatIsNotSeenSaysNothing) {
  LightShare share;
  EXPECT_TRUE(share.whole());
  EXPECT_EQ(share.displaced_px(0, kSd), 0);
  share.look({}, 0);
  share.learn();
  share.look(heights(100), 1);
  EXPECT_TRUE(share.whole());
  EXPECT_EQ(share.displaced_px(0, kSd), 0);
}

}  // namespace
}  // namespace alight
