#include "alight/run/track_run.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "alight/eval/path_error.h"
#include "alight/io/image_io.h"
#include "alight/io/pose_log.h"
#include "alight/sim/camera_renderer.h"

namespace alight {
namespace {

namespace fs = std::filesystem;
constexpr int kFrames = 45;
constexpr double kRate = 60;

/// The drone weaves in front of the camera, 0.8 to 1.5 m from it.
Pose pose_at(double t) {
  const Vector3 p(-0.6 + 0.3 * std::sin(2.0 * t), 0.2 * std::sin(2.6 * t + 0.4),
                  0.35 + 0.1 * std::cos(1.8 * t));
  return make_pose(
      from_rpy(0.1 * std::sin(3 * t), 0.08 * std::cos(2.5 * t), 0.15 * std::sin(t)), p);
}

/// A rendered sequence with depth, written once for all tests.
class TrackRun : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = fs::temp_directory_path() / ("alight_track_" + std::to_string(getpid()));
    fs::remove_all(folder);
    fs::create_directories(folder / "seq");
    CameraSimConfig config;
    config.lights = 20;
    auto renderer = CameraRenderer::create(config, alan_rig(), 7);
    ASSERT_TRUE(renderer) << renderer.error().detail;
    std::ofstream list(folder / "seq/frames.csv");
    list << "t,file,depth_file\n";
    ColorBuffer color;
    DepthBuffer depth;
    for (int i = 0; i < kFrames; ++i) {
      // Times as a clock since 1970 gives them.
      const std::string t = "1700000000." + std::to_string(100000 + i * 16667);
      const double at = i * 0.016667;
      SceneAt scenes[2];
      for (int k = 0; k < 2; ++k) scenes[k].X_NB = pose_at(at + (k - 0.5) * 0.002);
      ASSERT_TRUE(
          renderer->render(static_cast<std::uint64_t>(i), scenes, color, &depth));
      const std::string name = "c" + std::to_string(i) + ".png";
      const std::string depth_name = "d" + std::to_string(i) + ".png";
      ASSERT_TRUE(save_png((folder / "seq" / name).string(), color.view()));
      ASSERT_TRUE(save_png((folder / "seq" / depth_name).string(), depth.view()));
      list << t << "," << name << "," << depth_name << "\n";
      truth.emplace_back(1700000000100000000 + Time{i} * 16667000, pose_at(at));
    }
  }
  static void TearDownTestSuite() {
    fs::remove_all(folder);
    truth.clear();
  }

  static TrackRunOptions options(const std::string& source = "seq") {
    TrackRunOptions result;
    result.rig = alan_rig();
    result.source = (folder / source).string();
    return result;
  }
  /// A list of its own over the pictures of the sequence.
  static TrackRunOptions listed(const std::string& lines) {
    const fs::path own =
        folder / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::create_directories(own);
    std::ofstream(own / "frames.csv") << "t,file\n" << lines;
    TrackRunOptions result = options();
    result.source = own.string();
    return result;
  }
  static void expect_refused(const TrackRunOptions& wrong, const std::string& word) {
    const auto result = run_track(wrong);
    ASSERT_FALSE(result);
    EXPECT_NE(result.error().detail.find(word), std::string::npos)
        << result.error().detail;
    EXPECT_EQ(result.error().detail.find('\n'), std::string::npos);
  }

  static fs::path folder;
  static PoseLog truth;
};
fs::path TrackRun::folder;
PoseLog TrackRun::truth;

TEST_F(TrackRun, FollowsTheDroneThroughRenderedPictures) {
  for (const bool depth : {false, true}) {
    TrackRunOptions with = options();
    with.depth = depth;
    const auto result = run_track(with);
    ASSERT_TRUE(result) << result.error().detail;
    ASSERT_EQ(result->pictures.size(), static_cast<std::size_t>(kFrames));
    EXPECT_GE(result->tracked_share(), 0.99);
    EXPECT_EQ(result->estimate.size(), static_cast<std::size_t>(result->tracked));
    EXPECT_EQ(result->searches, 1);
    EXPECT_LT(result->reprojection_px, 1);
    // The truth in whole, the estimate where it was tracked.
    const auto error = path_error(associate(result->estimate, truth, 1e-4));
    ASSERT_TRUE(error);
    EXPECT_EQ(error->count, result->tracked);
    EXPECT_LT(error->position_rmse_m, 0.02);
    EXPECT_LT(error->rotation_rmse_rad, 2 * kDegree);
  }
}

TEST_F(TrackRun, SamePicturesGiveTheSamePoses) {
  const auto one = run_track(options());
  const auto two = run_track(options());
  ASSERT_TRUE(one && two);
  EXPECT_EQ(tum_text(one->estimate), tum_text(two->estimate));
}

TEST_F(TrackRun, LeavesAFolderThatReadsBack) {
  const auto result = run_track(options());
  ASSERT_TRUE(result);
  const std::string out = (folder / "out").string();
  ASSERT_TRUE(save_track(out, options(), *result));
  const auto estimate = load_tum(out + "/estimate.tum");
  ASSERT_TRUE(estimate) << estimate.error().detail;
  ASSERT_EQ(estimate->size(), result->estimate.size());
  EXPECT_EQ(estimate->front().first, result->estimate.front().first);
  std::ifstream frames(out + "/frames.jsonl");
  std::string line;
  int lines = 0;
  while (std::getline(frames, line)) ++lines;
  EXPECT_EQ(lines, kFrames);
  for (const char* name : {"rig.yaml", "track.png", "result.json"}) {
    EXPECT_TRUE(fs::exists(folder / "out" / name)) << name;
  }
}

TEST_F(TrackRun, AnEmptyRoomIsToldAndNoFailure) {
  const Image dark(848, 480, 3, 4);
  fs::create_directories(folder / "dark");
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(
        save_png((folder / "dark" / std::to_string(i)).string() + ".png", dark.view()));
  }
  const auto result = run_track(options("dark"));
  ASSERT_TRUE(result) << result.error().detail;
  EXPECT_EQ(result->tracked, 0);
  EXPECT_TRUE(result->estimate.empty());
  EXPECT_TRUE(std::isnan(result->reprojection_px));
  EXPECT_NEAR(result->longest_gap, 2 / kRate, 1e-6);
  EXPECT_NE(track_json(options("dark"), *result).find("\"reprojection_px\": null"),
            std::string::npos);
}

TEST_F(TrackRun, RefusesWhatIsNoSequence) {
  const std::string first = "0," + (folder / "seq/c0.png").string() + "\n";
  const std::string second = (folder / "seq/c1.png").string() + "\n";
  expect_refused(listed(first + "0," + second), "frames.csv:3: t must grow");
  expect_refused(listed(first + "-1," + second), "frames.csv:3: t must grow");
  expect_refused(listed(first + "nan," + second), "frames.csv:3: t must be a finite");
  expect_refused(listed(first + "1,absent.png\n"), "frames.csv:3: ");
  expect_refused(listed(""), "lists no pictures");
  fs::create_directories(folder / "empty");
  expect_refused(options("empty"), "holds neither frames.csv nor pictures");
  expect_refused(options("absent"), "no such file or folder");
}

TEST_F(TrackRun, RefusesPicturesOfAnotherSize) {
  fs::create_directories(folder / "small");
  ASSERT_TRUE(save_png((folder / "small/a.png").string(), Image(640, 480, 3).view()));
  expect_refused(options("small"), "a.png: is 640x480");
}

TEST_F(TrackRun, RefusesDepthThatIsNotThere) {
  fs::create_directories(folder / "dull");
  ASSERT_TRUE(save_png((folder / "dull/a.png").string(), Image(848, 480, 3).view()));
  TrackRunOptions wanting = options("dull");
  wanting.depth = true;
  expect_refused(wanting, "depth_file");
}

TEST_F(TrackRun, RefusesARigThatDoesNotHold) {
  TrackRunOptions wrong = options();
  wrong.rig.camera.intrinsics.fx = std::nan("");
  expect_refused(wrong, "fx");
}

}  // namespace
}  // namespace alight
