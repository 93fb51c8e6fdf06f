#include "alight/mission/miss.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"

namespace alight {
namespace {

TEST(Miss, IsAsVagueAsPlaceAndSpeedDrawnTogether) {
  constexpr int kDraws = 20000;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    Rng rng(seed);
    Covariance9 root;
    for (double& x : root.reshaped()) x = rng.normal(0, 0.05);
    const Covariance9 cov = root * root.transpose();
    Vector3 squares = Vector3::Zero();
    for (int i = 0; i < kDraws; ++i) {
      Eigen::Matrix<double, 9, 1> n;
      for (double& x : n) x = rng.normal();
      const Eigen::Matrix<double, 9, 1> e = root * n;
      squares += (e.head<3>() + kMissAhead * e.tail<3>()).cwiseAbs2();
    }
    const double drawn = std::sqrt(squares.maxCoeff() / kDraws);
    EXPECT_NEAR(miss_sd(cov), drawn, 0.03 * drawn) << seed;
  }
}

TEST(Miss, OfWhatStandsStillForSureIsThatOfItsPlace) {
  Covariance9 cov = Covariance9::Zero();
  cov.diagonal().head<3>() = Vector3(4e-4, 9e-4, 1e-4);
  EXPECT_NEAR(miss_sd(cov), 0.03, 1e-12);
}

UsualMiss seen(Seconds until, double (*miss)(Seconds)) {
  UsualMiss usual;
  usual.begin();
  for (Seconds t = 0; t < until; t += 0.01) usual.see(miss(t), from_seconds(t));
  return usual;
}

TEST(UsualMiss, IsTheRootMeanSquareOfTheLastSeconds) {
  EXPECT_EQ(UsualMiss().rms(), 0);
  EXPECT_NEAR(seen(0.5, [](Seconds) { return 0.02; }).rms(), 0.02, 1e-12);
  const auto swings = [](Seconds t) { return 0.04 * std::sin(2 * kPi * t); };
  EXPECT_NEAR(seen(3, swings).rms(), 0.04 / std::sqrt(2), 5e-4);
  EXPECT_NEAR(seen(30, swings).rms(), 0.04 / std::sqrt(2), 2e-3);
  // What was long ago no longer counts, what is new does not count alone.
  const auto calms = [](Seconds t) { return t < 10 ? 0.1 : 0.01; };
  EXPECT_LT(seen(40, calms).rms(), 0.011);
  EXPECT_GT(seen(12, calms).rms(), 0.05);
}

TEST(UsualMiss, IsNotSpoiltByWhatIsNoNumberNorByTimeThatStandsOrJumps) {
  UsualMiss usual;
  for (int i = 0; i < 100; ++i) usual.see(0.02, i * 10'000'000);
  usual.see(std::nan(""), 1'000'000'000);
  usual.see(9, 1'000'000'000);  // as late as the last
  usual.see(9, 0);
  EXPECT_NEAR(usual.rms(), 0.02, 1e-12);
  usual.see(0.04, 3'600'000'000'000);  // an hour later: a tenth of a second of it
  EXPECT_LT(usual.rms(), 0.025);
  usual.begin();
  EXPECT_EQ(usual.rms(), 0);
}

}  // namespace
}  // namespace alight
