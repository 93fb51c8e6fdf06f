#include "alight/estimation/led_learner.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <vector>

#include "alight/base/rng.h"
#include "alight/estimation/test/flight.h"

namespace alight::test {
namespace {

constexpr double kLedSd = 0.002, kPixelSd = 0.05;

Constellation displaced(const Constellation& leds, double sd_m, Rng& rng) {
  Constellation out = leds;
  for (Led& led : out.leds) {
    led.p_BL += sd_m * Vector3(rng.normal(), rng.normal(), rng.normal());
  }
  return out;
}

/// Some way before the lens, nose towards it, turned by up to 25 deg about each axis.
Pose some_pose(const Camera& camera, Rng& rng) {
  const Vector3 p_CB(rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2),
                     rng.uniform(0.6, 1.8));
  const auto turn = [&] { return rng.uniform(-25, 25) * kDegree; };
  Matrix3 R_NB;
  R_NB = Eigen::AngleAxisd(kPi + turn(), Vector3::UnitZ()) *
         Eigen::AngleAxisd(turn(), Vector3::UnitY()) *
         Eigen::AngleAxisd(turn(), Vector3::UnitX());
  return make_pose(R_NB, camera.X_NC * p_CB);
}

std::vector<LedLearner::Image> images_of(const Camera& camera,
                                         const Constellation& leds, const Pose& X_NB,
                                         Rng& rng) {
  std::vector<LedLearner::Image> images;
  for (int i = 0; i < leds.size(); ++i) {
    const auto uv = project_led(camera, X_NB, leds.p_BL(i));
    if (!uv) continue;
    images.push_back(
        {i, *uv + kPixelSd * Vector2(rng.normal(), rng.normal()), kPixelSd * kPixelSd});
  }
  return images;
}

struct World {
  Rig rig = alan_rig();
  Rng rng;
  Constellation truth;
  LedLearner learner;

  World(std::uint64_t seed, double led_sd_m)
      : rng(seed),
        truth(displaced(rig.leds, led_sd_m, rng)),
        learner({}, rig.camera, rig.leds) {}

  void look(int pictures) {
    for (int k = 0; k < pictures; ++k) {
      const Pose X_NB = some_pose(rig.camera, rng);
      const auto images = images_of(rig.camera, truth, X_NB, rng);
      // About where the drone is: what a filter with LEDs that are off knows.
      Pose about = X_NB;
      about.translation() += 0.02 * Vector3(rng.normal(), rng.normal(), rng.normal());
      about.linear() =
          about.linear() *
          so3_exp(0.04 * Vector3(rng.normal(), rng.normal(), rng.normal()));
      if (!learner.offer(about, images)) continue;
      for (int step = 0; step < 2; ++step) (void)learner.step();
    }
  }

  Eigen::VectorXd off() const {
    Eigen::VectorXd d(3 * truth.size());
    for (int i = 0; i < truth.size(); ++i) {
      d.segment<3>(3 * i) = truth.p_BL(i) - learner.leds().p_BL(i);
    }
    return d;
  }
};

class LedLearnerSeeds : public testing::TestWithParam<std::uint64_t> {};

TEST(LedLearner, WhatIsForgottenStandsAsWrittenAgain) {
  World w(1, kLedSd);
  w.look(20);
  ASSERT_FALSE(w.learner.leds().p_BL(0).isApprox(w.rig.leds.p_BL(0), 1e-6));
  w.learner.forget();
  for (int i = 0; i < w.rig.leds.size(); ++i) {
    EXPECT_EQ(w.learner.leds().p_BL(i), w.rig.leds.p_BL(i));
  }
  EXPECT_FALSE(w.learner.step()) << "a picture is left";
  w.look(20);
  EXPECT_FALSE(w.learner.leds().p_BL(0).isApprox(w.rig.leds.p_BL(0), 1e-6));
}

/// Distances between LEDs, their common size taken out, are what the camera can see.
TEST_P(LedLearnerSeeds, FindsHowLedsStandToEachOther) {
  World w(GetParam(), kLedSd);
  w.look(60);
  const auto distances = [](const Constellation& leds) {
    Eigen::VectorXd d(leds.size() * (leds.size() - 1) / 2);
    int k = 0;
    for (int i = 0; i < leds.size(); ++i) {
      for (int j = i + 1; j < leds.size(); ++j) {
        d[k++] = (leds.p_BL(i) - leds.p_BL(j)).norm();
      }
    }
    return Eigen::VectorXd(d / d.norm());
  };
  const Eigen::VectorXd wanted = distances(w.truth);
  const double before = (distances(w.rig.leds) - wanted).norm();
  const double after = (distances(w.learner.leds()) - wanted).norm();
  EXPECT_LT(after, 0.35 * before);
}

INSTANTIATE_TEST_SUITE_P(Seeds, LedLearnerSeeds, testing::Range<std::uint64_t>(1, 21));

TEST(LedLearner, KnowsHowWellItKnows) {
  for (const int pictures : {4, 60}) {
    double sum = 0;
    constexpr int kRuns = 120;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      World w(seed, kLedSd);
      w.look(pictures);
      const Eigen::VectorXd d = w.off();
      const Eigen::LLT<Eigen::MatrixXd> cov(w.learner.cov());
      ASSERT_EQ(cov.info(), Eigen::Success);
      sum += d.dot(cov.solve(d)) / kRuns;
    }
    // 18 directions; it is told with some caution.
    EXPECT_GT(sum, 0.6 * 18) << pictures;
    EXPECT_LT(sum, 1.15 * 18) << pictures;
  }
}

TEST(LedLearner, OnePictureTellsNothing) {
  World w(1, kLedSd);
  w.look(1);
  EXPECT_FALSE(w.learner.step());
  for (int i = 0; i < w.truth.size(); ++i) {
    EXPECT_EQ(w.learner.leds().p_BL(i), w.rig.leds.p_BL(i));
  }
}

TEST(LedLearner, ThoseThatStandAsWrittenStay) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    World w(seed, 0);
    w.look(60);
    EXPECT_LT(w.off().cwiseAbs().maxCoeff(), 0.0006) << seed;
  }
}

/// Pictures of something else: LEDs taken for each other.
TEST(LedLearner, DoesNotBendLedsToFitWrongCorrespondences) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    World w(seed, 0);
    std::reverse(w.truth.leds.begin(), w.truth.leds.end());
    w.look(30);
    double moved = 0;
    for (int i = 0; i < w.truth.size(); ++i) {
      moved = std::max(moved, (w.learner.leds().p_BL(i) - w.rig.leds.p_BL(i)).norm());
    }
    EXPECT_LT(moved, 0.035) << seed;
  }
}

TEST(LedLearner, SaysWhatIsOutOfRange) {
  EXPECT_TRUE(LedLearnerConfig{}.validate());
  EXPECT_FALSE(LedLearnerConfig{.led_sd_m = 0}.validate());
  EXPECT_FALSE(LedLearnerConfig{.led_sd_max_m = 0.001}.validate());
  EXPECT_FALSE(LedLearnerConfig{.turn_deg = 0}.validate());
}

}  // namespace
}  // namespace alight::test
