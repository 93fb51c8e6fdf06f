#include "alight/estimation/correction_trend.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"
#include "alight/estimation/test/flight.h"

namespace alight::test {
namespace {

constexpr double kSd = 0.3;

/// Mean ratio over many pictures whose corrections keep `kept` of the one before them,
/// all of the variance that is expected.
double mean_ratio(double kept) {
  Rng rng(1);
  CorrectionTrend trend;
  Vector3 correction = Vector3::Zero();
  constexpr int kPictures = 20'000, kFrom = 100;
  double mean = 0;
  for (int k = 0; k < kPictures; ++k) {
    correction = kept * correction + std::sqrt(1 - kept * kept) * normal3(rng, kSd);
    trend.add(correction, kSd * kSd * Matrix3::Identity());
    if (k >= kFrom) mean += trend.ratio() / (kPictures - kFrom);
  }
  return mean;
}

TEST(CorrectionTrend, IsOneOfWhiteCorrections) { EXPECT_NEAR(mean_ratio(0), 1, 0.05); }

TEST(CorrectionTrend, TellsOnesThatGoOnFromOnesThatTurnBack) {
  EXPECT_GT(mean_ratio(0.5), 1.8);
  EXPECT_LT(mean_ratio(-0.5), 0.6);
}

TEST(CorrectionTrend, TellsNothingBeforeAnything) {
  CorrectionTrend trend;
  EXPECT_EQ(trend.ratio(), 1);
  trend.add(Vector3::Zero(), Matrix3::Zero());
  EXPECT_EQ(trend.ratio(), 1);
}

TEST(CorrectionTrend, ForgetsWhatWasBefore) {
  CorrectionTrend trend;
  for (int k = 0; k < 20; ++k) {
    trend.add(Vector3::Constant(kSd), kSd * kSd * Matrix3::Identity());
  }
  EXPECT_GT(trend.ratio(), 3);
  trend.forget();
  trend.add(Vector3::Constant(kSd), kSd * kSd * Matrix3::Identity());
  EXPECT_NEAR(trend.ratio(), 1, 0.01);
}

}  // namespace
}  // namespace alight::test
