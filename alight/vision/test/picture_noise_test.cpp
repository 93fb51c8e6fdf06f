#include "alight/vision/picture_noise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/vision/blob_detector.h"
#include "alight/vision/spot_fit.h"
#include "scene.h"

namespace alight {
namespace {

using test::Picture;

/// Adds Gaussian noise, as a sensor's: cut at 0 and 255.
void shake(Picture& picture, double sd, Rng& rng) {
  for (auto& b : picture.bytes) {
    b = static_cast<std::uint8_t>(std::clamp(b + sd * rng.normal() + 0.5, 0.0, 255.0));
  }
}

Picture even(int channels, std::uint8_t level, int width = 848, int height = 480) {
  Picture picture(channels, width, height);
  std::fill(picture.bytes.begin(), picture.bytes.end(), level);
  return picture;
}

/// The maximum of three draws of sd 1 varies by this.
constexpr double kOfThree = 0.748;

TEST(PictureNoise, IsWhatWasPutIn) {
  const double weights = std::sqrt(0.114 * 0.114 + 0.587 * 0.587 + 0.299 * 0.299);
  for (const double sd : {3.0, 8.0, 20.0}) {
    for (const int channels : {1, 3}) {
      double grey = 0, luminance = 0;
      constexpr int kRuns = 20;
      for (int run = 0; run < kRuns; ++run) {
        Rng rng(static_cast<std::uint64_t>(run + 1));
        Picture picture = even(channels, 100, 424, 240);
        shake(picture, sd, rng);
        const PictureNoise noise = picture_noise(picture.view());
        EXPECT_NEAR(noise.grey_sd, channels == 1 ? sd : kOfThree * sd, 0.35 * sd);
        grey += noise.grey_sd / kRuns;
        luminance += std::sqrt(noise.luminance_variance) / kRuns;
      }
      EXPECT_NEAR(grey, channels == 1 ? sd : kOfThree * sd, 0.06 * sd + 0.5);
      EXPECT_NEAR(luminance, channels == 1 ? sd : weights * sd, 0.06 * sd + 0.2);
    }
  }
}

// Otherwise it would cost sight in pictures that are good.
TEST(PictureNoise, LightsAndEdgesAreNone) {
  Rng rng(1);
  for (int run = 0; run < 20; ++run) {
    Picture picture = even(3, 12);
    // A bright half, and boards across the rest.
    for (int v = 0; v < picture.height; ++v) {
      for (int u = 0; u < picture.width; ++u) {
        if (u < run * 40 && v % 60 > 20) continue;
        for (int c = 0; c < 3; ++c) {
          picture.bytes[static_cast<std::size_t>((v * picture.width + u) * 3 + c)] =
              u > picture.width / 2 ? 140 : 30;
        }
      }
    }
    for (int k = 0; k < 100; ++k) {
      const int u = static_cast<int>(rng.uniform(0, 840));
      const int v = static_cast<int>(rng.uniform(0, 470));
      for (int d = 0; d < 8; ++d) {
        picture.bytes[static_cast<std::size_t>(((v + d) * picture.width + u) * 3)] =
            255;
      }
    }
    shake(picture, 1.5, rng);
    const PictureNoise noise = picture_noise(picture.view());
    EXPECT_LT(noise.grey_sd, 3);
    EXPECT_LT(noise.luminance_variance, 6);
  }
}

TEST(PictureNoise, AnyPictureWillDo) {
  for (const int width : {1, 2, 3, 4, 17}) {
    for (const int height : {1, 2, 33}) {
      for (const int channels : {1, 3}) {
        const PictureNoise noise =
            picture_noise(even(channels, 200, width, height).view());
        EXPECT_EQ(noise.dark, 200);
        EXPECT_EQ(noise.grey_sd, 0);
        EXPECT_EQ(noise.luminance_variance, 0);
        EXPECT_EQ(noise.threshold(), 200);
      }
    }
  }
}

// What noise alone lights up is few, what an LED does stays.
TEST(PictureNoise, LeavesLightsAndNoNoise) {
  auto detector = std::move(*BlobDetector::create({}, 848, 480));
  int noise_blobs = 0, found = 0;
  constexpr int kRuns = 20;
  for (int run = 0; run < kRuns; ++run) {
    Rng rng(static_cast<std::uint64_t>(run + 1));
    Picture picture(3);
    const Vector2 uv(rng.uniform(20, 820), rng.uniform(20, 460));
    picture.add(uv, LedColor::green, 300, 1.2);
    picture.expose(rng, 0);
    for (auto& b : picture.bytes) b = static_cast<std::uint8_t>(std::min(b + 20, 255));
    shake(picture, 20, rng);
    detector.set_noise({});
    const auto lost = detector.detect(picture.view());
    EXPECT_TRUE(!lost || lost->size() > 400) << "noise that does not disturb";
    detector.set_noise(picture_noise(picture.view()));
    for (const auto what :
         {BlobDetector::LookFor::bright, BlobDetector::LookFor::dim}) {
      const auto blobs = detector.detect(picture.view(), {}, {}, what);
      ASSERT_TRUE(blobs);
      for (const Blob& blob : *blobs) {
        const bool own = (blob.uv - uv).norm() < 2;
        found += own;
        noise_blobs += !own;
        if (own) {
          EXPECT_LT((blob.uv - uv).norm(), 4 * std::sqrt(blob.cov.trace()));
        }
      }
    }
  }
  EXPECT_EQ(found, 2 * kRuns);
  EXPECT_LT(noise_blobs, 10 * 2 * kRuns);
}

// A light's place is as sure as the noise lets it be, and said to be.
TEST(PictureNoise, SaysHowWellLightsArePlaced) {
  double quiet_px2 = 0, square = 0, nees = 0, chi2 = 0;
  int count = 0;
  constexpr int kRuns = 300;
  Rng rng(5);
  for (int run = 0; run < kRuns; ++run) {
    Picture picture(3, 100, 80);
    const Vector2 uv(50 + rng.uniform(), 40 + rng.uniform());
    picture.add(uv, LedColor::white, 180, 1);
    picture.expose(rng, 0);
    for (auto& b : picture.bytes) b = static_cast<std::uint8_t>(std::min(b + 60, 255));
    shake(picture, 15, rng);
    PointSpread spread{.variance_px2 = 1, .share_sd = 0.1};
    const LightSought starts[] = {{uv}};
    const auto unaware = fit_spots(picture.view(), starts, spread, Vector2::Zero(), {});
    if (unaware) quiet_px2 += 1 / unaware->information(0, 0) / kRuns;
    spread.noise_variance = std::max(spread.noise_variance,
                                     picture_noise(picture.view()).luminance_variance);
    const auto fitted = fit_spots(picture.view(), starts, spread, Vector2::Zero(), {});
    if (!fitted) continue;
    ++count;
    const Vector2 e = fitted->uv[0] - uv;
    square += e.squaredNorm() / 2;
    nees += e.dot(fitted->information * e) / 2;
    chi2 += fitted->chi2_per_pixel;
  }
  EXPECT_GT(count, 0.98 * kRuns);
  EXPECT_LT(std::sqrt(square / count), 0.2);
  EXPECT_GT(nees / count, 0.6);
  EXPECT_LT(nees / count, 1.6);
  EXPECT_GT(chi2 / count, 0.6);
  EXPECT_LT(chi2 / count, 1.5);
  EXPECT_LT(quiet_px2, square / count) << "unaware of the noise it would be as good";
}

}  // namespace
}  // namespace alight
