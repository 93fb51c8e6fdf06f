#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "alight/vision/led_matcher.h"
#include "scene.h"

namespace alight {
namespace {

const std::filesystem::path kData =
    std::filesystem::path(ALIGHT_SOURCE_DIR) / ".." / "shared" / "data" / "alan";

ImageView view_of(const cv::Mat& picture) {
  return {picture.data, picture.cols, picture.rows, picture.channels(),
          static_cast<std::ptrdiff_t>(picture.step)};
}

TEST(RealFrame, SixLedsAmongNinetyCeilingLights) {
  const auto file = kData / "frames" / "led_and_ceiling_lights.png";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no " << file.string();
  const cv::Mat picture = cv::imread(file.string(), cv::IMREAD_COLOR);
  const auto result = detect_once(alan_rig(), view_of(picture));
  ASSERT_TRUE(result) << result.error().detail;
  ASSERT_TRUE(result->found);
  const Vector2 expected[] = {{205.15, 216.93}, {224.09, 232.21}, {235.32, 232.66},
                              {269.86, 213.74}, {279.01, 233.98}, {291.23, 220.67}};
  const LedFrame& frame = result->found->frame;
  ASSERT_EQ(frame.seen.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(frame.seen[i].leds, 1u << i);
    EXPECT_LT((frame.seen[i].uv - expected[i]).norm(), 0.5);
  }
  EXPECT_LE(result->found->fit.rms_px, 2.0);
  int colored = 0;
  for (const Blob& blob : result->blobs) {
    for (std::size_t i = 0; i < 6; ++i) {
      if ((blob.uv - expected[i]).norm() > 0.5) continue;
      EXPECT_EQ(blob.color, i < 3 ? LedColor::green : LedColor::red);
      ++colored;
    }
  }
  EXPECT_EQ(colored, 6);
}

TEST(RealMasks, PoseFromNearlyEveryOne) {
  if (!std::filesystem::exists(kData / "masks")) GTEST_SKIP() << "no real masks";
  const Rig rig = alan_rig();
  auto detector = BlobDetector::create({}, 848, 480);
  auto finder = LedFinder::create({}, rig.camera, rig.leds);
  ASSERT_TRUE(detector && finder);
  int files = 0, posed = 0, neighbours = 0;
  std::vector<Pose> poses;
  for (int n = 1; n <= 53; n += 2) {
    char name[32];
    std::snprintf(name, sizeof(name), "mask_%02d.png", n);
    const cv::Mat picture =
        cv::imread((kData / "masks" / name).string(), cv::IMREAD_GRAYSCALE);
    if (picture.empty()) continue;
    ++files;
    const auto blobs = detector->detect(view_of(picture));
    ASSERT_TRUE(blobs);
    const auto found = finder->find(*blobs);
    if (found) poses.push_back(found->fit.X_NB);
    if (!found || found->frame.led_count() < 5 || found->fit.rms_px > 2) continue;
    ++posed;
    // The mirrored and swapped poses are turned by more than 20 deg or tilted so.
    const Matrix3 R_NB = found->fit.X_NB.linear();
    EXPECT_LT(std::acos(R_NB(2, 2)) / kDegree, 20) << name;
    EXPECT_LT(std::abs(yaw_of(R_NB)) / kDegree, 20) << name;
    // The LEDs come in the order of the rig from left to right but for the two reds.
    for (std::size_t i = 1; i < found->frame.seen.size(); ++i) {
      EXPECT_GT(found->frame.seen[i].uv.x(), found->frame.seen[i - 1].uv.x()) << name;
    }
  }
  // Neighbours agree; where the recording has a cut (the constellation jumps or
  // changes its size in the picture), in attitude at least.
  for (std::size_t i = 1; i < poses.size(); ++i) {
    EXPECT_LT(angle_between(poses[i].linear(), poses[i - 1].linear()) / kDegree, 20)
        << i;
    const LedImages a = led_images(rig.camera, rig.leds, poses[i - 1]);
    const LedImages b = led_images(rig.camera, rig.leds, poses[i]);
    if ((a.middle - b.middle).norm() > 60 ||
        std::abs(std::log(a.size_px / b.size_px)) > 0.2) {
      continue;
    }
    ++neighbours;
    EXPECT_LT((poses[i].translation() - poses[i - 1].translation()).norm(), 0.15) << i;
  }
  EXPECT_GE(neighbours, 15);
  EXPECT_GE(posed, files - 2);
  EXPECT_EQ(files, 27);
}

}  // namespace
}  // namespace alight
