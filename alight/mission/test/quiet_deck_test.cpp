#include "alight/mission/quiet_deck.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/mission/test/sinking_landing.h"
#include "alight/platform/deck_motion.h"

namespace alight {
namespace {

constexpr Seconds kStep = 0.01;

/// A landing that sinks straight down at 0.25 m/s from half a metre above the gear's
/// height, over a deck that leans.
class QuietDeckTest : public ::testing::Test {
 protected:
  QuietDeckTest() : quiet_(config_, rig_) {
    maneuver_ =
        Maneuver::landing(sinking_landing(rig_.drone.gear_height_m), 0, config_.sink_m);
    quiet_.begin();
  }

  MissionInput at(Seconds t, double lean_deg, double swing = 1) const {
    MissionInput in;
    in.now = from_seconds(t);
    in.estimate_valid = true;
    in.x.p_NB = maneuver_.at(in.now).p_NB;
    in.f_end_N = kGravity * Vector3(0, std::tan(lean_deg * kDegree), 1);
    in.deck_swing = swing;
    return in;
  }
  /// A step as the mission takes it.
  bool waits(const MissionInput& in, double miss = 0, bool may_stop = true) {
    const bool waits = quiet_.waits(in, maneuver_, miss, may_stop);
    maneuver_.aim_pace(in.now, waits ? 0 : 1);
    return waits;
  }

  MissionConfig config_;
  Rig rig_ = alan_rig();
  QuietDeck quiet_;
  Maneuver maneuver_;
};

TEST_F(QuietDeckTest, OnlyADeckThatSwingsIsWaitedFor) {
  EXPECT_TRUE(quiet_.swings(at(1, 10, 1.0)));
  EXPECT_FALSE(quiet_.swings(at(1, 10, 0.1)));
  config_.quiet_deg = 0;
  EXPECT_FALSE(QuietDeck(config_, rig_).swings(at(1, 10, 1.0)));
}

TEST_F(QuietDeckTest, GoesOnWhenTheDeckWillBeLevelAndItWillBeInTheMiddle) {
  EXPECT_TRUE(waits(at(1, 8)));
  EXPECT_TRUE(waits(at(1.1, -8)));
  EXPECT_TRUE(waits(at(1.2, 0), 0.08));
  EXPECT_FALSE(waits(at(1.3, 1), 0.01));
}

TEST_F(QuietDeckTest, BelowTheHeightAtWhichItCanStopItGoesOn) {
  EXPECT_FALSE(waits(at(1, 8), 0, false));
  EXPECT_TRUE(waits(at(1.01, 8), 0, true));
  // What waits already has stopped.
  EXPECT_TRUE(waits(at(1.02, 8), 0, false));
}

TEST_F(QuietDeckTest, StopsAgainOnlyForWhatHasBecomeMuchWorse) {
  for (Seconds t = 1; t < 1.5; t += kStep) waits(at(t, 8));
  for (Seconds t = 1.5; t < 1.7; t += kStep) EXPECT_FALSE(waits(at(t, 2)));
  EXPECT_FALSE(waits(at(1.7, config_.quiet_deg + 1)));
  EXPECT_TRUE(waits(at(1.71, config_.quiet_deg + 4)));
}

TEST_F(QuietDeckTest, TheLongerItHasWaitedTheLessItAsksFor) {
  Seconds t = 1;
  const double lean = 1.8 * config_.quiet_deg;
  while (waits(at(t, lean)) && t < 60) t += kStep;
  // By then 1.8 times as much is borne.
  EXPECT_NEAR(t - 1, 0.8 * config_.quiet_more_s, 0.5);
}

TEST_F(QuietDeckTest, KnowsWhenItWillTouch) {
  EXPECT_NEAR(quiet_.touches_in(at(0.5, 0), maneuver_), DeckMotion::kFarthest, 1e-9);
  EXPECT_NEAR(quiet_.touches_in(at(1.2, 0), maneuver_), 0.8, 1e-6);
  EXPECT_NEAR(quiet_.touches_in(at(1.9, 0), maneuver_), kTouchAhead, 1e-9);
}

}  // namespace
}  // namespace alight
