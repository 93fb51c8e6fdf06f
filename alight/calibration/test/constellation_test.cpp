#include "alight/calibration/constellation.h"

#include <gtest/gtest.h>

#include "flight.h"

namespace alight {
namespace {

void expect_refused(const Result<ConstellationFit>& fit, Fault fault,
                    const std::string& word) {
  ASSERT_FALSE(fit);
  EXPECT_EQ(fit.error().fault, fault);
  EXPECT_NE(fit.error().detail.find(word), std::string::npos) << fit.error().detail;
  EXPECT_EQ(fit.error().detail.find('\n'), std::string::npos);
}

TEST(Constellation, HeldOutPicturesFitAsWellAsTheOthers) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    Rng rng(seed);
    const Rig truth = drawn_rig(0.003, rng);
    const auto frames = flown(truth, 60, 0.15, rng);
    const Constellation written = alan_rig().leds;
    const auto fit =
        calibrate_constellation({}, truth.camera, written, written, frames);
    ASSERT_TRUE(fit) << fit.error().detail;
    EXPECT_GT(fit->rms_before_px, 2 * fit->rms_px);
    EXPECT_LT(fit->rms_held_out_px, 1.3 * fit->rms_px);
    EXPECT_EQ(fit->size_from, SizeFrom::prior);
    EXPECT_EQ(fit->frames + fit->frames_dropped, 60);
    EXPECT_EQ(fit->frames_held_out, 12);
  }
}

TEST(Constellation, SaysWhatIsWeak) {
  Rng rng(1);
  const Rig rig = alan_rig();
  const auto refused = [&](const std::vector<ObservedFrame>& frames,
                           const ConstellationConfig& config, Fault fault,
                           const std::string& word) {
    expect_refused(
        calibrate_constellation(config, rig.camera, rig.leds, rig.leds, frames), fault,
        word);
  };
  const auto good = flown(rig, 60, 0.1, rng);
  refused({}, {}, Fault::too_few_points, "only 0 pictures");
  refused({good.begin(), good.begin() + 5}, {}, Fault::too_few_points,
          "only 5 pictures");

  // LEDs 1 and 2 always run together.
  auto merged = good;
  for (auto& frame : merged) {
    frame.seen[1].leds = 6;
    frame.seen[1].uv = (frame.seen[1].uv + frame.seen[2].uv) / 2;
    frame.seen.erase(2);
  }
  refused(merged, {}, Fault::too_few_points, "LED 1 is seen by itself in 0 pictures");
  refused(merged, {}, Fault::too_few_points, "with LED 2");

  // One aspect, from afar.
  std::vector<ObservedFrame> same;
  for (int f = 0; f < 40; ++f) {
    ObservedFrame frame;
    frame.X_NB = make_pose(Matrix3::Identity(), Vector3(-2, 0.01 * f, 0.6));
    for (int i = 0; i < 6; ++i) {
      LedObservation o;
      o.leds = static_cast<std::uint16_t>(1u << i);
      o.uv = *project_led(rig.camera, frame.X_NB, rig.leds.p_BL(i)) +
             Vector2(rng.normal(0, 0.3), rng.normal(0, 0.3));
      o.cov = 0.01 * Matrix2::Identity();
      frame.seen.push_back(o);
    }
    same.push_back(frame);
  }
  ConstellationConfig scaled;  // else its size is what is most uncertain
  scaled.adjustment.distances = {
      {0, 5, (rig.leds.p_BL(0) - rig.leds.p_BL(5)).norm(), 0.0002}};
  refused(same, scaled, Fault::degenerate, "yaw the drone");
}

TEST(Constellation, DistancesMustBeOfTheRig) {
  Rng rng(1);
  const Rig rig = alan_rig();
  const auto frames = flown(rig, 30, 0.1, rng);
  const auto with = [&](LedDistance d) {
    ConstellationConfig config;
    config.adjustment.distances = {d};
    return calibrate_constellation(config, rig.camera, rig.leds, rig.leds, frames);
  };
  EXPECT_TRUE(with({0, 5, 0.152, 0.001}));
  expect_refused(with({0, 6, 0.15, 0.001}), Fault::invalid_config, "0 to 5");
  expect_refused(with({3, 3, 0.15, 0.001}), Fault::invalid_config, "different");
  expect_refused(with({0, 5, 152, 0.001}), Fault::invalid_config, "metres?");
}

}  // namespace
}  // namespace alight
