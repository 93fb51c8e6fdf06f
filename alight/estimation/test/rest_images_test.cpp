#include "alight/estimation/rest_images.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

namespace alight {
namespace {

void see(RestImages& images, int led, const Vector2& uv, int pictures, Rng& rng) {
  for (int i = 0; i < pictures; ++i) {
    images.add(led, uv + Vector2(rng.normal(0, 0.2), rng.normal(0, 0.2)));
  }
}

TEST(RestImages, AreTheMeansByLed) {
  Rng rng(1);
  RestImages images;
  see(images, 0, {100, 200}, 50, rng);
  see(images, 3, {300, 50}, 50, rng);
  EXPECT_LT((*images.mean(0, 50) - Vector2(100, 200)).norm(), 0.15);
  EXPECT_LT((*images.mean(3, 50) - Vector2(300, 50)).norm(), 0.15);
  EXPECT_FALSE(images.mean(0, 51));
  EXPECT_FALSE(images.mean(1, 1));
  images.forget();
  EXPECT_FALSE(images.mean(0, 1));
}

TEST(RestImages, WhatWasAnotherLightAtFirstLeavesNoTrace) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Rng rng(seed);
    RestImages images;
    see(images, 2, {130, 190}, 25, rng);
    see(images, 2, {100, 200}, 30, rng);
    const auto mean = images.mean(2, 20);
    ASSERT_TRUE(mean);
    EXPECT_LT((*mean - Vector2(100, 200)).norm(), 0.25) << seed;
  }
}

TEST(RestImages, OneThatIsMistakenNowAndThenIsLeftOut) {
  Rng rng(2);
  RestImages images;
  for (int i = 0; i < 20; ++i) {
    see(images, 5, {100, 200}, 6, rng);
    see(images, 5, {110, 205}, 1 + i % 4, rng);
  }
  const auto mean = images.mean(5, 100);
  ASSERT_TRUE(mean);
  EXPECT_LT((*mean - Vector2(100, 200)).norm(), 0.15);
}

}  // namespace
}  // namespace alight
