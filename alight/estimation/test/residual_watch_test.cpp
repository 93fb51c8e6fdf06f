#include "alight/estimation/residual_watch.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr double kMetrePerPx = 0.005;  // 2 m away

/// Residuals as a pose fitted to n LEDs leaves them: constant part and noise, less what
/// six directions of their 2 n can take up.
struct Source {
  Eigen::MatrixXd J;     // derivative by the pose
  Eigen::MatrixXd left;  // projection on what a pose cannot explain
  Rng rng;
  Eigen::VectorXd constant;
  double sd_px;

  Source(int n, double led_sd_m, double sd_px_in, std::uint64_t seed)
      : rng(seed), sd_px(sd_px_in) {
    J.resize(2 * n, 6);
    for (int i = 0; i < J.size(); ++i) J.data()[i] = rng.normal();
    left = Eigen::MatrixXd::Identity(2 * n, 2 * n) -
           J * (J.transpose() * J).inverse() * J.transpose();
    constant.resize(2 * n);
    for (int i = 0; i < 2 * n; ++i) constant[i] = led_sd_m / kMetrePerPx * rng.normal();
  }

  std::vector<ResidualWatch::Residual> next(double claimed_sd_px,
                                            double m_per_px = kMetrePerPx) {
    Eigen::VectorXd r = kMetrePerPx / m_per_px * constant;
    for (int i = 0; i < r.size(); ++i) r[i] += sd_px * rng.normal();
    r = left * r;
    std::vector<ResidualWatch::Residual> out;
    for (int i = 0; i < r.size() / 2; ++i) {
      out.push_back({.led = i,
                     .px = r.segment<2>(2 * i),
                     .H = J.middleRows<2>(2 * i),
                     .m_per_px = m_per_px,
                     .variance_px2 = 2 * claimed_sd_px * claimed_sd_px,
                     .left = left.diagonal().segment<2>(2 * i).mean()});
    }
    return out;
  }
};

TEST(ResidualWatch, TellsConstantErrorsFromNoise) {
  for (const int n : {5, 6, 8}) {
    for (const double led_sd_m : {0.0, 0.001, 0.002}) {
      double noise = 0, led_square = 0;
      constexpr int kRuns = 60;
      for (int run = 0; run < kRuns; ++run) {
        Source source(n, led_sd_m, 0.1, static_cast<std::uint64_t>(run + 1));
        ResidualWatch watch;
        for (int k = 0; k < 300; ++k) watch.add(source.next(0.1));
        noise += watch.noise() / kRuns;
        led_square += watch.led_sd_m() * watch.led_sd_m() / kRuns;
      }
      EXPECT_NEAR(noise, 1, 0.12) << n << " LEDs, " << led_sd_m;
      // Exact LEDs: a tenth of the noise in one picture, at most.
      EXPECT_NEAR(std::sqrt(led_square), led_sd_m, 0.00005 + 0.12 * led_sd_m) << n;
    }
  }
}

TEST(ResidualWatch, NoiseThatWasClaimedTooLowShows) {
  for (const double factor : {0.8, 2.0, 4.0}) {
    Source source(6, 0, 0.1, 5);
    ResidualWatch watch;
    for (int k = 0; k < 600; ++k) watch.add(source.next(0.1 / factor));
    EXPECT_NEAR(std::sqrt(watch.noise()), factor, 0.25 * factor);
  }
}

// A drone just found is as well known as its first pictures allow only with their
// noise.
TEST(ResidualWatch, FourPicturesTellTheNoiseOfMostOf) {
  constexpr int kRuns = 200;
  for (const double factor : {0.6, 1.0, 1.4}) {
    double variance = 0, spread = 0;
    for (int run = 0; run < kRuns; ++run) {
      Source source(6, 0, 0.1, static_cast<std::uint64_t>(run + 1));
      ResidualWatch watch;
      for (int k = 0; k < 4; ++k) watch.add(source.next(0.1 / factor));
      variance += watch.noise() / kRuns;
      spread += std::pow(std::log(watch.noise() / (factor * factor)), 2) / kRuns;
    }
    EXPECT_GT(variance, 0.75 * factor * factor) << factor;
    EXPECT_LT(variance, 1.3 * factor * factor) << factor;
    EXPECT_LT(std::sqrt(spread), 0.45) << factor;
  }
}

/// How far off exact LEDs are taken to be after `look`, rms over many drones.
template <class Look>
double led_sd_rms(int runs, Look&& look) {
  double square = 0;
  for (int run = 0; run < runs; ++run) {
    Source source(6, 0, 0.1, static_cast<std::uint64_t>(run + 1));
    ResidualWatch watch;
    look(source, watch);
    square += watch.led_sd_m() * watch.led_sd_m() / runs;
  }
  return std::sqrt(square);
}

// Noise that stays in the mean by chance is not taken for LEDs that are off.
TEST(ResidualWatch, ExactLedsAreNotTakenToBeOffByWhatNoiseFeigns) {
  const double sd_m = led_sd_rms(100, [](Source& source, ResidualWatch& watch) {
    for (int k = 0; k < 60; ++k) watch.add(source.next(0.1));
  });
  const double hidden_m = 0.1 * kMetrePerPx / std::sqrt(60);
  EXPECT_LT(sd_m, 0.4 * hidden_m);
}

TEST(ResidualWatch, LedsAreAsSupposedUntilPicturesTell) {
  constexpr double kSupposed = 0.002;
  for (const int n : {4, 6}) {
    ResidualWatch watch;
    Source exact(n, 0, 0.02, 7);
    double last = kSupposed;
    EXPECT_EQ(watch.led_sd_m(kSupposed), kSupposed);
    for (int told = 0; told < 60; told += 2 * n - 6) {
      watch.add(exact.next(0.02));
      EXPECT_LE(watch.led_sd_m(kSupposed), last);
      last = std::max(watch.led_sd_m(kSupposed), watch.led_sd_m() + 1e-4);
    }
    EXPECT_LT(watch.led_sd_m(kSupposed), 0.0001) << n;
    // What is seen of LEDs that are off counts, however much was supposed.
    Source off(n, kSupposed, 0.02, 7);
    ResidualWatch other;
    for (int k = 0; k < 40; ++k) other.add(off.next(0.02));
    EXPECT_EQ(other.led_sd_m(kSupposed), other.led_sd_m());
  }
}

TEST(ResidualWatch, LedsAreOffByNoMoreThanOnePicturesNoiseHides) {
  // And by no less, if they are.
  constexpr double kSd_px = 0.02;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    ResidualWatch exact;
    exact.add(Source(6, 0, kSd_px, seed).next(kSd_px));
    EXPECT_LT(exact.led_sd_m(0.002), 2.5 * kSd_px * kMetrePerPx) << seed;
    ResidualWatch off;
    off.add(Source(6, 0.002, kSd_px, seed).next(kSd_px));
    EXPECT_GT(off.led_sd_m(0.002), 0.0006) << seed;
  }
}

// Pictures from afar leave far more open than those that follow nearby.
TEST(ResidualWatch, WhatWasSeenFromAfarMakesNoExactLedsSeemOff) {
  const double sd_m = led_sd_rms(100, [](Source& source, ResidualWatch& watch) {
    for (int k = 0; k < 60; ++k) watch.add(source.next(0.1, 2 * kMetrePerPx));
    for (int k = 0; k < 60; ++k) watch.add(source.next(0.1, 0.25 * kMetrePerPx));
  });
  const double hidden_nearby_m = 0.1 * 0.25 * kMetrePerPx / std::sqrt(60);
  EXPECT_LT(sd_m, 0.7 * hidden_nearby_m);
}

TEST(ResidualWatch, LedsThatAreKnockedLaterShow) {
  std::uint64_t seed = 100;
  const double sd_m = led_sd_rms(20, [&](Source& source, ResidualWatch& watch) {
    for (int k = 0; k < 600; ++k) watch.add(source.next(0.1));
    source.constant = Source(6, 0.001, 0.1, ++seed).constant;
    for (int k = 0; k < 120; ++k) watch.add(source.next(0.1));
  });
  EXPECT_GT(sd_m, 0.0003);
  EXPECT_LT(sd_m, 0.0015);
}

// What a filter believes to know of the pose says nothing of the pictures.
TEST(ResidualWatch, NoiseIsTheSameHoweverWellThePoseIsSaidToBeKnown) {
  Source source(6, 0, 0.1, 3);
  ResidualWatch sure, unsure;
  for (int k = 0; k < 200; ++k) {
    auto residuals = source.next(0.1);
    for (auto& r : residuals) r.left = 0.2;
    unsure.add(residuals);
    for (auto& r : residuals) r.left = 1;
    sure.add(residuals);
  }
  // By what the LEDs' means are known to, and no more.
  EXPECT_NEAR(unsure.noise(), sure.noise(), 0.02 * sure.noise());
}

// An LED that something may cover in part claims a pixel; that its place is better than
// that does not make the other places better.
TEST(ResidualWatch, AClaimOfAnotherKindTellsNothingOfTheNoise) {
  Source source(6, 0, 0.1, 3);
  ResidualWatch watch;
  double noise = 0;
  constexpr int kPictures = 600;
  for (int k = 0; k < kPictures; ++k) {
    auto residuals = source.next(0.1);
    residuals[1].variance_px2 = 2;
    watch.add(residuals);
    noise += watch.noise() / kPictures;
  }
  EXPECT_NEAR(noise, 1, 0.1);
}

TEST(ResidualWatch, ThreeLedsSayNothing) {
  ResidualWatch watch;
  const ResidualWatch::Residual r{
      .led = 0, .px = {5, 5}, .m_per_px = 1, .variance_px2 = 1};
  const std::vector<ResidualWatch::Residual> three{r, r, r};
  for (int k = 0; k < 10; ++k) watch.add(three);
  EXPECT_EQ(watch.led_sd_m(), 0);
  EXPECT_EQ(watch.noise(), 1);
}

}  // namespace
}  // namespace alight
