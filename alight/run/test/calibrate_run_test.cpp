#include "alight/run/calibrate_run.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "alight/base/rng.h"
#include "alight/io/image_io.h"
#include "alight/sim/camera_renderer.h"
#include "alight/vision/led_finder.h"

namespace alight {
namespace {

namespace fs = std::filesystem;

const fs::path kData = fs::path(ALIGHT_SOURCE_DIR) / ".." / "shared" / "data" / "alan";

TEST(CalibrateRealMasks, HeldOutHalfAndTheColourFrameFit) {
  if (!fs::exists(kData / "masks")) GTEST_SKIP() << "no real masks";
  CalibrateFlightOptions options;
  options.rig = alan_rig();
  options.source = (kData / "masks").string();
  options.config.hold_out = 2;
  const auto result = calibrate_flight(options);
  ASSERT_TRUE(result) << result.error().detail;
  EXPECT_EQ(result->pictures, 27);
  EXPECT_EQ(result->fit.frames, 27);
  EXPECT_GT(result->fit.rms_before_px, 1);
  EXPECT_LT(result->fit.rms_held_out_px, 0.3);
  EXPECT_EQ(result->fit.size_from, SizeFrom::prior);

  const auto picture =
      load_image((kData / "frames/led_and_ceiling_lights.png").string());
  ASSERT_TRUE(picture);
  const auto before = detect_once(options.rig, picture->view());
  const auto after = detect_once(result->rig, picture->view());
  ASSERT_TRUE(before && before->found && after && after->found);
  EXPECT_EQ(after->found->frame.led_count(), 6);
  EXPECT_GT(before->found->fit.rms_px, 1.5);
  EXPECT_LT(after->found->fit.rms_px, 0.3);
}

/// Weaves before the camera, 0.5 to 1.4 m from it, and yaws.
Pose pose_at(double t) {
  const double r = 0.95 + 0.45 * std::sin(1.8 * t);
  return make_pose(from_rpy(0.15 * std::sin(3.3 * t), 0.15 * std::cos(2.9 * t),
                            0.45 * std::sin(2.2 * t)),
                   Vector3(0.54 - 0.95 * r, 0.3 * r * std::sin(2.7 * t),
                           0.05 + 0.38 * r + 0.15 * r * std::cos(3.1 * t)));
}

/// A rendered sequence in a folder of its own.
class CalibrateRun : public testing::Test {
 protected:
  void SetUp() override {
    folder = fs::temp_directory_path() /
             ("alight_calibrate_" + std::to_string(getpid()) + "_" +
              testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder);
    fs::create_directories(folder);
  }
  void TearDown() override { fs::remove_all(folder); }

  void render(const Rig& truth, int frames, const std::function<Pose(double)>& pose,
              std::uint64_t seed) {
    CameraSimConfig config;
    config.lights = 20;
    auto renderer = CameraRenderer::create(config, truth, seed);
    ASSERT_TRUE(renderer);
    std::ofstream list(folder / "frames.csv");
    list << "t,file\n";
    ColorBuffer color;
    for (int i = 0; i < frames; ++i) {
      SceneAt scenes[7];
      for (int k = 0; k < 7; ++k) {
        scenes[k].X_NB = pose(i / 30.0 + (k / 6.0 - 0.5) * span_of(truth.timing));
      }
      ASSERT_TRUE(renderer->render(static_cast<std::uint64_t>(i), scenes, color));
      const std::string name = std::to_string(i) + ".png";
      ASSERT_TRUE(save_png((folder / name).string(), color.view()));
      list << i / 30.0 << "," << name << "\n";
    }
  }

  fs::path folder;
};

TEST_F(CalibrateRun, ARenderedFlightGivesTheLeds) {
  for (const std::uint64_t seed : {1u, 2u}) {
    Rng rng(seed);
    Rig truth = alan_rig();
    for (Led& led : truth.leds.leds) {
      for (int k = 0; k < 3; ++k) led.p_BL[k] += rng.uniform(-0.004, 0.004);
    }
    render(truth, 100, pose_at, seed);
    CalibrateFlightOptions options;
    options.rig = alan_rig();
    options.source = folder.string();
    const double known = (truth.leds.p_BL(0) - truth.leds.p_BL(5)).norm();
    options.config.adjustment.distances = {{0, 5, known, 0.0001}};
    const auto result = calibrate_flight(options);
    ASSERT_TRUE(result) << result.error().detail;
    // Distances are the shape, whatever its place.
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < i; ++j) {
        EXPECT_NEAR((result->fit.leds.p_BL(i) - result->fit.leds.p_BL(j)).norm(),
                    (truth.leds.p_BL(i) - truth.leds.p_BL(j)).norm(), 3e-4);
      }
    }
    EXPECT_LT(result->fit.rms_held_out_px, result->fit.rms_before_px / 3);
    EXPECT_EQ(result->rig.leds.color(0), LedColor::green);
    EXPECT_EQ(result->rig.led_frame.shift_sd_m, result->fit.shift_sd_m);
    EXPECT_EQ(result->rig.led_frame.turn_sd_rad, result->fit.turn_sd_rad);
    EXPECT_EQ(result->rig.led_frame.size_sd, result->fit.size_sd);
    EXPECT_FALSE(result->rig.led_frame.exact());
    const auto json = nlohmann::json::parse(calibration_json(options, *result));
    EXPECT_EQ(json["leds"].size(), 6u);
    EXPECT_EQ(json["size_from"], "distances");
  }
}

// Rows are exposed one after the other: what moves is seen bent, which is not its
// shape.
TEST_F(CalibrateRun, AFlightBeforeARollingShutterGivesTheLeds) {
  Rig truth = alan_rig();
  truth.timing.rate_hz = 30;
  truth.timing.readout_ms = 30;
  CalibrateFlightOptions options;
  options.rig = truth;
  Rng rng(4);
  for (Led& led : truth.leds.leds) {
    for (int k = 0; k < 3; ++k) led.p_BL[k] += rng.uniform(-0.003, 0.003);
  }
  render(truth, 100, pose_at, 4);
  options.source = folder.string();
  const double known = (truth.leds.p_BL(0) - truth.leds.p_BL(5)).norm();
  options.config.adjustment.distances = {{0, 5, known, 0.0001}};
  // The same with a rig file that does not say so.
  Rig global = options.rig;
  global.timing.readout_ms = 0;
  double worst[2] = {};
  for (int k = 0; k < 2; ++k) {
    if (k == 1) options.rig = global;
    const auto result = calibrate_flight(options);
    ASSERT_TRUE(result) << result.error().detail;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < i; ++j) {
        worst[k] = std::max(
            worst[k],
            std::abs((result->fit.leds.p_BL(i) - result->fit.leds.p_BL(j)).norm() -
                     (truth.leds.p_BL(i) - truth.leds.p_BL(j)).norm()));
      }
    }
  }
  EXPECT_LT(worst[0], 3e-4);
  EXPECT_GT(worst[1], 2 * worst[0]);
}

TEST_F(CalibrateRun, AParkedDroneGivesTheMount) {
  Rig truth = alan_rig();
  truth.camera.X_NC = make_pose(
      from_rpy(0, 0, 0.03) * truth.camera.X_NC.linear() * from_rpy(0.03, 0.02, 0),
      truth.camera.X_NC.translation() + Vector3(0.01, -0.01, 0.004));
  const Pose parked = make_pose(Matrix3::Identity(), Vector3(0, 0, 0.06));
  render(
      truth, 12, [&](double) { return parked; }, 5);
  CalibrateMountOptions options;
  options.rig = alan_rig();
  options.sources = {folder.string()};
  const auto result = calibrate_mount(options);
  ASSERT_TRUE(result) << result.error().detail;
  const Vector3 dp =
      result->rig.camera.X_NC.translation() - truth.camera.X_NC.translation();
  for (int k = 0; k < 3; ++k) {
    EXPECT_LT(std::abs(dp[k]), 3 * result->fit.position_sd_m[k]);
  }
  EXPECT_LT(result->fit.off_m, 0.25 * result->fit.off_before_m);
}

TEST_F(CalibrateRun, SaysWhatIsMissing) {
  render(alan_rig(), 8, pose_at, 3);
  CalibrateFlightOptions options;
  options.rig = alan_rig();
  options.source = folder.string();
  const auto few = calibrate_flight(options);
  ASSERT_FALSE(few);
  EXPECT_NE(few.error().detail.find("are needed: record"), std::string::npos)
      << few.error().detail;
  options.config.adjustment.use_depth = true;
  const auto no_depth = calibrate_flight(options);
  ASSERT_FALSE(no_depth);
  EXPECT_NE(no_depth.error().detail.find("depth_file"), std::string::npos);

  CalibrateLensOptions lens;
  lens.rig = alan_rig();
  lens.source = folder.string();
  const auto no_board = calibrate_lens(lens);
  ASSERT_FALSE(no_board);
  EXPECT_NE(no_board.error().detail.find("only 0 pictures show the whole board"),
            std::string::npos);

  CalibrateMountOptions mount;
  mount.rig = alan_rig();
  mount.sources = {folder.string()};
  mount.headings_deg = {0, 30};
  EXPECT_FALSE(calibrate_mount(mount));
}

}  // namespace
}  // namespace alight
