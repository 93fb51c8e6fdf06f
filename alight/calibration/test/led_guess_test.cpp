#include "alight/calibration/led_guess.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/calibration/test/flight.h"

namespace alight {
namespace {

constexpr int kPictures = 120;

/// LEDs followed through a flight, each by one track. `taken_for` lies: it names
/// neighbours in every second picture.
std::vector<LightTrack> followed(const Rig& truth, double sd_px, Rng& rng) {
  std::vector<LightTrack> tracks(static_cast<std::size_t>(truth.leds.size()));
  for (int f = 0; f < kPictures; ++f) {
    for (int i = 0; i < truth.leds.size(); ++i) {
      const Vector2 uv =
          *project_led(truth.camera, weaving(f / 30.0, 0.7), truth.leds.p_BL(i));
      LightTrack& track = tracks[static_cast<std::size_t>(i)];
      track.color = truth.leds.color(i);
      LightTrack::Sight sight;
      sight.uv = uv + Vector2(rng.normal(0, sd_px), rng.normal(0, sd_px));
      sight.cov = sd_px * sd_px * Matrix2::Identity();
      sight.taken_for = f % 2 == 0 ? i : (i + 1) % truth.leds.size();
      track.seen.push_back(sight);
    }
  }
  return tracks;
}

void without_colors(Constellation& leds) {
  for (Led& led : leds.leds) led.color = LedColor::none;
}

/// One distance has been measured.
LedAdjustmentConfig sized_as(const Rig& truth) {
  LedAdjustmentConfig config;
  config.distances = {{0, 5, (truth.leds.p_BL(0) - truth.leds.p_BL(5)).norm(), 0.0002}};
  return config;
}

/// Largest error of a distance between two LEDs: the shape, whatever its place.
double shape_error(const Constellation& a, const Constellation& b) {
  double most = 0;
  for (int i = 0; i < a.size(); ++i) {
    for (int j = 0; j < i; ++j) {
      most = std::max(most, std::abs((a.p_BL(i) - a.p_BL(j)).norm() -
                                     (b.p_BL(i) - b.p_BL(j)).norm()));
    }
  }
  return most;
}

TEST(LedGuess, ErrorsThatConfuseSinglePicturesDoNotConfuseAFlight) {
  for (const bool colored : {true, false}) {
    int right = 0;
    constexpr int kRigs = 20;
    for (std::uint64_t seed = 1; seed <= kRigs; ++seed) {
      Rng rng(seed);
      Rig truth = drawn_rig(0.006, rng);
      Constellation written = alan_rig().leds;
      if (!colored) {
        without_colors(truth.leds);
        without_colors(written);
      }
      const auto guess = guess_leds(sized_as(truth), truth.camera, written,
                                    followed(truth, 0.05, rng));
      ASSERT_TRUE(guess);
      EXPECT_EQ(guess->lights, 6);
      right += shape_error(guess->leds, truth.leds) < 2e-3 ? 1 : 0;
    }
    // With two LEDs 21 mm apart, 6 mm of error name them the wrong way round in about
    // 1 of 100 rigs, whoever looks.
    EXPECT_GE(right, kRigs - 1) << (colored ? "in colour" : "without colour");
  }
}

TEST(LedGuess, ALightOfAnotherColourIsNone) {
  Rng rng(3);
  const Rig truth = drawn_rig(0.004, rng);
  auto tracks = followed(truth, 0.05, rng);
  LightTrack stray = tracks.front();
  stray.color = LedColor::blue;
  for (auto& sight : stray.seen) sight.uv += Vector2(40, 30);
  tracks.push_back(stray);
  const auto guess =
      guess_leds(LedAdjustmentConfig(), truth.camera, alan_rig().leds, tracks);
  ASSERT_TRUE(guess);
  EXPECT_EQ(guess->lights, 6);
}

// Where no colour tells, a lamp beside the drone is followed as its lights are.
TEST(LedGuess, ALampThatIsFollowedBesideTheDroneIsNone) {
  int right = 0;
  constexpr int kRigs = 3;
  for (std::uint64_t seed = 1; seed <= kRigs; ++seed) {
    Rng rng(seed);
    Rig truth = drawn_rig(0.004, rng);
    Constellation written = alan_rig().leds;
    without_colors(truth.leds);
    without_colors(written);
    auto tracks = followed(truth, 0.05, rng);
    // One LED was not followed; the lamp stands still beside the others.
    LightTrack& lamp = tracks[seed % tracks.size()];
    const Vector2 beside = lamp.seen[0].uv + Vector2(15, 10);
    for (auto& sight : lamp.seen) {
      sight.uv = beside + Vector2(rng.normal(0, 0.05), rng.normal(0, 0.05));
    }
    const auto guess = guess_leds(sized_as(truth), truth.camera, written, tracks);
    if (!guess) continue;
    EXPECT_EQ(guess->lights, 5) << seed;
    ++right;
  }
  EXPECT_GE(right, kRigs - 1);
}

TEST(NamedNearest, GivesExchangedLedsTheirNamesAndLeavesOthersAlone) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Rng rng(seed);
    Constellation written = alan_rig().leds;
    Constellation found = drawn_rig(0.003, rng).leds;
    without_colors(written);
    without_colors(found);
    const Constellation right = named_nearest(found, written);
    // Laid somewhere else, and under other names.
    Constellation moved = found;
    const Pose X = make_pose(from_rpy(0.4, -0.3, 1), Vector3(0.1, 0.2, -0.1));
    for (Led& led : moved.leds) led.p_BL = X * led.p_BL;
    std::swap(moved.leds[2].p_BL, moved.leds[4].p_BL);
    const Constellation named = named_nearest(moved, written);
    for (int i = 0; i < written.size(); ++i) {
      EXPECT_LT((named.p_BL(i) - X * right.p_BL(i)).norm(), 1e-9) << seed;
    }
  }
  // A red one is no green one, wherever they are: those of a colour stay the same.
  Constellation swapped = alan_rig().leds;
  std::swap(swapped.leds[0].p_BL, swapped.leds[5].p_BL);
  const Constellation named = named_nearest(swapped, alan_rig().leds);
  Vector3 before = Vector3::Zero(), after = Vector3::Zero();
  for (int i = 0; i < swapped.size(); ++i) {
    if (swapped.color(i) != LedColor::green) continue;
    before += swapped.p_BL(i);
    after += named.p_BL(i);
  }
  EXPECT_LT((after - before).norm(), 1e-12);
}

TEST(LedGuess, NothingFollowedGivesNone) {
  const Rig rig = alan_rig();
  EXPECT_FALSE(guess_leds(LedAdjustmentConfig(), rig.camera, rig.leds, {}));
  Rng rng(5);
  auto tracks = followed(rig, 0.05, rng);
  for (LightTrack& track : tracks) track.seen.resize(5);
  EXPECT_FALSE(guess_leds(LedAdjustmentConfig(), rig.camera, rig.leds, tracks));
}

}  // namespace
}  // namespace alight
