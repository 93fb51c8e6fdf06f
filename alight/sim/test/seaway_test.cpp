#include "alight/sim/seaway.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

namespace alight {
namespace {

constexpr double kStep = 0.1;     // s
constexpr double kLong = 3000.0;  // s: 500 peak periods
const SeaScenario kSea{.heave_m = 0.5, .roll_deg = 8, .pitch_deg = 3, .period_s = 6};

class SeawaySeeds : public testing::TestWithParam<unsigned> {};

TEST_P(SeawaySeeds, SignificantAmplitudesAreThoseAsked) {
  const Seaway sea(kSea, Rng(GetParam()));
  Vector3 square = Vector3::Zero(), sum = Vector3::Zero();
  int n = 0;
  for (double t = 0; t < kLong; t += kStep, ++n) {
    const auto deck = sea.at(t);
    const Vector3 x(deck.heave.value, deck.roll.value, deck.pitch.value);
    sum += x;
    square += x.cwiseProduct(x);
  }
  // Twice the standard deviation.
  const Vector3 significant = 2 * (square / n).cwiseSqrt();
  EXPECT_NEAR(significant[0], 0.5, 0.05);
  EXPECT_NEAR(significant[1] / kDegree, 8, 0.8);
  EXPECT_NEAR(significant[2] / kDegree, 3, 0.3);
  EXPECT_LT((sum / n).cwiseAbs().maxCoeff(), 0.01);
}

TEST_P(SeawaySeeds, RatesAreDerivatives) {
  const Seaway sea(kSea, Rng(GetParam()));
  const double h = 1e-4;
  for (double t = 0.5; t < 60; t += 3.7) {
    const auto before = sea.at(t - h), now = sea.at(t), after = sea.at(t + h);
    for (const auto part :
         {&Seaway::Deck::heave, &Seaway::Deck::roll, &Seaway::Deck::pitch}) {
      EXPECT_NEAR(((after.*part).value - (before.*part).value) / (2 * h),
                  (now.*part).rate, 1e-6);
      EXPECT_NEAR(((after.*part).rate - (before.*part).rate) / (2 * h),
                  (now.*part).acceleration, 1e-6);
    }
  }
}

TEST_P(SeawaySeeds, HeaveHasItsPeakAtThePeriodAsked) {
  const Seaway sea(kSea, Rng(GetParam()));
  // Power in bands of a fifth of the peak's frequency, by Fourier sums.
  double strongest = 0, at = 0;
  for (double ratio = 0.5; ratio < 2.5; ratio += 0.2) {
    double power = 0;
    for (int k = 0; k < 20; ++k) {
      const double omega = (ratio + 0.01 * k) * 2 * kPi / kSea.period_s;
      std::complex<double> sum = 0;
      for (double t = 0; t < 1200; t += 0.5) {
        sum += sea.at(t).heave.value * std::polar(1.0, -omega * t);
      }
      power += std::norm(sum);
    }
    if (power > strongest) {
      strongest = power;
      at = ratio + 0.1;
    }
  }
  EXPECT_NEAR(at, 1.0, 0.21);
}

TEST_P(SeawaySeeds, TheBowIsUpWhileTheHullRises) {
  // Pitch, bow down positive, goes against the speed of heave and is a quarter of a
  // period apart from heave itself.
  const Seaway sea(kSea, Rng(GetParam()));
  double with_rate = 0, with_value = 0, pitch2 = 0, rate2 = 0, value2 = 0;
  for (double t = 0; t < kLong; t += kStep) {
    const auto d = sea.at(t);
    with_rate += d.pitch.value * d.heave.rate;
    with_value += d.pitch.value * d.heave.value;
    pitch2 += d.pitch.value * d.pitch.value;
    rate2 += d.heave.rate * d.heave.rate;
    value2 += d.heave.value * d.heave.value;
  }
  EXPECT_LT(with_rate / std::sqrt(pitch2 * rate2), -0.9);
  EXPECT_LT(std::abs(with_value) / std::sqrt(pitch2 * value2), 0.1);
}

TEST_P(SeawaySeeds, DoesNotComeRoundAgain) {
  const Seaway sea(kSea, Rng(GetParam()));
  // The spacing of the frequencies is a 24th of the peak's: after 24 periods evenly
  // spaced ones would repeat.
  double same = 0, all = 0;
  for (double t = 0; t < 300; t += kStep) {
    const double a = sea.at(t).heave.value, b = sea.at(t + 24 * 6.0).heave.value;
    same += a * b;
    all += a * a;
  }
  EXPECT_LT(std::abs(same / all), 0.7);
}
INSTANTIATE_TEST_SUITE_P(Seeds, SeawaySeeds, testing::Range(0u, 6u));

TEST(Seaway, SeedsDrawOtherSeasAndTheSameSeedTheSame) {
  const Seaway a(kSea, Rng(1)), again(kSea, Rng(1)), b(kSea, Rng(2));
  EXPECT_EQ(a.at(7).roll.value, again.at(7).roll.value);
  EXPECT_NE(a.at(7).roll.value, b.at(7).roll.value);
}

TEST(Seaway, AFlatSeaIsFlat) {
  const Seaway sea({.heave_m = 0, .roll_deg = 0, .pitch_deg = 0}, Rng(3));
  EXPECT_EQ(sea.at(12).heave.value, 0);
  EXPECT_EQ(sea.at(12).roll.rate, 0);
}

}  // namespace
}  // namespace alight
