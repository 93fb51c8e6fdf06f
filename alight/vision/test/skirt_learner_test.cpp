#include "alight/vision/skirt_learner.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/vision/test/scene.h"

namespace alight {
namespace {

using test::Picture;

constexpr double kSd = 0.9;
const PointSpread kStart{kSd * kSd, 0.1};

/// A look at a light of `peak` grey levels whose skirt is `height` of it.
std::optional<SkirtLook> look(const PointSpread& spread, double peak, double height,
                              double variance_px2, Rng& rng) {
  Picture picture(3, 60, 50);
  const LightBeside light{{30 + rng.uniform(), 25 + rng.uniform()}, peak};
  picture.add(light.uv, LedColor::white, peak, kSd);
  picture.add(light.uv, LedColor::white, height * peak, std::sqrt(variance_px2));
  const ImageView image = picture.expose(rng);
  return look_at_skirt(image, light.uv, {&light, 1}, spread);
}

PointSpread learnt(PointSpread spread, int looks, double peak, double height,
                   double variance_px2, Rng& rng, SkirtLearner& learner) {
  for (int k = 0; k < looks; ++k) {
    const auto seen = look(spread, peak, height, variance_px2, rng);
    if (seen) learner.add(*seen, spread);
  }
  return spread;
}

TEST(SkirtLearner, LearnsHowHighAndHowWide) {
  Rng rng(1);
  for (const double variance_px2 : {3.5, 5.8, 9.0}) {
    for (const double height : {0.04, 0.08}) {
      SkirtLearner learner;
      const PointSpread found =
          learnt(kStart, 200, 200, height, variance_px2, rng, learner);
      EXPECT_TRUE(learner.settled());
      EXPECT_NEAR(found.skirt, height, 0.2 * height) << variance_px2;
      EXPECT_NEAR(found.skirt_variance_px2, variance_px2, 0.2 * variance_px2) << height;
      // What matters: its light 4 px away, to a twentieth of a grey level of 200.
      const auto light = [](const PointSpread& s) {
        return s.skirt * std::exp(-16 / (2 * s.skirt_variance_px2));
      };
      PointSpread truth = kStart;
      truth.skirt = height;
      truth.skirt_variance_px2 = variance_px2;
      EXPECT_NEAR(light(found), light(truth), 0.001);
    }
  }
}

TEST(SkirtLearner, WithoutASkirtThereIsNone) {
  Rng rng(2);
  SkirtLearner learner;
  const PointSpread found = learnt(kStart, 200, 200, 0, 5, rng, learner);
  EXPECT_LT(found.skirt, 0.004);
}

TEST(SkirtLearner, BrightLightsDoNotOutweighDimOnesForEver) {
  // Near the lens lights are full and their skirts look other than they do far away.
  Rng rng(3);
  SkirtLearner learner;
  const PointSpread near = learnt(kStart, 100, 240, 0.09, 5, rng, learner);
  EXPECT_GT(near.skirt, 0.07);
  const PointSpread far = learnt(near, 200, 90, 0.04, 5, rng, learner);
  EXPECT_NEAR(far.skirt, 0.04, 0.015);
}

TEST(SkirtLearner, StaysWithinWhatLensesDo) {
  Rng rng(4);
  SkirtLearner learner;
  PointSpread spread = kStart;
  for (int k = 0; k < 500; ++k) {
    SkirtLook wild;
    const Vector2 a(100 * rng.normal(), 100 * rng.normal());
    wild.information = a * a.transpose() + 2 * Matrix2::Identity();
    wild.pull = 1000 * Vector2(rng.normal(), rng.normal());
    learner.add(wild, spread);
    ASSERT_GE(spread.skirt, 0);
    ASSERT_LE(spread.skirt, 0.3);
    ASSERT_GE(spread.skirt_over_core(), PointSpread::kSkirtLeast);
    ASSERT_LE(spread.skirt_over_core(), PointSpread::kSkirtWidest);
  }
}

}  // namespace
}  // namespace alight
