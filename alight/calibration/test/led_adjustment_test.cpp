#include "alight/calibration/led_adjustment.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "flight.h"

namespace alight {
namespace {

Eigen::VectorXd stacked(const Constellation& leds) {
  Eigen::VectorXd out(3 * leds.size());
  for (int i = 0; i < leds.size(); ++i) out.segment<3>(3 * i) = leds.p_BL(i);
  return out;
}

/// Errors with the rigid motion taken out, which no picture tells.
Eigen::VectorXd shape_error(const Constellation& found, const Constellation& truth) {
  const Eigen::VectorXd d = stacked(found) - stacked(truth);
  const Eigen::MatrixXd rigid = rigid_motions(truth);
  return d - rigid * (rigid.transpose() * d);
}

LedDistance distance(const Constellation& leds, int i, int j) {
  return {i, j, (leds.p_BL(i) - leds.p_BL(j)).norm(), 1e-5};
}

class LedAdjustmentProperty : public testing::TestWithParam<unsigned> {};

TEST_P(LedAdjustmentProperty, ExactImagesAndOneDistanceGiveTheShape) {
  Rng rng(GetParam());
  const Rig truth = drawn_rig(0.002, rng);
  const auto frames = flown(truth, 60, 0, rng, rng.uniform(0, 6));
  LedAdjustmentConfig config;
  config.distances = {distance(truth.leds, 0, 5)};
  const Constellation nominal = alan_rig().leds;
  const auto found = adjust_leds(config, truth.camera, nominal, nominal, frames);
  ASSERT_TRUE(found) << found.error().detail;
  // Second order of the turn that stays: 2 mm over 7 cm.
  EXPECT_LT(shape_error(found->leds, truth.leds).cwiseAbs().maxCoeff(), 4e-4);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < i; ++j) {
      EXPECT_NEAR((found->leds.p_BL(i) - found->leds.p_BL(j)).norm(),
                  (truth.leds.p_BL(i) - truth.leds.p_BL(j)).norm(), 3e-5);
    }
  }
}

TEST_P(LedAdjustmentProperty, TheWholeStaysWhereTheRigFilePutIt) {
  Rng rng(GetParam());
  const Rig truth = drawn_rig(0.003, rng);
  const auto frames = flown(truth, 40, 0.1, rng);
  const Constellation nominal = alan_rig().leds;
  const auto found = adjust_leds({}, truth.camera, nominal, nominal, frames);
  ASSERT_TRUE(found);
  Vector3 shift = Vector3::Zero(), turn = Vector3::Zero();
  for (int i = 0; i < 6; ++i) {
    const Vector3 d = found->leds.p_BL(i) - nominal.p_BL(i);
    shift += d;
    turn += found->leds.p_BL(i).cross(d);
  }
  EXPECT_LT(shift.norm(), 1e-6);
  EXPECT_LT(turn.norm(), 1e-7);
}

TEST_P(LedAdjustmentProperty, OutliersDoNotMoveIt) {
  Rng rng(GetParam());
  const Rig truth = drawn_rig(0.002, rng);
  auto frames = flown(truth, 120, 0.1, rng);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    auto& seen = frames[f].seen;
    if (f % 10 == 0) std::swap(seen[1].uv, seen[2].uv);
    if (f % 17 == 0) seen[4].uv += Vector2(rng.normal(0, 15), rng.normal(0, 15));
  }
  LedAdjustmentConfig config;
  config.distances = {distance(truth.leds, 0, 5)};
  const Constellation nominal = alan_rig().leds;
  const auto found = adjust_leds(config, truth.camera, nominal, nominal, frames);
  ASSERT_TRUE(found);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < i; ++j) {
      EXPECT_NEAR((found->leds.p_BL(i) - found->leds.p_BL(j)).norm(),
                  (truth.leds.p_BL(i) - truth.leds.p_BL(j)).norm(), 5e-4);
    }
  }
  EXPECT_GT(found->rejected, 15);
}

INSTANTIATE_TEST_SUITE_P(Seeds, LedAdjustmentProperty, testing::Range(0u, 20u));

TEST(LedAdjustment, SaysHowSureItIs) {
  const Constellation nominal = alan_rig().leds;
  double squares = 0;
  int count = 0, beyond = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    Rng rng(1000 + seed);
    const Rig truth = drawn_rig(0.0005, rng);  // small: the laws are of first order
    const auto frames = flown(truth, 60, 0.3, rng, rng.uniform(0, 6));
    LedAdjustmentConfig config;
    config.led_sd_m = 0.0005;
    config.bias_sd_px = config.bias_sd_share = 0;  // there is none
    config.distances = {distance(truth.leds, 0, 5)};
    const auto found = adjust_leds(config, truth.camera, nominal, nominal, frames);
    ASSERT_TRUE(found);
    const Eigen::VectorXd e = shape_error(found->leds, truth.leds);
    for (int i = 0; i < e.size(); ++i) {
      const double z2 = e(i) * e(i) / found->cov_shape(i, i);
      squares += z2;
      beyond += z2 > 9 ? 1 : 0;
      ++count;
    }
  }
  EXPECT_LT(squares / count, 1.3);
  EXPECT_GT(squares / count, 0.5);
  EXPECT_LT(beyond, 0.01 * count);
}

TEST(LedAdjustment, SizeIsAsSureAsItsSource) {
  const Constellation nominal = alan_rig().leds;
  double by_prior = 0, by_depth = 0, by_distance = 0;
  const int seeds = 40;
  for (unsigned seed = 0; seed < seeds; ++seed) {
    Rng rng(2000 + seed);
    const Rig truth = drawn_rig(0.002, rng);
    auto frames = flown(truth, 50, 0.05, rng);
    for (auto& frame : frames) {
      for (auto& o : frame.seen) o.depth_m += rng.normal(0, 0.01);
    }
    const double known = (truth.leds.p_BL(0) - truth.leds.p_BL(5)).norm();
    const auto error_of_size = [&](const LedAdjustmentConfig& config) {
      const auto found = adjust_leds(config, truth.camera, nominal, nominal, frames);
      EXPECT_TRUE(found);
      const double is = (found->leds.p_BL(0) - found->leds.p_BL(5)).norm();
      return (is / known - 1) / found->scale_sd;
    };
    LedAdjustmentConfig config;
    config.led_sd_m = 0.002;
    by_prior += std::pow(error_of_size(config), 2) / seeds;
    config.use_depth = true;
    by_depth += std::pow(error_of_size(config), 2) / seeds;
    config.use_depth = false;
    config.distances = {{0, 5, known + rng.normal(0, 0.0003), 0.0003}};
    by_distance += std::pow(error_of_size(config), 2) / seeds;
  }
  EXPECT_LT(by_prior, 2);
  EXPECT_GT(by_prior, 0.4);
  EXPECT_LT(by_depth, 1.5);  // its common scale was not off
  EXPECT_LT(by_distance, 2);
  EXPECT_GT(by_distance, 0.4);
}

TEST(LedAdjustment, RefusesFewerNumbersThanUnknowns) {
  Rng rng(1);
  const Rig truth = alan_rig();
  const auto frames = flown(truth, 2, 0.1, rng);
  const auto found = adjust_leds({}, truth.camera, truth.leds, truth.leds, frames);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, Fault::too_few_points);
}

}  // namespace
}  // namespace alight
