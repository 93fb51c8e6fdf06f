#include "alight/vision/blob_detector.h"

#include <gtest/gtest.h>

#include "alight/vision/bright_scan.h"
#include "scene.h"

namespace alight {
namespace {

using test::Picture;

BlobDetector make_detector(BlobDetectorConfig config = {}, int width = 848,
                           int height = 480) {
  return std::move(*BlobDetector::create(config, width, height));
}

TEST(BrightScan, AgreesWithTheScalarScan) {
  Rng rng(1);
  std::vector<std::uint8_t> bytes(500);
  for (int trial = 0; trial < 2000; ++trial) {
    const int threshold = static_cast<int>(rng.uniform(0, 255));
    for (auto& b : bytes) b = static_cast<std::uint8_t>(rng.uniform(0, threshold + 1));
    for (int k = 0; k < trial % 3; ++k) {
      bytes[static_cast<std::size_t>(rng.uniform(0, 500))] = 255;
    }
    const int begin = static_cast<int>(rng.uniform(0, 500));
    const int end = begin + static_cast<int>(rng.uniform(0, 501 - begin));
    const int want = first_bright_scalar(bytes.data(), begin, end, threshold);
    ASSERT_EQ(first_bright(bytes.data(), begin, end, threshold), want);
    ASSERT_EQ(first_bright_narrow(bytes.data(), begin, end, threshold), want);
  }
}

/// Flood fill, the obvious way.
int count_patches(const Picture& picture, int threshold, long& lit) {
  const auto bright = [&](int u, int v) {
    const std::uint8_t* p = picture.view().row(v) + 3 * u;
    return std::max({p[0], p[1], p[2]}) > threshold;
  };
  std::vector<char> done(static_cast<std::size_t>(picture.width * picture.height), 0);
  int patches = 0;
  lit = 0;
  std::vector<std::pair<int, int>> stack;
  for (int v = 0; v < picture.height; ++v) {
    for (int u = 0; u < picture.width; ++u) {
      if (!bright(u, v) || done[static_cast<std::size_t>(v * picture.width + u)])
        continue;
      ++patches;
      stack.push_back({u, v});
      done[static_cast<std::size_t>(v * picture.width + u)] = 1;
      while (!stack.empty()) {
        const auto [x, y] = stack.back();
        stack.pop_back();
        ++lit;
        for (int b = std::max(y - 1, 0); b <= std::min(y + 1, picture.height - 1);
             ++b) {
          for (int a = std::max(x - 1, 0); a <= std::min(x + 1, picture.width - 1);
               ++a) {
            char& mark = done[static_cast<std::size_t>(b * picture.width + a)];
            if (mark || !bright(a, b)) continue;
            mark = 1;
            stack.push_back({a, b});
          }
        }
      }
    }
  }
  return patches;
}

TEST(BlobDetector, FindsThePatchesOfAFloodFill) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    Rng rng(seed);
    Picture picture(3, 90, 60);
    for (auto& b : picture.bytes) {
      b = static_cast<std::uint8_t>(rng.uniform() < 0.07 ? rng.uniform(0, 256) : 0);
    }
    long lit = 0;
    const int expected = count_patches(picture, 60, lit);
    auto detector = make_detector({}, 90, 60);
    const auto blobs = detector.detect(picture.view());
    ASSERT_TRUE(blobs);
    ASSERT_LT(expected, kMaxBlobs);
    EXPECT_EQ(static_cast<int>(blobs->size()), expected);
    double area = 0;
    for (const Blob& blob : *blobs) area += blob.area_px;
    EXPECT_EQ(area, static_cast<double>(lit));
  }
}

TEST(BlobDetector, CentroidIsWhereTheLightIs) {
  auto detector = make_detector();
  double square = 0, worst = 0;
  int count = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    Rng rng(seed);
    Picture picture(3, 848, 480);
    const Vector2 uv(rng.uniform(20, 820), rng.uniform(20, 460));
    picture.add(uv, LedColor::green, rng.uniform(180, 900), rng.uniform(0.9, 2.0));
    const auto blobs = detector.detect(picture.expose(rng));
    ASSERT_TRUE(blobs);
    ASSERT_EQ(blobs->size(), 1u);
    const Blob& blob = (*blobs)[0];
    worst = std::max(worst, (blob.uv - uv).norm());
    square += (blob.uv - uv).dot(blob.cov.inverse() * (blob.uv - uv));
    count += 2;
  }
  // The covariance told is never better than the truth; its floor is 0.05 px.
  EXPECT_LT(square / count, 1);
  EXPECT_LT(worst, 0.15);
}

TEST(BlobDetector, TellsColorsOfSaturatedLights) {
  auto detector = make_detector();
  for (const LedColor color :
       {LedColor::red, LedColor::green, LedColor::blue, LedColor::white}) {
    for (unsigned seed = 0; seed < 20; ++seed) {
      Rng rng(seed);
      Picture picture(3, 848, 480);
      picture.add({100 + rng.uniform(), 100 + rng.uniform()}, color,
                  rng.uniform(150, 3000), 1.5);
      const auto blobs = detector.detect(picture.expose(rng));
      ASSERT_TRUE(blobs);
      ASSERT_EQ(blobs->size(), 1u);
      EXPECT_EQ((*blobs)[0].color, color);
    }
  }
}

// What shines around a light is no part of it, be it brighter than the usual dark.
TEST(BlobDetector, TellsColorsInBrightPictures) {
  auto detector = make_detector();
  for (const LedColor color : {LedColor::red, LedColor::green, LedColor::blue}) {
    for (unsigned seed = 0; seed < 10; ++seed) {
      Rng rng(seed);
      Picture picture(3, 848, 480);
      for (double& light : picture.light) light = 35;
      picture.add({100 + rng.uniform(), 100 + rng.uniform()}, color, 150, 1.2);
      const ImageView image = picture.expose(rng, 4);
      detector.set_noise(picture_noise(image));
      const auto blobs = detector.detect(image);
      ASSERT_TRUE(blobs);
      ASSERT_EQ(blobs->size(), 1u);
      EXPECT_EQ((*blobs)[0].color, color);
    }
  }
}

TEST(BlobDetector, GreyPicturesHaveNoColor) {
  auto detector = make_detector();
  Rng rng(1);
  Picture picture(1);
  picture.add({50, 60}, LedColor::white);
  const auto blobs = detector.detect(picture.expose(rng));
  ASSERT_TRUE(blobs);
  ASSERT_EQ(blobs->size(), 1u);
  EXPECT_EQ((*blobs)[0].color, LedColor::none);
}

TEST(BlobDetector, NothingOutsideTheRegionMatters) {
  auto detector = make_detector();
  Rng rng(3);
  Picture picture;
  for (int i = 0; i < 20; ++i) {
    picture.add({rng.uniform(200, 300), rng.uniform(200, 260)}, LedColor::red);
  }
  picture.expose(rng);
  const Roi roi{190, 180, 311, 271};
  const auto first = detector.detect(picture.view(), {}, roi);
  ASSERT_TRUE(first);
  const std::vector<Blob> before(first->begin(), first->end());
  ASSERT_GT(before.size(), 3u);
  const int m = detector.config().color_margin_px;
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 848; ++u) {
      if (u >= roi.u0 - m && u < roi.u1 + m && v >= roi.v0 - m && v < roi.v1 + m)
        continue;
      for (int c = 0; c < 3; ++c) {
        picture.bytes[static_cast<std::size_t>((v * 848 + u) * 3 + c)] =
            static_cast<std::uint8_t>(rng.bits());
      }
    }
  }
  const auto second = detector.detect(picture.view(), {}, roi);
  ASSERT_TRUE(second);
  ASSERT_EQ(second->size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ((*second)[i].uv, before[i].uv);
    EXPECT_EQ((*second)[i].color, before[i].color);
    EXPECT_EQ((*second)[i].brightness, before[i].brightness);
  }
}

TEST(BlobDetector, SmoothingJoinsAcrossTwoDarkPixels) {
  for (int gap = 0; gap <= 4; ++gap) {
    Picture picture(1, 40, 20);
    picture.bytes[10 * 40 + 10] = 200;
    picture.bytes[static_cast<std::size_t>(10 * 40 + 11 + gap)] = 200;
    BlobDetectorConfig config;
    config.smooth = true;
    auto detector = make_detector(config, 40, 20);
    const auto blobs = detector.detect(picture.view());
    ASSERT_TRUE(blobs);
    EXPECT_EQ(blobs->size(), gap <= 2 ? 1u : 2u) << gap;
    EXPECT_NEAR((*blobs)[0].uv.x(), gap <= 2 ? 10.5 + gap / 2.0 : 10.0, 1e-12);
  }
}

TEST(BlobDetector, DepthHidesWhatIsFarAndIsMeasured) {
  BlobDetectorConfig config;
  config.depth_threshold_m = 3;
  auto detector = make_detector(config);
  Rng rng(1);
  Picture picture;
  picture.add({100, 100}, LedColor::red);
  picture.add({300, 100}, LedColor::red);
  picture.add({500, 100}, LedColor::red);
  std::vector<std::uint16_t> mm(848 * 480, 1500);
  for (int v = 0; v < 480; ++v) {
    for (int u = 200; u < 848; ++u) {
      mm[static_cast<std::size_t>(v * 848 + u)] =
          u < 400 ? std::uint16_t{5000} : std::uint16_t{0};
    }
  }
  const auto blobs = detector.detect(picture.expose(rng), {mm.data(), 848, 480, 848});
  ASSERT_TRUE(blobs);
  ASSERT_EQ(blobs->size(), 2u);
  EXPECT_DOUBLE_EQ((*blobs)[0].depth_m, 1.5);
  EXPECT_DOUBLE_EQ((*blobs)[1].depth_m, 0.0);
}

TEST(BlobDetector, RefusesWhatIsNotItsPicture) {
  auto detector = make_detector();
  Picture small(3, 40, 20), odd(2);
  EXPECT_EQ(detector.detect(small.view()).error().fault, Fault::invalid_input);
  EXPECT_EQ(detector.detect(odd.view()).error().fault, Fault::invalid_input);
  EXPECT_EQ(detector.detect({}).error().fault, Fault::invalid_input);
  Picture good;
  std::vector<std::uint16_t> mm(100);
  EXPECT_EQ(detector.detect(good.view(), {mm.data(), 10, 10, 10}).error().fault,
            Fault::invalid_input);
  EXPECT_TRUE(detector.detect(good.view(), {}, {-50, -50, 5000, 5000}));
  EXPECT_TRUE(detector.detect(good.view(), {}, {900, 500, 950, 550}));
}

TEST(BlobDetector, StandsAPictureFullOfNoise) {
  auto detector = make_detector();
  Rng rng(2);
  Picture picture;
  for (auto& b : picture.bytes) b = static_cast<std::uint8_t>(rng.bits());
  const auto blobs = detector.detect(picture.view());
  if (blobs) {
    EXPECT_LE(blobs->size(), static_cast<std::size_t>(kMaxBlobs));
  }
  for (std::size_t i = 0; i < picture.bytes.size(); ++i) {
    picture.bytes[i] = (i / 3) % 2 == 0 && (i / 3 / 848) % 2 == 0 ? 255 : 0;
  }
  const auto grid = detector.detect(picture.view());
  ASSERT_FALSE(grid);
  EXPECT_EQ(grid.error().fault, Fault::degenerate);
}

TEST(BlobDetector, DimLightsAreFoundWhenTheyAreLookedFor) {
  auto detector = make_detector();
  Picture picture;
  for (const int u : {100, 200, 300}) {
    for (int c = 0; c < 3; ++c) {
      picture.bytes[static_cast<std::size_t>((50 * 848 + u) * 3 + c)] = 45;
    }
  }
  const auto count = [&](BlobDetector::LookFor what) {
    return detector.detect(picture.view(), {}, {}, what)->size();
  };
  EXPECT_EQ(count(BlobDetector::LookFor::bright), 0u);
  EXPECT_EQ(count(BlobDetector::LookFor::dim), 3u);
  EXPECT_EQ(count(BlobDetector::LookFor::bright), 0u);
}

TEST(BlobDetectorConfig, NamesTheFieldAndItsBounds) {
  BlobDetectorConfig config;
  config.grey_threshold = 300;
  const auto bad = BlobDetector::create(config, 848, 480);
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().detail.find("grey_threshold is 300"), std::string::npos);
}

}  // namespace
}  // namespace alight
