#include "alight/vision/gamma_learner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "alight/vision/test/scene.h"

namespace alight {
namespace {

using test::Picture;

/// A camera that draws lights in its own way.
struct CameraLook {
  double gamma = 1;
  double sd_px = 0.9;
  double skirt = 0.05;    // height of a second, wider Gaussian, which is
  double wider = 2.2;     // so many times as wide
  double noise_sd = 1.2;  // of light
  double knee = 255;      // brighter ones are stored darker than they are
};

/// Lights of about that peak, on a background of 3.
Picture picture_of(const CameraLook& look, const std::vector<Vector2>& lights,
                   double peak, Rng& rng) {
  Picture picture(3, 60, 50);
  for (const Vector2& uv : lights) {
    const double own = peak * rng.uniform(0.8, 1.2);
    picture.add(uv, LedColor::green, own, look.sd_px);
    picture.add(uv, LedColor::green, look.skirt * own, look.wider * look.sd_px);
  }
  for (std::size_t i = 0; i < picture.light.size(); ++i) {
    double light = std::max(picture.light[i] + 3 + look.noise_sd * rng.normal(), 0.0);
    if (light > look.knee) {
      const double room = 255 - look.knee;
      light = look.knee + room * (1 - std::exp((look.knee - light) / (2 * room)));
    }
    const double stored = 255 * std::pow(std::min(light, 255.0) / 255, 1 / look.gamma);
    picture.bytes[i] = static_cast<std::uint8_t>(std::lround(stored));
  }
  return picture;
}

struct Learnt {
  GammaLearner learner;
  int most_steps = 0;
  int taken = 0;  // looks
};

Learnt learn(const CameraLook& look, int looks, std::uint64_t seed, int count = 2,
             double peak = 150) {
  Rng rng(seed);
  Learnt out;
  const double stored_sd = look.sd_px * std::sqrt(look.gamma);
  for (int i = 0; i < looks; ++i) {
    std::vector<Vector2> lights;
    Vector2 at(22 + rng.uniform(), 20 + rng.uniform());
    double way = rng.uniform(0, 2 * kPi);
    for (int k = 0; k < count; ++k) {
      lights.push_back(at);
      at += rng.uniform(2, 4) * stored_sd * Vector2(std::cos(way), std::sin(way));
      way += rng.uniform(-0.8, 0.8);
    }
    const Picture picture = picture_of(look, lights, peak, rng);
    for (Vector2& uv : lights) uv += 0.1 * Vector2(rng.normal(), rng.normal());
    out.learner.look(picture.view(), lights, stored_sd, picture_noise(picture.view()));
    int steps = 0;
    while (out.learner.busy()) {
      out.learner.step();
      ++steps;
    }
    out.most_steps = std::max(out.most_steps, steps);
    out.taken += steps > 0;
  }
  return out;
}

TEST(GammaLearner, FindsThePowerByWhichACameraStoresLight) {
  for (const double gamma : {1.0, 1.43, 2.2}) {
    for (const int count : {2, 3}) {
      double sum = 0;
      constexpr int kRuns = 6;
      for (int run = 0; run < kRuns; ++run) {
        const Learnt learnt =
            learn({.gamma = gamma}, 80, static_cast<std::uint64_t>(run + 1), count);
        const auto found = learnt.learner.gamma();
        ASSERT_TRUE(found) << gamma << ", " << count;
        EXPECT_NEAR(std::log(*found / gamma), 0, 0.25) << gamma << ", " << count;
        sum += std::log(*found / gamma) / kRuns;
      }
      EXPECT_NEAR(sum, 0, 0.1) << gamma << ", " << count;
    }
  }
}

// Two Gaussians, wide or narrow, with skirts or without, are no two ways to store
// light.
TEST(GammaLearner, TakesNoLinearCameraForAnother) {
  int known = 0;
  Rng rng(5);
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    CameraLook look;
    look.sd_px = rng.uniform(0.7, 1.6);
    look.skirt = rng.uniform(0, 0.15);
    look.wider = rng.uniform(1.5, 3);
    look.noise_sd = rng.uniform(0.6, 3);
    const auto found = learn(look, 25, 100 + seed).learner.gamma();
    if (!found) continue;
    ++known;
    EXPECT_NEAR(*found, 1, 0.18) << seed;
  }
  EXPECT_GE(known, 16);
}

// A sensor that only bends what is bright adds up lights as a linear one does.
TEST(GammaLearner, IsNotMisledByBrightLightsThatAreBent) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const auto found = learn({.knee = 205}, 40, 200 + seed, 2, 240).learner.gamma();
    if (found) {
      EXPECT_NEAR(*found, 1, 0.2) << seed;
    }
  }
}

// A drone may be far off before it is seen well again: what is likelier is said at
// once.
TEST(GammaLearner, SaysAfterFewLooksWhatIsLikelier) {
  constexpr int kCameras = 40;
  int said = 0, wrong = 0;
  for (std::uint64_t seed = 1; seed <= kCameras; ++seed) {
    if (const auto found = learn({.gamma = 2.2}, 4, 400 + seed, 3).learner.gamma()) {
      said += std::abs(std::log(*found / 2.2)) < 0.25;
    }
    const auto of_light = learn({}, 4, 500 + seed, 3).learner.gamma();
    wrong += of_light && *of_light != 1;
  }
  EXPECT_GE(said, 0.8 * kCameras);
  EXPECT_LE(wrong, 0.05 * kCameras);
}

// Most cameras that store no light store it alike.
TEST(GammaLearner, KnowsTheUsualPowerBetterThanOthers) {
  const auto error = [](double gamma) {
    double sum = 0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      const auto found = learn({.gamma = gamma}, 12, 600 + seed, 3).learner.gamma();
      EXPECT_TRUE(found);
      const double off = found ? std::log(*found / gamma) : 1;
      sum += off * off / 10;
    }
    return std::sqrt(sum);
  };
  EXPECT_LT(error(2.2), 0.07);
  EXPECT_LT(error(1.6), 0.25);
}

TEST(GammaLearner, SaysNothingFromLittle) {
  EXPECT_FALSE(GammaLearner().gamma());
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    EXPECT_FALSE(learn({.gamma = 2.2}, 1, seed).learner.gamma()) << "a single look";
  }
  // Lights that are hardly there,
  EXPECT_FALSE(learn({.gamma = 2.2, .noise_sd = 0.1}, 40, 1, 2, 3).learner.gamma());
  // and one that stands alone.
  GammaLearner learner;
  Rng rng(1);
  const std::vector<Vector2> one{Vector2(25, 25)};
  const Picture picture = picture_of({}, one, 150, rng);
  learner.look(picture.view(), one, 1, {});
  EXPECT_FALSE(learner.busy());
  // Too near to the edge.
  const std::vector<Vector2> edge{Vector2(2, 2), Vector2(5, 2)};
  learner.look(picture.view(), edge, 1, {});
  EXPECT_FALSE(learner.busy());
}

// Noise as strong as that leaves no look worth its time.
TEST(GammaLearner, LooksSeldomWhereLooksTellNothing) {
  const Learnt vain = learn({.noise_sd = 60}, 300, 9);
  EXPECT_FALSE(vain.learner.gamma());
  EXPECT_GE(vain.taken, 3);
  EXPECT_LE(vain.taken, 40);
  // A few such do not keep it from finding out.
  const Learnt told = learn({.gamma = 2.2}, 12, 9);
  EXPECT_GE(told.taken, 8);
}

TEST(GammaLearner, EndsEveryLookInFewSteps) {
  EXPECT_LE(learn({.gamma = 2.2}, 40, 3, 3).most_steps, 14);
  const Learnt enough = learn({.noise_sd = 0.5}, 200, 4);
  EXPECT_TRUE(enough.learner.settled());
}

// Full lights and noise alone: whatever is in the pixels, it ends and says no nonsense.
TEST(GammaLearner, StandsAnyPixels) {
  Rng rng(9);
  GammaLearner learner;
  for (int i = 0; i < 60; ++i) {
    Picture picture(i % 2 ? 3 : 1, 60, 50);
    for (auto& b : picture.bytes) {
      b = static_cast<std::uint8_t>(i % 3 == 0 ? 255 * (rng.uniform() < 0.5)
                                               : 255 * rng.uniform());
    }
    const std::vector<Vector2> lights{Vector2(25, 25), Vector2(28, 25)};
    learner.look(picture.view(), lights, 1, {});
    for (int k = 0; k < 14; ++k) learner.step();
    EXPECT_FALSE(learner.busy());
  }
  if (learner.gamma()) {
    EXPECT_GE(*learner.gamma(), Rig::kGammaLeast);
    EXPECT_LE(*learner.gamma(), Rig::kGammaMost);
  }
}

}  // namespace
}  // namespace alight
