#include "alight/vision/pose_from_leds.h"

#include <gtest/gtest.h>

#include "scene.h"

namespace alight {
namespace {

FixedVector<LedObservation, kMaxLeds> exact(const Rig& rig, const Pose& X_NB) {
  FixedVector<LedObservation, kMaxLeds> seen;
  for (int i = 0; i < rig.leds.size(); ++i) {
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << i);
    o.uv = *project_led(rig.camera, X_NB, rig.leds.p_BL(i));
    seen.push_back(o);
  }
  return seen;
}

class PnpProperty : public testing::TestWithParam<unsigned> {};

TEST_P(PnpProperty, RecoversThePoseThatMadeTheImage) {
  Rng rng(GetParam());
  Rig rig = alan_rig();
  if (GetParam() % 2 == 1)
    rig.camera.intrinsics.distortion = {-0.06, 0.02, 1e-3, -1e-3, 0};
  const Pose X_NB = test::random_pose(rig, rng);
  const auto seen = exact(rig, X_NB);
  const auto fit = solve_pnp(rig.camera, rig.leds, {seen.data(), seen.size()});
  ASSERT_TRUE(fit);
  EXPECT_TRUE(fit->X_NB.isApprox(X_NB, 1e-6));
  EXPECT_LT(fit->rms_px, 1e-6);
  EXPECT_GT(fit->runner_up_rms_px, fit->rms_px);
}
INSTANTIATE_TEST_SUITE_P(Seeds, PnpProperty, testing::Range(0u, 100u));

TEST(RefinePose, CovarianceIsThatOfTheError) {
  const Rig rig = alan_rig();
  double nees = 0;
  constexpr int kTrials = 1000;
  for (unsigned seed = 0; seed < kTrials; ++seed) {
    Rng rng(seed);
    const Pose X_NB = test::random_pose(rig, rng, 0.4, 1.2);
    auto seen = exact(rig, X_NB);
    for (auto& o : seen) {
      o.cov = 0.01 * Matrix2::Identity();
      o.uv += 0.1 * Vector2(rng.normal(), rng.normal());
    }
    const auto fit =
        refine_pose(rig.camera, rig.leds, {seen.data(), seen.size()}, X_NB);
    ASSERT_TRUE(fit);
    Vector6 e;
    e.head<3>() = X_NB.translation() - fit->X_NB.translation();
    e.tail<3>() = so3_log(fit->X_NB.linear().transpose() * X_NB.linear());
    nees += e.dot(fit->cov.inverse() * e);
  }
  EXPECT_NEAR(nees / kTrials, 6, 0.6);
}

TEST(RefinePose, ThePriorHoldsWhatThePictureDoesNotSay) {
  const Rig rig = alan_rig();
  Rng rng(5);
  const Pose X_NB = test::random_pose(rig, rng, 0.6, 1);
  const auto seen = exact(rig, X_NB);
  const Matrix6 prior = 100 * Matrix6::Identity();
  const auto fit = refine_pose(rig.camera, rig.leds, {seen.data(), 1}, X_NB, &prior);
  ASSERT_TRUE(fit);
  EXPECT_TRUE(fit->X_NB.isApprox(X_NB, 1e-9));
}

TEST(SolvePnp, RefusesTooFewAndALine) {
  Rig rig = alan_rig();
  Rng rng(5);
  const Pose X_NB = test::random_pose(rig, rng, 0.6, 1);
  const auto seen = exact(rig, X_NB);
  EXPECT_EQ(solve_pnp(rig.camera, rig.leds, {seen.data(), 3}).error().fault,
            Fault::too_few_points);
  for (int i = 0; i < rig.leds.size(); ++i) {
    rig.leds.leds[static_cast<std::size_t>(i)].p_BL = Vector3(0.02 * i, 0, 0);
  }
  const auto line = exact(rig, X_NB);
  EXPECT_EQ(solve_pnp(rig.camera, rig.leds, {line.data(), line.size()}).error().fault,
            Fault::degenerate);
}

}  // namespace
}  // namespace alight
