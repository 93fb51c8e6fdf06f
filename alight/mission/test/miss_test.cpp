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

}  // namespace
}  // namespace alight
