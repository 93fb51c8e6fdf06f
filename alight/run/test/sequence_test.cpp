#include "alight/run/sequence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "alight/io/files.h"
#include "alight/io/image_source.h"
#include "alight/io/rig_yaml.h"
#include "alight/run/frame_tracker.h"
#include "alight/run/sequence_score.h"

namespace alight {
namespace {

SequenceOptions few_frames(std::uint64_t seed) {
  SequenceOptions options;
  options.rig = alan_rig();
  options.seed = seed;
  options.frames = 4;
  options.path.close_share = 0;
  return options;
}

Sequence make(const SequenceOptions& options) {
  auto sequence = Sequence::create(options);
  EXPECT_TRUE(sequence) << sequence.error().detail;
  return std::move(*sequence);
}

ColorBuffer picture(Sequence& sequence, int k) {
  ColorBuffer color;
  EXPECT_TRUE(sequence.render(k, color));
  return color;
}

/// Brightest channel within 2 px.
int brightest_near(const ColorBuffer& color, const Vector2& uv) {
  int best = 0;
  for (int dv = -2; dv <= 2; ++dv) {
    for (int du = -2; du <= 2; ++du) {
      const int u = static_cast<int>(std::lround(uv.x())) + du;
      const int v = static_cast<int>(std::lround(uv.y())) + dv;
      const std::uint8_t* pixel = color.view().row(v) + 3 * u;
      best = std::max({best, int{pixel[0]}, int{pixel[1]}, int{pixel[2]}});
    }
  }
  return best;
}

Vector2 image_of(const Sequence& sequence, int k, int led) {
  const Rig& rig = sequence.true_rig();
  return *project_led(rig.camera, sequence.truth(k).X_NB(), rig.leds.p_BL(led));
}

std::string scratch(const std::string& name) {
  return (std::filesystem::temp_directory_path() / ("alight_sequence_test_" + name))
      .string();
}

class SequenceLaw : public testing::TestWithParam<std::uint64_t> {};

TEST_P(SequenceLaw, SameOptionsGiveTheSameBitsInAnyOrder) {
  for (const SequenceKind kind : {SequenceKind::clean, SequenceKind::hard}) {
    SequenceOptions options = few_frames(GetParam());
    options.kind = kind;
    options.strays = 20;
    Sequence forward = make(options), backward = make(options);
    std::vector<ColorBuffer> pictures;
    for (int k = 0; k < forward.frames(); ++k) pictures.push_back(picture(forward, k));
    for (int k = backward.frames() - 1; k >= 0; --k) {
      EXPECT_EQ(picture(backward, k).pixels(),
                pictures[static_cast<std::size_t>(k)].pixels());
    }
    EXPECT_NE(pictures[0].pixels(), pictures[1].pixels());
  }
}

TEST_P(SequenceLaw, LedsShineWhereTheTruthSaysAndDeadOnesDoNot) {
  SequenceOptions options = few_frames(GetParam());
  options.lights = 0;
  options.path.range_max_m = 1.5;  // no LED near another's image
  options.path.speed_m_s = 1;
  const int leds = options.rig.leds.size();
  for (int dead = 0; dead < leds; dead += 2) {
    options.dead = {dead};
    Sequence sequence = make(options);
    const ColorBuffer color = picture(sequence, 1);
    for (int i = 0; i < leds; ++i) {
      const Vector2 at = image_of(sequence, 1, i);
      double apart = 1e9;
      for (int j = 0; j < leds; ++j) {
        if (j != i) apart = std::min(apart, (image_of(sequence, 1, j) - at).norm());
      }
      if (apart < 14) continue;  // the other's halo reaches over
      if (i == dead) {
        EXPECT_LT(brightest_near(color, at), 30) << "LED " << i;
      } else {
        EXPECT_GT(brightest_near(color, at), 60) << "LED " << i;
      }
    }
  }
}

TEST_P(SequenceLaw, ABlackoutDarkensItsFramesAndNoOthers) {
  SequenceOptions options = few_frames(GetParam());
  options.lights = 0;
  Sequence lit = make(options);
  options.dark_from = 0.9 / 60;
  options.dark_to = 2.1 / 60;
  Sequence dark = make(options);
  for (int k = 0; k < options.frames; ++k) {
    const ColorBuffer color = picture(dark, k);
    if (k == 1 || k == 2) {
      EXPECT_LT(*std::max_element(color.pixels().begin(), color.pixels().end()), 20);
    } else {
      EXPECT_EQ(color.pixels(), picture(lit, k).pixels());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, SequenceLaw, testing::Values(1, 2, 3));

TEST(Sequence, LedErrorsHaveTheSpreadAskedFor) {
  SequenceOptions options = few_frames(0);
  options.led_error_mm = 2;
  double sum = 0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 15; ++seed) {
    options.seed = seed;
    const Rig truth = make(options).true_rig();
    for (int i = 0; i < truth.leds.size(); ++i) {
      sum += (truth.leds.p_BL(i) - options.rig.leds.p_BL(i)).squaredNorm();
      count += 3;
    }
    EXPECT_TRUE(truth.camera.X_NC.isApprox(options.rig.camera.X_NC, 1e-12));
    EXPECT_EQ(truth.camera.intrinsics.fx, options.rig.camera.intrinsics.fx);
  }
  // 270 draws: the sd of the estimate is 4.3 %.
  EXPECT_NEAR(std::sqrt(sum / count), 2e-3, 4 * 0.043 * 2e-3);
}

TEST(Sequence, StraysAreInThePicture) {
  SequenceOptions options = few_frames(5);
  options.lights = 0;
  Sequence without = make(options);
  options.strays = 50;
  Sequence with = make(options);
  const ColorBuffer a = picture(without, 0), b = picture(with, 0);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < a.pixels().size(); ++i) {
    if (b.pixels()[i] > a.pixels()[i] + 20) ++changed;
  }
  EXPECT_GT(changed, 50u);
}

class SavedSequence : public testing::TestWithParam<SequenceKind> {};

TEST_P(SavedSequence, ReadsBackAsItWasInMemory) {
  SequenceOptions options = few_frames(7);
  options.kind = GetParam();
  options.led_error_mm = 2;
  const std::string folder = scratch(to_string(GetParam()));
  ASSERT_TRUE(save_sequence(folder, options));
  Sequence sequence = make(options);
  const auto rig = load_rig(folder + "/rig.yaml");
  const auto true_rig = load_rig(folder + "/rig_true.yaml");
  ASSERT_TRUE(rig && true_rig);
  EXPECT_LT((true_rig->leds.p_BL(3) - sequence.true_rig().leds.p_BL(3)).norm(), 1e-9);
  auto source = ImageSource::open(folder, *rig);
  ASSERT_TRUE(source) << source.error().detail;
  SourceFrame frame;
  for (int k = 0; k < options.frames; ++k) {
    const auto more = source->next(frame);
    ASSERT_TRUE(more && *more);
    EXPECT_EQ(frame.t, sequence.time(k));
    EXPECT_TRUE(std::ranges::equal(frame.color.data, picture(sequence, k).pixels()));
  }
  std::filesystem::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(Kinds, SavedSequence,
                         testing::Values(SequenceKind::clean, SequenceKind::hard),
                         [](const auto& kind) { return to_string(kind.param); });

/// Delay of what is estimated against the picture's time, s, by least squares, and the
/// mean NEES of the pose.
std::pair<double, double> delay_and_nees(const Rig& flies, const Rig& told,
                                         std::uint64_t seed) {
  SequenceOptions options = few_frames(seed);
  options.rig = flies;
  options.frames = 150;
  Sequence sequence = make(options);
  auto tracker = FrameTracker::create({}, told).value();
  double along = 0, square = 0, nees = 0;
  int frames = 0;
  for (int k = 0; k < options.frames; ++k) {
    const ColorBuffer color = picture(sequence, k);
    CameraFrame frame;
    frame.captured = frame.received = sequence.time(k);
    frame.color = color.view();
    FrameReport report;
    tracker.fuse(frame, report);
    if (!report.tracked || k < 30) continue;
    const RelativeState truth = sequence.truth(k);
    along += (report.x.p_NB - truth.p_NB).dot(truth.v_NB);
    square += truth.v_NB.squaredNorm();
    nees += score_frame(report, truth, flies.camera.X_NC.translation()).nees_pose;
    ++frames;
  }
  EXPECT_GT(frames, 110);
  return {along / square, nees / frames};
}

// A rolling shutter that is not told of has the drone where it was, or will be, by up
// to half the readout. Told of, it is where the picture's time says.
TEST(Sequence, ARollingShutterIsNoDelay) {
  Rig rolling = alan_rig();
  rolling.timing.readout_ms = 16;
  Rig global = rolling;
  global.timing.readout_ms = 0;
  double told_worst = 0, untold_worst = 0, nees = 0;
  constexpr int kSeeds = 6;
  for (std::uint64_t seed = 21; seed < 21 + kSeeds; ++seed) {
    const auto told = delay_and_nees(rolling, rolling, seed);
    const auto untold = delay_and_nees(rolling, global, seed);
    told_worst = std::max(told_worst, std::abs(told.first));
    untold_worst = std::max(untold_worst, std::abs(untold.first));
    nees += told.second / kSeeds;
  }
  EXPECT_LT(told_worst, 0.6e-3);
  EXPECT_GT(untold_worst, 1.5e-3);
  EXPECT_LT(nees, 12);
}

TEST(Sequence, NamesWhatIsOutOfRange) {
  SequenceOptions options = few_frames(1);
  options.dead = {6};
  auto sequence = Sequence::create(options);
  ASSERT_FALSE(sequence);
  EXPECT_NE(sequence.error().detail.find("LED 6"), std::string::npos);
  options = few_frames(1);
  options.frames = 0;
  sequence = Sequence::create(options);
  ASSERT_FALSE(sequence);
  EXPECT_NE(sequence.error().detail.find("frames"), std::string::npos);
}

}  // namespace
}  // namespace alight
