#include "alight/mission/touch_down.h"

#include <gtest/gtest.h>

#include "alight/mission/test/sinking_landing.h"

namespace alight {
namespace {

constexpr Seconds kStep = 0.01;

/// A landing that ends at rest over the pad's middle, sinking at 0.25 m/s.
class TouchDownTest : public ::testing::Test {
 protected:
  TouchDownTest() : touch_(config_, rig_) {
    maneuver_ = Maneuver::landing(sinking_landing(gear()), 0, config_.sink_m);
    touch_.begin();
  }

  double gear() const { return rig_.drone.gear_height_m; }

  MissionInput at(Seconds t, double above_gear, double tilt = 0,
                  double push = 0) const {
    MissionInput in;
    in.now = from_seconds(t);
    in.seen = in.now;
    in.estimate_valid = true;
    in.x.p_NB.z() = gear() + above_gear;
    in.x.v_NB.z() = -0.25;
    in.x.R_NB = so3_exp(Vector3(0, tilt, 0));
    in.x_seen = in.x;
    in.z_acted = in.x.p_NB.z() - 0.25 * 0.1;
    in.f_touch_N = Vector3(push, 0, kGravity);
    in.link = &link_;
    return in;
  }

  /// The feet take the weight at 2 s; then it moves by `v_N` until `rests`, and leans
  /// by `tilt`. When it is known to stand.
  Seconds stands_at(const Vector3& v_N, Seconds rests, double tilt = 0,
                    Seconds acts_in = 0, Time heard = from_seconds(1000)) {
    TouchDown touch(config_, rig_);
    touch.begin();
    link_ = LinkMonitor();
    link_.heard(heard);
    for (Seconds t = 2; t < 4; t += kStep) {
      MissionInput in = at(t, 0.0, tilt);
      in.acts_in = acts_in;
      in.x.v_NB.setZero();
      in.x_seen.p_NB += std::min(t - 2, rests) * v_N;
      touch.feel(in, maneuver_);
      if (touch.stands(in)) return t;
    }
    return 4;
  }

  /// How high above its feet's height a drone sinking by the plan is when thrust goes.
  double drops_at(double push) {
    TouchDown touch(config_, rig_);
    touch.begin();
    for (Seconds t = 1.5; t < 3; t += kStep) {
      const double above = 0.25 * (2 - t);
      touch.feel(at(t, above, 0, push), maneuver_);
      if (touch.settling()) return above;
    }
    return -1;
  }

  MissionConfig config_;
  Rig rig_ = alan_rig();
  TouchDown touch_;
  Maneuver maneuver_;
  LinkMonitor link_;
};

TEST_F(TouchDownTest, KeepsItsThrustUntilTheFeetAreNearThePad) {
  touch_.feel(at(1.5, 0.125), maneuver_);
  EXPECT_FALSE(touch_.settling());
  touch_.feel(at(2, 0.0), maneuver_);
  EXPECT_TRUE(touch_.settling());
}

// A gust had a drone stand on its feet 0.4 s before its reference; at nearly full
// thrust it slid off the pad.
TEST_F(TouchDownTest, WhatNoLongerSinksIsCarriedThoughItsReferenceIsStillHigh) {
  const auto settles_after = [&](double above, double sink) {
    TouchDown touch(config_, rig_);
    touch.begin();
    for (Seconds t = 1.2; t < 1.45; t += kStep) {
      MissionInput in = at(t, above - sink * (t - 1.2));
      in.x.v_NB.z() = -sink;
      in.z_acted = in.x.p_NB.z() + 0.01;
      touch.feel(in, maneuver_);
      if (touch.settling()) return t - 1.2;
    }
    return 1.0;
  };
  EXPECT_NEAR(settles_after(0.006, 0), 0.08, 1.5 * kStep);
  EXPECT_EQ(settles_after(0.02, 0), 1.0);
  EXPECT_EQ(settles_after(0.011, 0.1), 1.0);
}

TEST_F(TouchDownTest, GoesOverToThePadsAttitudeLast) {
  EXPECT_EQ(touch_.square_up(at(2, 0.1), 0.01), 0);
  double last = 0;
  for (double above = 0.2; above > -0.01; above -= 0.005) {
    const double share = touch_.square_up(at(2, above), 0.01);
    EXPECT_GE(share, last);
    last = share;
  }
  EXPECT_EQ(last, 1);
  MissionInput unseen_now = at(2, 0.02);
  unseen_now.seen = 0;
  EXPECT_EQ(touch_.square_up(unseen_now, 0.01), 0);
  // What drifts off the pad is brought back first, whatever becomes of it meanwhile.
  touch_.begin();
  EXPECT_EQ(touch_.square_up(at(2, 0.05), 0.2), 0);
  EXPECT_EQ(touch_.square_up(at(2, 0.02), 0.01), 0);
  config_.square_up_s = 0;
  EXPECT_EQ(TouchDown(config_, rig_).square_up(at(2, 0.02), 0.01), 0);
}

TEST_F(TouchDownTest, DropsSoonerTheHarderItIsBlown) {
  const double calm = drops_at(0), windy = drops_at(2), stormy = drops_at(4);
  EXPECT_GE(windy, calm);
  EXPECT_GT(stormy, calm);
  // When what is sent then acts, 0.1 s later, no higher than a harmless fall.
  EXPECT_LT(stormy - 0.025, 0.0051 + 0.25 * kStep);
}

TEST_F(TouchDownTest, ThrustGoesEvenlyToWhatStillKeepsItUpright) {
  touch_.feel(at(2, 0.0), maneuver_);
  double last = 1;
  for (Seconds t = 2; t < 2.5; t += kStep) {
    const double share = touch_.thrust_share(from_seconds(t));
    EXPECT_LE(share, last);
    last = share;
  }
  EXPECT_NEAR(last, 0.15, 0.05);
}

TEST_F(TouchDownTest, ATiltedDroneDoesNotStandYetButNotForEver) {
  const Seconds level = stands_at(Vector3::Zero(), 0);
  const Seconds tilted = stands_at(Vector3::Zero(), 0, 15 * kDegree);
  EXPECT_NEAR(level, 2 + config_.touch_settled_s, 1.5 * kStep);
  EXPECT_GT(tilted, level + 0.1);
  EXPECT_LT(tilted, 2 + config_.settle_down_s + 0.3);
}

// Motors that stop while it slides have its feet trip it.
TEST_F(TouchDownTest, ADroneThatSlidesDoesNotStandUntilItRestsButNotForEver) {
  const Vector3 v_N(-0.4, 0, 0);
  EXPECT_NEAR(stands_at(v_N, 0.3), 2.3 + config_.touch_settled_s, 2.5 * kStep);
  const Seconds always = stands_at(v_N, 10);
  EXPECT_GT(always, 2.5);
  EXPECT_LT(always, 2.7);
  EXPECT_LT(stands_at(Vector3(0.05, 0, 0), 10), 2.2) << "no faster than feet forgive";
}

// The radio lost 0.15 s of set-points: held up by the thrust that was to go it did not
// sink, and motors that stopped only then found it sliding at 0.4 m/s.
TEST_F(TouchDownTest, WhatItsThrustMayStillHoldUpDoesNotStand) {
  const Seconds soon = stands_at(Vector3::Zero(), 0);
  EXPECT_NEAR(stands_at(Vector3::Zero(), 0, 0, 0.1), soon + 0.1, 1.5 * kStep);
  const Seconds deaf = stands_at(Vector3::Zero(), 0, 0, 0, from_seconds(1.9));
  EXPECT_GT(deaf, soon + 0.3);
  EXPECT_LT(deaf, 2.7);
}

// Set-points that end its thrust were not heard: heard again it still has that.
TEST_F(TouchDownTest, WhatWasNotHeardAndSlidesOffHadBetterFly) {
  struct Case {
    Seconds silent;
    double v;  // m/s
    bool seen, flies;
  };
  for (const Case& c : {Case{0.28, 0.5, true, true}, Case{0.28, 0.1, true, false},
                        Case{0.28, 0.5, false, false}, Case{0.05, 0.5, true, false}}) {
    SCOPED_TRACE(testing::Message() << c.silent << " s, " << c.v << " m/s");
    TouchDown touch(config_, rig_);
    touch.begin();
    link_ = LinkMonitor();
    int flies = 0;
    for (Seconds t = 2; t < 2.6; t += kStep) {
      const bool silent = t >= 2 + kStep && t < 2 + c.silent;
      if (!silent) link_.heard(from_seconds(t));
      MissionInput in = at(t, 0.005);
      in.acts_in = 0.08;
      in.x_seen.p_NB.x() = std::min(c.v * (t - 2), 0.15);
      in.x_seen.v_NB = Vector3(c.v, 0, 0);
      if (!c.seen) in.seen = from_seconds(2);
      touch.feel(in, maneuver_);
      const bool now = touch.slides_off(in);
      EXPECT_TRUE(!now || (!silent && t < 2 + c.silent + 0.06)) << t;
      flies += now;
    }
    ASSERT_TRUE(touch.settling());
    EXPECT_EQ(flies > 0, c.flies);
  }
}

// Nor was anything sent by a computer that stood still.
TEST_F(TouchDownTest, WhatSlidesOffAsTheComputerRunsAgainHadBetterFly) {
  for (const Seconds ago : {0.0, 0.03, 0.2, 2.0}) {
    SCOPED_TRACE(ago);
    TouchDown touch(config_, rig_);
    touch.begin();
    link_.heard(from_seconds(2));
    MissionInput in = at(2, 0.005);
    in.woke = in.now - from_seconds(ago);
    in.x_seen.p_NB.x() = 0.2;
    in.x_seen.v_NB = Vector3(0.5, 0, 0);
    touch.feel(in, maneuver_);
    ASSERT_TRUE(touch.settling());
    EXPECT_EQ(touch.slides_off(in), ago < 0.05);
  }
}

TEST_F(TouchDownTest, UnseenItSettlesByPredictionOnly) {
  MissionInput in = at(2.1, 0.0);
  in.seen = in.now - from_seconds(1);
  touch_.feel(in, maneuver_);
  EXPECT_FALSE(touch_.settling());
  in.now = from_seconds(2 + config_.blind_sink_s + 0.05);
  touch_.feel(in, maneuver_);
  EXPECT_TRUE(touch_.settling());
}

TEST_F(TouchDownTest, ABounceAndASlideAreToldOnce) {
  touch_.feel(at(2, 0.0), maneuver_);
  EXPECT_EQ(touch_.moved(at(2.01, 0.0)), nullptr);
  EXPECT_STREQ(touch_.moved(at(2.1, 0.04)), "it bounced");
  EXPECT_EQ(touch_.moved(at(2.11, 0.04)), nullptr);
  MissionInput in = at(2.2, 0.0);
  in.x_seen.p_NB.x() = 0.05;
  EXPECT_STREQ(touch_.moved(in), "it slides on the pad");
  EXPECT_EQ(touch_.moved(in), nullptr);
  EXPECT_STREQ(touch_.how_it_stands(in), "motors stopped, after a slide");
  in.x_seen.p_NB.x() = rig_.pad.size_m / 2 - 0.9 * touch_.foot_spread();
  EXPECT_STREQ(touch_.how_it_stands(in), "motors stopped, a foot over the pad's edge");
  in.x_seen.p_NB.x() = rig_.pad.size_m / 2 - 1.1 * touch_.foot_spread();
  EXPECT_STREQ(touch_.how_it_stands(in), "motors stopped, after a slide");
  in.x_seen.p_NB.x() = rig_.pad.size_m;
  EXPECT_STREQ(touch_.how_it_stands(in), "motors stopped, not on the pad");
}

TEST_F(TouchDownTest, TheFlareWaitsForADroneThatIsLateAndNeverJumps) {
  Seconds was = 0;
  for (Seconds t = 0.5; t < 1.8; t += kStep) {
    touch_.flare(at(t, 0.25 * (2 - t) + 0.04, 0, 2), maneuver_);
    EXPECT_LT(std::abs(maneuver_.flare_delay() - was), 0.8 * kStep + 1e-6) << t;
    was = maneuver_.flare_delay();
  }
  EXPECT_NEAR(was, 0.04 / 0.25, 0.03);
}

// Pressed down by a gust it was held up for its reference, 4 cm above the pad, which
// then sank past it: upright too soon it was blown off.
TEST_F(TouchDownTest, WhatHangsAboveThePadWhileItsReferenceSinksIsNotUprightYet) {
  double square = 0;
  for (Seconds t = 0.5; t < 1.84; t += kStep) {
    const bool hangs = t > 1.4;
    MissionInput in = at(t, hangs ? 0.05 : 0.25 * (2 - t), 0, 2);
    if (hangs) in.x.v_NB.z() = 0;
    touch_.flare(in, maneuver_);
    square = std::max(square, touch_.square_up(in, 0));
  }
  EXPECT_GT(maneuver_.flare_delay(), 0.15);
  EXPECT_EQ(square, 0);
}

// On a deck that swings the force at the touch is known only when it is about to come.
TEST_F(TouchDownTest, AFlareIsAimedAnewWhileItWaitsEvenLow) {
  for (Seconds t = 0.5; t < 1.8; t += kStep) {
    touch_.flare(at(t, 0.25 * (2 - t), 0, 2), maneuver_);
  }
  maneuver_.aim_pace(from_seconds(1.7), 0);
  for (Seconds t = 1.8; t < 4; t += kStep) {
    MissionInput in = at(t, 0.06, 0, -1);
    in.x.v_NB.z() = 0;
    touch_.flare(in, maneuver_);
  }
  maneuver_.aim_pace(from_seconds(4), 1);
  // What comes once it has gone on is too late.
  for (Seconds t = 4.15; t < 4.3; t += kStep) {
    MissionInput in = at(t, 0.05, 0, 2);
    in.x.v_NB.z() = maneuver_.at(in.now).v_NB.z();
    touch_.flare(in, maneuver_);
  }
  const Time end = from_seconds(4.3 - maneuver_.past_end(from_seconds(4.3)) +
                                maneuver_.flare_delay());
  EXPECT_NEAR(maneuver_.at(end - 1'000'000).a_NB.x(), config_.flare_share, 0.15);
}

// At 30 km/h the air slid every drone 3 cm aft as its rotors ran down, one off the pad.
TEST_F(TouchDownTest, ItTouchesAheadOfTheMiddleByWhatAStrongPushWillSlideIt) {
  const auto touches_at = [&](double push) {
    touch_.begin();
    maneuver_.end_with({});
    for (Seconds t = 0.3; t < 1.9; t += kStep) {
      touch_.flare(at(t, 0.25 * (2 - t), 0, push), maneuver_);
    }
    // Beyond the end the flare is over, but for where it has led.
    return maneuver_.at(from_seconds(2.6)).p_NB.x();
  };
  EXPECT_EQ(touches_at(0.8), 0);
  EXPECT_NEAR(touches_at(3.5), 0.03, 0.002);
  EXPECT_NEAR(touches_at(-3.5), -0.03, 0.002);
  EXPECT_LE(touches_at(30), 0.05);
}

TEST_F(TouchDownTest, TheLastThrustLeansAgainstWhatWouldThrowItOver) {
  touch_.feel(at(2, 0.0, 0, 3), maneuver_);
  ASSERT_TRUE(touch_.settling());
  EXPECT_EQ(touch_.leans_against_N(), Vector3(3, 0, kGravity));
}

TEST_F(TouchDownTest, ItIsUprightForAsLongAsTheTouchIsUnsure) {
  for (const double push : {0.6, 1.2}) {
    touch_.begin();
    for (Seconds t = 0.3; t < 1.9; t += kStep) {
      touch_.flare(at(t, 0.25 * (2 - t), 0, push), maneuver_);
    }
    const double end = maneuver_.at(from_seconds(1.9999)).a_NB.x();
    EXPECT_NEAR(end, -push * config_.flare_share, 0.05);
    EXPECT_NEAR(maneuver_.at(from_seconds(1.98)).a_NB.x(), end, 0.05);
    // It does not gain much speed by that.
    EXPECT_LT(std::abs(maneuver_.at(from_seconds(1.97)).v_NB.x()), 0.3 * push);
  }
}

TEST_F(TouchDownTest, TheReferenceEndsUprighter) {
  for (Seconds t = 0.5; t < 1.9; t += kStep) {
    touch_.flare(at(t, 0.25 * (2 - t), 0, 1.2), maneuver_);
  }
  // Leaning by 1.2 m/s^2 keeps it in place; the reference accelerates the other way.
  EXPECT_NEAR(maneuver_.at(from_seconds(1.999)).a_NB.x(), -1.2 * config_.flare_share,
              0.1);
}

// Set-points are lost for 0.3 s now and then as it touches: told to be upright before,
// it is blown off all that time. A deck that swings presses from elsewhere soon.
TEST_F(TouchDownTest, AStrongPushIsLeantAgainstDownToThePad) {
  for (const double swing : {0.0, 0.9}) {
    SCOPED_TRACE(swing);
    double last = 10;
    for (double push = 0.5; push < 4.5; push += 0.25) {
      touch_.begin();
      maneuver_ = Maneuver::landing(sinking_landing(gear()), 0, config_.sink_m);
      const auto pushed = [&](Seconds t, double above) {
        MissionInput in = at(t, above, 0, push);
        in.deck_swing = swing;
        return in;
      };
      for (Seconds t = 0.3; t < 1.9; t += kStep) {
        touch_.flare(pushed(t, 0.25 * (2 - t)), maneuver_);
      }
      const double flared = -maneuver_.at(from_seconds(1.999)).a_NB.x();
      const double squared = touch_.square_up(pushed(1.999, 0), 0);
      const double given = flared + squared * (push - flared);
      if (push < 1.3 + swing) {
        EXPECT_NEAR(given, push, 0.05);
      } else {
        EXPECT_LT(given, last + 1e-3) << push;
        last = given;
      }
      if (push > 2.2 + swing) {
        EXPECT_NEAR(given, 0.5, 0.05) << push;
      }
    }
  }
}

}  // namespace
}  // namespace alight
