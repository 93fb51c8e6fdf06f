#include "alight/vision/lights_fitted.h"

#include <gtest/gtest.h>

#include <numbers>

#include "alight/base/rng.h"
#include "alight/vision/test/scene.h"

namespace alight {
namespace {

using test::Picture;

constexpr PointSpread kAsNew{.variance_px2 = 0.81, .share_sd = 0.35};

struct Looked {
  FixedVector<Blob, kMaxBlobs> before, after;
  int more = 0;
};

Looked look(Picture& picture, Rng& rng, const PointSpread& spread = kAsNew) {
  auto detector = BlobDetector::create({}, picture.width, picture.height).value();
  const ImageView image = picture.expose(rng, 2);
  Looked out;
  const BlobSpan found = detector.detect(image).value();
  out.before.assign(found.begin(), found.end());
  out.after = out.before;
  out.more = fit_lights(image, spread, detector, out.after);
  return out;
}

double nearest_px(const Looked& looked, const Vector2& uv) {
  double best = 1e9;
  for (const Blob& blob : looked.after) best = std::min(best, (blob.uv - uv).norm());
  return best;
}

Vector2 along(double way) { return {std::cos(way), std::sin(way)}; }

TEST(LightsFitted, TwoThatRunTogetherAreTwoWhateverTheirWayAndBrightness) {
  Rng rng(1);
  int parted = 0, run_together = 0;
  for (int n = 0; n < 100; ++n) {
    const double sd = rng.uniform(0.8, 1.0);
    const Vector2 half =
        0.5 * rng.uniform(2.5, 3.5) * along(rng.uniform(0, 2 * std::numbers::pi));
    const Vector2 middle(100 + rng.uniform(), 100 + rng.uniform());
    Picture picture(3, 200, 200);
    picture.add(middle + half, LedColor::green, rng.uniform(150, 300), sd);
    picture.add(middle - half, LedColor::green, rng.uniform(150, 300), sd);
    const Looked looked = look(picture, rng);
    if (looked.before.size() != 1) continue;
    ++run_together;
    parted += looked.more == 1;
    if (looked.more != 1) continue;
    EXPECT_LT(nearest_px(looked, middle + half), 0.15) << n;
    EXPECT_LT(nearest_px(looked, middle - half), 0.15) << n;
    for (const Blob& blob : looked.after) EXPECT_EQ(blob.color, LedColor::green);
  }
  EXPECT_GT(run_together, 50);
  EXPECT_GE(parted, 0.95 * run_together);
}

TEST(LightsFitted, OneStaysOneAndIsPlacedBetterThanByItsCentroid) {
  Rng rng(3);
  double by_fit = 0, by_centroid = 0;
  for (int n = 0; n < 200; ++n) {
    // Cameras draw points of light wider or narrower than has been supposed; bright
    // ones are full in the middle.
    const double sd = rng.uniform(0.7, 1.2), peak = rng.uniform(80, 900);
    const Vector2 uv(100 + rng.uniform(), 100 + rng.uniform());
    Picture picture(3, 200, 200);
    picture.add(uv, LedColor::red, peak, sd);
    const Looked looked = look(picture, rng);
    ASSERT_EQ(looked.before.size(), 1u) << n;
    ASSERT_EQ(looked.more, 0) << n << ": sd " << sd << ", peak " << peak;
    by_fit += (looked.after[0].uv - uv).squaredNorm();
    by_centroid += (looked.before[0].uv - uv).squaredNorm();
  }
  EXPECT_LT(by_fit, 0.5 * by_centroid);
}

TEST(LightsFitted, TheStreakOfOneThatMovesStaysOne) {
  Rng rng(4);
  for (int n = 0; n < 60; ++n) {
    const Vector2 way = along(rng.uniform(0, 2 * std::numbers::pi));
    const Vector2 uv(100 + rng.uniform(), 100 + rng.uniform());
    Picture picture(3, 200, 200);
    constexpr int kSteps = 20;
    for (int k = 0; k < kSteps; ++k) {
      picture.add(uv + 2.0 * (k / (kSteps - 1.0) - 0.5) * way, LedColor::green,
                  300.0 / kSteps, 0.9);
    }
    EXPECT_EQ(look(picture, rng).more, 0) << n;
  }
}

TEST(LightsFitted, EachHasItsOwnColor) {
  Rng rng(5);
  for (int n = 0; n < 40; ++n) {
    const Vector2 half = 1.75 * along(rng.uniform(0, 2 * std::numbers::pi));
    const Vector2 middle(100 + rng.uniform(), 100 + rng.uniform());
    Picture picture(3, 200, 200);
    picture.add(middle + half, LedColor::green, 250, 0.9);
    picture.add(middle - half, LedColor::red, 250, 0.9);
    const Looked looked = look(picture, rng);
    if (looked.before.size() != 1) continue;
    ASSERT_EQ(looked.more, 1) << n;
    for (const Blob& blob : looked.after) {
      const bool green = (blob.uv - middle).dot(half) > 0;
      EXPECT_EQ(blob.color, green ? LedColor::green : LedColor::red) << n;
    }
  }
}

TEST(LightsFitted, LargePatchesAndThoseAtTheEdgeStayAsTheyAre) {
  Rng rng(6);
  Picture picture(3, 200, 200);
  picture.add({100, 100}, LedColor::green, 900, 5);
  picture.add({112, 100}, LedColor::green, 900, 5);
  picture.add({1, 60}, LedColor::green, 250, 0.9);
  picture.add({1, 63}, LedColor::green, 250, 0.9);
  const Looked looked = look(picture, rng);
  ASSERT_EQ(looked.before.size(), 2u);
  EXPECT_EQ(looked.more, 0);
  for (std::size_t k = 0; k < looked.before.size(); ++k) {
    EXPECT_EQ(looked.after[k].uv, looked.before[k].uv);
  }
}

TEST(LightsFitted, APictureFullOfPatchesKeepsToItsRoom) {
  Rng rng(7);
  Picture picture(3, 848, 480);
  for (int v = 10; v < 470; v += 14) {
    for (int u = 10; u < 838; u += 14) {
      picture.add({u - 1.5, v}, LedColor::green, 250, 0.9);
      picture.add({u + 1.5, v}, LedColor::green, 250, 0.9);
    }
  }
  const Looked looked = look(picture, rng);
  EXPECT_EQ(looked.before.size(), kMaxBlobs);
  EXPECT_EQ(looked.after.size(), kMaxBlobs);
  EXPECT_EQ(looked.more, 0);
}

}  // namespace
}  // namespace alight
