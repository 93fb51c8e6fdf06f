#include "alight/eval/path_error.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"

namespace alight {
namespace {

Vector3 random_vector(Rng& rng, double sd) {
  return {rng.normal(0, sd), rng.normal(0, sd), rng.normal(0, sd)};
}
Pose random_pose(Rng& rng) {
  return make_pose(so3_exp(random_vector(rng, 1)), random_vector(rng, 2));
}

PosePairs random_pairs(Rng& rng, int count, double p_sd, double R_sd) {
  PosePairs pairs;
  for (int i = 0; i < count; ++i) {
    PosePair pair{from_seconds(0.1 * i), {}, random_pose(rng)};
    pair.estimate = make_pose(pair.truth.linear() * so3_exp(random_vector(rng, R_sd)),
                              pair.truth.translation() + random_vector(rng, p_sd));
    pairs.push_back(pair);
  }
  return pairs;
}

class PathErrorLaws : public testing::TestWithParam<int> {
 protected:
  Rng rng{static_cast<std::uint64_t>(GetParam())};
};
INSTANTIATE_TEST_SUITE_P(Seeds, PathErrorLaws, testing::Range(0, 20));

TEST_P(PathErrorLaws, FitUndoesAnyRigidMotion) {
  const PosePairs pairs = random_pairs(rng, 30, 0, 0);
  const Pose X = random_pose(rng);
  const auto fitted = fit_se3(moved(pairs, X.inverse()));
  ASSERT_TRUE(fitted) << fitted.error().detail;
  EXPECT_TRUE(fitted->isApprox(X, 1e-9));
  EXPECT_NEAR(fitted->linear().determinant(), 1, 1e-12);
}

TEST_P(PathErrorLaws, FitIsBetterThanItsNeighbours) {
  const PosePairs pairs = random_pairs(rng, 30, 0.1, 0);
  const auto X = fit_se3(pairs);
  ASSERT_TRUE(X);
  const auto cost = [&](const Pose& moved_by) {
    return path_error(moved(pairs, moved_by))->position_rmse_m;
  };
  const double best = cost(*X);
  EXPECT_NEAR(path_error(pairs)->position_fitted_rmse_m, best, 1e-12);
  for (int i = 0; i < 20; ++i) {
    const Pose nudge =
        make_pose(so3_exp(random_vector(rng, 0.01)), random_vector(rng, 0.01));
    EXPECT_GE(cost(*X * nudge), best);
  }
}

TEST_P(PathErrorLaws, ErrorsDoNotDependOnTheWorldFrame) {
  const PosePairs pairs = random_pairs(rng, 40, 0.1, 0.1);
  PosePairs turned = pairs;
  const Pose X = random_pose(rng);
  for (PosePair& pair : turned) {
    pair.estimate = X * pair.estimate;
    pair.truth = X * pair.truth;
  }
  const auto a = path_error(pairs);
  const auto b = path_error(turned);
  ASSERT_TRUE(a && b);
  EXPECT_NEAR(a->position_rmse_m, b->position_rmse_m, 1e-10);
  EXPECT_NEAR(a->position_fitted_rmse_m, b->position_fitted_rmse_m, 1e-10);
  EXPECT_NEAR(a->rotation_rmse_rad, b->rotation_rmse_rad, 1e-10);
  EXPECT_NEAR(a->rotation_mean_out_rmse_rad, b->rotation_mean_out_rmse_rad, 1e-9);
  EXPECT_EQ(a->success, b->success);
}

TEST_P(PathErrorLaws, AConstantTurnOfTheBodyIsWhatTheMeanTakesOut) {
  PosePairs pairs = random_pairs(rng, 20, 0, 0);
  const Vector3 turn = random_vector(rng, 0.3);
  for (PosePair& pair : pairs) {
    pair.estimate.linear() = pair.truth.linear() * so3_exp(turn);
  }
  const auto error = path_error(pairs);
  ASSERT_TRUE(error);
  EXPECT_NEAR(error->rotation_rmse_rad, turn.norm(), 1e-9);
  EXPECT_NEAR(error->rotation_mean_out_rmse_rad, 0, 1e-7);
}

TEST_P(PathErrorLaws, RmseGrowsToTheNoise) {
  const auto error = path_error(random_pairs(rng, 3000, 0.05, 0.02));
  ASSERT_TRUE(error);
  // rms of a 3-vector is sd sqrt(3); its own spread at 9000 numbers is 0.75 %.
  EXPECT_NEAR(error->position_rmse_m, 0.05 * std::sqrt(3), 0.05 * 0.07);
  EXPECT_NEAR(error->rotation_rmse_rad, 0.02 * std::sqrt(3), 0.02 * 0.07);
}

TEST(PathError, CountsWhatIsWithinFifteenCentimetresAndDegrees) {
  PosePairs pairs(4);
  pairs[1].estimate.translation().x() = 0.151;
  pairs[2].estimate.linear() = so3_exp({0, 0, 15.1 * kDegree});
  pairs[3].estimate.translation().x() = 0.149;
  pairs[3].estimate.linear() = so3_exp({0, 0, 14.9 * kDegree});
  EXPECT_DOUBLE_EQ(path_error(pairs)->success, 0.5);
}

TEST(PathError, SaysWhatItCannotDo) {
  EXPECT_EQ(path_error({}).error().fault, Fault::too_few_points);
  EXPECT_EQ(fit_se3(PosePairs(2)).error().fault, Fault::too_few_points);
  PosePairs line(10);
  for (int i = 0; i < 10; ++i) {
    line[static_cast<std::size_t>(i)].estimate.translation().x() = i;
    line[static_cast<std::size_t>(i)].truth.translation().y() = i;
  }
  EXPECT_EQ(fit_se3(line).error().fault, Fault::degenerate);
  const auto error = path_error(line);
  ASSERT_TRUE(error);
  EXPECT_TRUE(std::isnan(error->position_fitted_rmse_m));
}

PoseLog log_at(std::initializer_list<double> times) {
  PoseLog log;
  for (const double t : times) {
    log.emplace_back(from_seconds(t), make_pose(Matrix3::Identity(), {t, 0, 0}));
  }
  return log;
}

TEST(Associate, TakesTheNearestOnceAndNoneTooFar) {
  const PoseLog truth = log_at({0, 1, 2, 3, 4});
  const PosePairs pairs = associate(log_at({-5, 0.1, 0.9, 1.02, 2.6, 9}), truth, 0.3);
  ASSERT_EQ(pairs.size(), 2u);  // 1.02 finds its truth taken, 2.6 is too far
  EXPECT_DOUBLE_EQ(pairs[0].truth.translation().x(), 0);
  EXPECT_DOUBLE_EQ(pairs[1].truth.translation().x(), 1);
  EXPECT_DOUBLE_EQ(pairs[1].estimate.translation().x(), 0.9);
}

TEST(Associate, OfALogThatRepeatsInstantsIsRowByRow) {
  PoseLog log = log_at({0, 0, 1, 1, 1, 1.01, 2});
  for (std::size_t i = 0; i < log.size(); ++i) {
    log[i].second.translation().y() = static_cast<double>(i);
  }
  const PosePairs pairs = associate(log, log, 0.02);
  ASSERT_EQ(pairs.size(), log.size());
  for (const PosePair& pair : pairs) {
    EXPECT_EQ(pair.estimate.translation(), pair.truth.translation());
  }
}

TEST(Associate, OfEqualLogsIsRowByRow) {
  const PoseLog log = log_at({0, 0.01, 0.02, 5, 6});
  const PosePairs by_time = associate(log, log, 0.001);
  const auto by_row = associate_rows(log, log);
  ASSERT_TRUE(by_row);
  ASSERT_EQ(by_time.size(), by_row->size());
  for (std::size_t i = 0; i < by_time.size(); ++i) {
    EXPECT_EQ(by_time[i].t, (*by_row)[i].t);
  }
  EXPECT_TRUE(associate(log, {}, 1).empty());
  EXPECT_TRUE(associate({}, log, 1).empty());
  EXPECT_FALSE(associate_rows(log, log_at({0})));
}

TEST(MeanRotation, IsTheMiddleAndRefusesOpposites) {
  const std::vector<Matrix3> pair{so3_exp({0.2, 0, 0}), so3_exp({0.6, 0, 0})};
  const auto R = mean_rotation(pair);
  ASSERT_TRUE(R);
  EXPECT_TRUE(R->isApprox(so3_exp({0.4, 0, 0}), 1e-9));
  EXPECT_FALSE(mean_rotation({}));
}

}  // namespace
}  // namespace alight
