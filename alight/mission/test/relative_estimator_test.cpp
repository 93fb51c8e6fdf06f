#include <algorithm>
#include <cmath>
#include <string>

#include "alight/base/rng.h"
#include "alight/mission/test/watch.h"

namespace alight {
namespace {

TEST(RelativeEstimator, InitializesWithOnePictureAndTracks) {
  Watch w;
  EXPECT_FALSE(w.estimator.initialized());
  w.now = kFrame;
  ASSERT_TRUE(w.look(w.now));
  ASSERT_TRUE(w.report.tracked) << w.report.why_not;
  EXPECT_TRUE(w.report.initialized);
  EXPECT_TRUE(w.estimator.initialized());
  EXPECT_STREQ(w.report.why_not, "");
  double worst_m = 0, worst_deg = 0;
  for (int i = 0; i < 240; ++i) {
    w.now += kFrame;
    ASSERT_TRUE(w.look(w.now));
    ASSERT_TRUE(w.report.tracked) << i << ": " << w.report.why_not;
    EXPECT_FALSE(w.report.initialized);
    EXPECT_EQ(w.report.t, w.now);
    EXPECT_EQ(w.estimator.last_sight(), w.now);
    EXPECT_EQ(w.report.leds.size(), 6u);
    if (i < 30) continue;
    worst_m = std::max(worst_m, w.position_error());
    worst_deg = std::max(worst_deg, w.rotation_error_deg());
  }
  EXPECT_LT(worst_m, 0.004);
  EXPECT_LT(worst_deg, 1);
}

TEST(RelativeEstimator, AFewNoisyPicturesDoNotSayThatLedsAreOff) {
  Rng rng(3);
  Watch w;
  w.follow(1);
  for (int k = 0; k < 5; ++k) {
    w.now += kFrame;
    w.picture.clear();
    for (int i = 0; i < w.rig.leds.size(); ++i) {
      const auto uv = project_led(w.rig.camera, Watch::sway(w.now), w.rig.leds.p_BL(i));
      ASSERT_TRUE(uv);
      w.picture.add(*uv + Vector2(rng.normal(), rng.normal()), w.rig.leds.color(i));
    }
    ASSERT_TRUE(w.fuse(w.now));
  }
  w.follow(40);
  EXPECT_LT(std::sqrt(w.report.cov.block<3, 3>(0, 0).trace()), 0.01);
}

// Bit for bit the same picture again and again is a camera that has stopped.
TEST(RelativeEstimator, ACameraThatRepeatsItsPictureSeesNothing) {
  RelativeEstimatorConfig config = Watch::config_for_tests();
  config.frozen_pictures = 3;
  Watch w(config);
  w.follow(20);
  ASSERT_TRUE(w.report.tracked);
  const Time seen = w.estimator.last_sight();
  // The last picture once more, as if newly captured, and again.
  for (int k = 2; k <= 6; ++k) {
    w.again();
    // The first one contradicts how it sways.
    EXPECT_FALSE(w.report.tracked) << k;
  }
  EXPECT_LE(w.estimator.last_sight(), seen + kFrame);
  EXPECT_LE(w.estimator.filter().time(), seen + kFrame) << "its autopilot may tell";
  EXPECT_STREQ(w.report.why_not, "the camera repeats its picture");
  w.follow(3);
  EXPECT_TRUE(w.report.tracked);
}

// Nobody tells of a drone before a camera alone whether it flies.
TEST(RelativeEstimator, BeforeACameraAloneWhatMovesIsNoLongerSeenInRepeatedPictures) {
  Watch w(RelativeEstimatorConfig::camera_only());
  w.follow(40);
  const Time seen = w.now;
  for (int k = 0; k < 20; ++k) {
    w.again();
    // As predicted for a while, and no longer.
    EXPECT_EQ(w.report.tracked, to_seconds(w.now - seen) < 0.15) << k;
    if (w.report.tracked) {
      EXPECT_LT(w.position_error(), 0.02) << k;
    }
    EXPECT_TRUE(w.report.leds.empty()) << k;
  }
  EXPECT_STREQ(w.report.why_not, "the camera repeats its picture");
  w.follow(3);
  EXPECT_TRUE(w.report.tracked);
  EXPECT_LT(w.position_error(), 0.01);
}

TEST(RelativeEstimator, BeforeACameraAloneWithoutNoiseADroneMayRest) {
  Watch w(RelativeEstimatorConfig::camera_only());
  const Pose rests = Watch::sway(0);
  for (int k = 0; k < 100; ++k) {
    w.now += kFrame;
    w.draw(rests);
    ASSERT_TRUE(w.fuse(w.now));
    EXPECT_TRUE(w.report.tracked || k < 2) << k << ": " << w.report.why_not;
  }
  EXPECT_LT((w.report.x.p_NB - rests.translation()).norm(), 0.004);
}

// Which of them is to land nobody can tell from pictures alone.
TEST(RelativeEstimator, OfTwoDronesFromTheFirstPictureOnNoneIsTold) {
  Watch w;
  const Pose other = make_pose(Matrix3::Identity(), Vector3(-0.9, -0.4, 0.45));
  const auto see_both = [&] {
    w.now += kFrame;
    w.draw(Watch::sway(w.now));
    w.add(other);
    return w.fuse(w.now);
  };
  for (int k = 0; k < 20; ++k) {
    ASSERT_TRUE(see_both());
    EXPECT_FALSE(w.report.tracked) << k;
  }
  w.follow(5);
  EXPECT_LT(w.position_error(), 0.01);
  // One that is followed stays the one.
  for (int k = 0; k < 20; ++k) {
    ASSERT_TRUE(see_both());
    EXPECT_TRUE(w.report.tracked) << k;
    EXPECT_LT(w.position_error(), 0.01);
  }
}

// Pictures that do not come leave the drone to what its autopilot tells.
TEST(RelativeEstimator, ADroneThatIsNotSeenMovesAsItsAutopilotTells) {
  Watch w(RelativeEstimatorConfig{});
  w.follow(30);
  const Pose seen = Watch::sway(w.now);
  const Vector3 v_NB(0.4, -0.3, 0.2);  // and the model knows of no motion
  Time t = w.now;
  for (int k = 0; k < 25; ++k) {
    t += 20'000'000;
    w.estimator.reckon(t, v_NB, w.motion);
  }
  EXPECT_EQ(w.estimator.last_sight(), w.now);
  EXPECT_EQ(w.estimator.filter().time(), t);
  const Vector3 way = w.estimator.filter().state().p_NB - seen.translation();
  EXPECT_LT((way - 0.5 * v_NB).norm(), 0.1) << way.transpose();
  EXPECT_LT((w.estimator.filter().state().v_NB - v_NB).norm(), 0.15);
  // What is much older than that changes nothing, nor does an older picture.
  const RelativeState x = w.estimator.filter().state();
  w.estimator.reckon(t - from_seconds(0.26), -v_NB, w.motion);
  w.draw(seen);
  EXPECT_TRUE(w.fuse(t - 10'000'000));
  EXPECT_FALSE(w.report.tracked);
  EXPECT_STREQ(w.report.why_not, "older than what the autopilot has told since");
  EXPECT_EQ(boxminus(w.estimator.filter().state(), x).norm(), 0);
  // There it is found.
  Vector3 p_NB;
  for (int k = 1; k <= 5; ++k) {
    p_NB = seen.translation() + (0.5 + k / 60.0) * v_NB;
    w.draw(make_pose(seen.linear(), p_NB));
    ASSERT_TRUE(w.fuse(t + k * kFrame));
  }
  EXPECT_TRUE(w.report.tracked) << w.report.why_not;
  EXPECT_LT((w.report.x.p_NB - p_NB).norm(), 0.02);
}

// Pictures come and do not show it: what its autopilot tells comes later than they do.
TEST(RelativeEstimator, ADroneThatIsHiddenMovesAsItsAutopilotHasTold) {
  Watch w(RelativeEstimatorConfig{});
  w.follow(30);
  const Pose seen = Watch::sway(w.now);
  const Time since = w.now;
  const Vector3 v_NB(0.4, -0.3, 0.2);  // and the model knows of no motion
  for (int k = 0; k < 30; ++k) {
    w.miss(1);
    w.estimator.reckon(w.now - 50'000'000, v_NB, w.motion);
    EXPECT_EQ(w.estimator.filter().time(), w.now) << "pictures carry it on";
  }
  EXPECT_FALSE(w.report.tracked);
  EXPECT_EQ(w.estimator.last_sight(), since);
  const Vector3 way = w.estimator.filter().state().p_NB - seen.translation();
  EXPECT_LT((way - to_seconds(w.now - since) * v_NB).norm(), 0.1) << way.transpose();
  EXPECT_LT((w.estimator.filter().state().v_NB - v_NB).norm(), 0.2);
}

TEST(RelativeEstimator, WhatWasPredictedAndIsToldLateChangesNothing) {
  Watch w(RelativeEstimatorConfig{});
  w.follow(30);
  w.estimator.restart_disturbance(Vector3(1, -0.5, 0.3), Vector3::Zero());
  w.miss(1);
  const Time then = w.now;
  const Vector3 v_NB = w.estimator.filter().state().v_NB;
  w.miss(3);
  const RelativeState x = w.estimator.filter().state();
  ASSERT_GT((x.v_NB - v_NB).norm(), 0.03) << "it accelerates meanwhile";
  w.estimator.reckon(then, v_NB, w.motion);
  EXPECT_LT(boxminus(w.estimator.filter().state(), x).norm(), 1e-3);
}

// The n-th picture, for every n: lost, black, late, repeated or of the wrong size.
enum class Mishap { lost, black, late, repeated, wrong_size, null };

TEST(RelativeEstimator, StandsOnePictureInEveryNThatIsNotAsItShouldBe) {
  for (const Mishap fault : {Mishap::lost, Mishap::black, Mishap::late,
                             Mishap::repeated, Mishap::wrong_size, Mishap::null}) {
    for (const int every : {2, 3, 7}) {
      SCOPED_TRACE(testing::Message()
                   << "fault " << static_cast<int>(fault) << ", every " << every);
      Watch w;
      w.follow(5);
      double worst_m = 0;
      for (int i = 1; i <= 42; ++i) {
        w.now += kFrame;
        const bool good = i % every != 0;
        if (good) {
          ASSERT_TRUE(w.look(w.now));
          ASSERT_TRUE(w.report.tracked) << i << ": " << w.report.why_not;
          EXPECT_FALSE(w.report.initialized) << "never lost";
          worst_m = std::max(worst_m, w.position_error());
          continue;
        }
        const Time last_sight = w.estimator.last_sight();
        const RelativeState before = w.estimator.filter().state();
        switch (fault) {
          case Mishap::lost:
            break;
          case Mishap::black:
            w.picture.clear();
            EXPECT_TRUE(w.fuse(w.now));
            EXPECT_FALSE(w.report.tracked);
            EXPECT_STRNE(w.report.why_not, "");
            break;
          case Mishap::late:
          case Mishap::repeated: {
            // Refused as such: nothing changes.
            const Time t = fault == Mishap::late ? w.now - 4 * kFrame : w.now - kFrame;
            EXPECT_FALSE(w.look(t));
            EXPECT_FALSE(w.report.tracked);
            EXPECT_STREQ(w.report.why_not, "not newer than the last picture");
            EXPECT_EQ(w.estimator.filter().state().p_NB, before.p_NB);
            break;
          }
          case Mishap::wrong_size:
          case Mishap::null: {
            CameraFrame frame;
            frame.captured = frame.received = w.now;
            frame.color = w.picture.view();
            if (fault == Mishap::null) {
              frame.color.data = nullptr;
            } else {
              frame.color.width /= 2;
            }
            EXPECT_FALSE(w.estimator.fuse(frame, w.motion, w.report));
            EXPECT_FALSE(w.report.tracked);
            EXPECT_STREQ(w.report.why_not, "the picture is damaged");
            EXPECT_EQ(w.estimator.filter().state().p_NB, before.p_NB);
            break;
          }
        }
        EXPECT_TRUE(w.estimator.initialized());
        EXPECT_EQ(w.estimator.last_sight(), last_sight);
        EXPECT_TRUE(w.estimator.filter().covariance().allFinite());
      }
      EXPECT_LT(worst_m, 0.006);
    }
  }
}

TEST(RelativeEstimator, WithoutPicturesItForgetsInTheEndAndFindsAgain) {
  Watch w;
  const auto config = Watch::config_for_tests();
  w.follow(30);
  const Time last_sight = w.now;
  w.picture.clear();
  while (to_seconds(w.now - last_sight) < config.forget_after_s - 0.05) {
    w.now += kFrame;
    w.fuse(w.now);
    EXPECT_FALSE(w.report.tracked);
    EXPECT_TRUE(w.estimator.initialized());
  }
  while (to_seconds(w.now - last_sight) < config.forget_after_s + 0.05) {
    w.now += kFrame;
    w.fuse(w.now);
  }
  EXPECT_FALSE(w.estimator.initialized());
  w.now += kFrame;
  ASSERT_TRUE(w.look(w.now));
  EXPECT_TRUE(w.report.tracked);
  EXPECT_TRUE(w.report.initialized);
  EXPECT_LT(w.position_error(), 0.02);
}

TEST(RelativeEstimator, APoseThatIsKnownWellIsToldAMomentLonger) {
  RelativeEstimatorConfig config = RelativeEstimatorConfig::camera_only();
  for (const int pictures : {1, 90}) {
    Watch w(config);
    w.follow(pictures);
    const Time last_sight = w.now;
    double sd = 0;
    for (int k = 1; k < 20; ++k) {
      w.miss(1);
      EXPECT_EQ(w.estimator.last_sight(), last_sight);
      // By one picture its speed is not known.
      const bool known = pictures > 1 && k / 60.0 < config.coast_s;
      ASSERT_EQ(w.report.tracked, known) << k;
      if (!known) continue;
      EXPECT_TRUE(w.report.leds.empty());
      EXPECT_STREQ(w.report.why_not, "");
      EXPECT_LT(w.position_error(), 0.01);
      EXPECT_LT(w.rotation_error_deg(), 2);
      const double now = std::sqrt(w.report.cov.topLeftCorner<3, 3>().trace());
      EXPECT_GT(now, sd);
      sd = now;
    }
    w.now += kFrame;
    ASSERT_TRUE(w.look(w.now));
    EXPECT_TRUE(w.report.tracked) << w.report.why_not;
    EXPECT_LT(w.position_error(), 0.01);
  }
}

TEST(RelativeEstimator, SameCallsSameBits) {
  Watch a, b;
  for (int i = 0; i < 60; ++i) {
    a.now += kFrame;
    const unsigned which = i % 7 == 0 ? 0x07 : 0x3f;
    a.look(a.now, which);
    b.look(a.now, which);
    ASSERT_EQ(a.report.tracked, b.report.tracked);
    ASSERT_EQ(a.report.x.p_NB, b.report.x.p_NB);
    ASSERT_EQ(a.report.x.R_NB, b.report.x.R_NB);
    ASSERT_EQ(a.report.cov, b.report.cov);
  }
}

// An edge moves over the LEDs of a drone that stands still: it hides them one by one,
// each half before it is gone. What halves tell is no speed.
TEST(RelativeEstimator, WhatHidesLedsMakesNoSpeed) {
  // The slower, the longer ago LEDs were seen well.
  const struct {
    double px_per_picture, most_m_s;
  } edges[] = {{0.1, 0.1}, {0.2, 0.5}, {0.4, 0.3}, {0.7, 0.1}, {1.5, 0.1}, {4, 0.1}};
  for (const auto& [px_per_picture, most_m_s] : edges) {
    SCOPED_TRACE(px_per_picture);
    Watch w(RelativeEstimatorConfig{}, small_rig());
    const Pose X_NB = Watch::sway(0);
    double edge = 0;
    const auto look = [&] {
      w.draw(X_NB);
      w.picture.cover(static_cast<int>(edge));
      w.again();
    };
    for (int i = 0; i < 90; ++i) look();
    ASSERT_TRUE(w.report.tracked) << w.report.why_not;
    double first = 1e9, last = 0;
    for (int i = 0; i < w.truth.leds.size(); ++i) {
      const auto uv = project_led(w.truth.camera, X_NB, w.truth.leds.p_BL(i));
      first = std::min(first, uv->x());
      last = std::max(last, uv->x());
    }
    for (edge = first - 8; edge < last + 8; edge += px_per_picture) {
      look();
      if (!w.report.tracked) continue;
      EXPECT_LT((w.report.x.p_NB - X_NB.translation()).norm(), 0.03);
    }
    for (int i = 0; i < 10; ++i) look();
    ASSERT_FALSE(w.report.tracked);
    EXPECT_LT(w.estimator.filter().state().v_NB.norm(), most_m_s);
  }
}

// A drone that stands still by the lens, and leaves the picture LED by LED.
TEST(RelativeEstimator, LedsOfARigThatIsOffLeaveThePictureWithoutTellingSpeed) {
  double squares = 0;
  int followed = 0, told = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Watch w(RelativeEstimatorConfig{}, alan_rig());
    Rng rng(seed);
    for (Led& led : w.truth.leds.leds) {
      led.p_BL += 0.0025 * Vector3(rng.normal(), rng.normal(), rng.normal());
    }
    const Pose X_NB =
        make_pose(from_rpy(0, 0, rng.normal(0, 0.05)),
                  w.rig.camera.X_NC * Vector3(0, -0.05, rng.uniform(0.3, 0.4)));
    const auto look = [&](unsigned which) {
      w.draw(X_NB, which);
      w.again();
      told += w.report.tracked;
    };
    for (int i = 0; i < 60; ++i) {
      w.draw(X_NB);
      w.again();
    }
    if (!w.report.tracked) continue;
    ++followed;
    for (const unsigned which : {0x3eu, 0x3cu, 0x38u, 0x30u, 0x20u}) {
      for (int i = 0; i < 3; ++i) look(which);
    }
    squares += w.estimator.filter().state().v_NB.squaredNorm();
  }
  EXPECT_GE(followed, 20);
  EXPECT_GE(told, 3 * followed / 2);               // five of six go on as before
  EXPECT_LT(std::sqrt(squares / followed), 0.15);  // m/s
}

/// A drone of which LEDs are off, turned to and fro before the lens, so far away.
struct OffRig : Watch {
  explicit OffRig(unsigned seed)
      : Watch(RelativeEstimatorConfig::camera_only(), alan_rig()) {
    Rng rng(seed);
    for (Led& led : truth.leds.leds) {
      led.p_BL += 0.002 * Vector3(rng.normal(), rng.normal(), rng.normal());
    }
  }
  Pose at(double s, double range_m) const {
    const Vector3 p_CB(0.1 * std::sin(0.9 * s), 0.05 * std::cos(0.7 * s), range_m);
    return make_pose(
        from_rpy(0.2 * std::sin(1.7 * s), 0.25 * std::sin(s), 0.4 * std::sin(0.8 * s)),
        rig.camera.X_NC * p_CB);
  }
  /// Pictures while it goes from one distance to another.
  template <class Then>
  void go(double from_m, double to_m, int pictures, unsigned which, Then&& then) {
    for (int k = 0; k < pictures; ++k) {
      const double share = (k + 1.0) / pictures;
      X_NB = at(to_seconds(now), from_m + share * (to_m - from_m));
      draw(X_NB, which);
      again();
      then();
    }
  }
  void go(double from_m, double to_m, int pictures, unsigned which = 0x3f) {
    go(from_m, to_m, pictures, which, [] {});
  }
  double off_m() const { return (report.x.p_NB - X_NB.translation()).norm(); }
  double off_deg() const {
    return angle_between(report.x.R_NB, Matrix3(X_NB.linear())) / kDegree;
  }
  Pose X_NB = Pose::Identity();
};

// It was begun anew after two seconds, with the LEDs as written, and was sure of them.
TEST(RelativeEstimator, WhatLedsThatAreOffLeaveVagueFarAwayIsFollowedOn) {
  int untold = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    OffRig w(seed);
    constexpr unsigned kFive = 0x1f;
    w.go(0.5, 0.6, 180, kFive);
    ASSERT_TRUE(w.report.tracked) << w.report.why_not;
    w.go(0.6, 3.2, 240, kFive);
    w.go(3.2, 3.2, 300, kFive, [&] {
      untold += !w.report.tracked;
      EXPECT_FALSE(w.report.initialized);
    });
    w.go(3.2, 0.6, 240, kFive, [&] { EXPECT_FALSE(w.report.initialized); });
    ASSERT_TRUE(w.report.tracked) << w.report.why_not;
    EXPECT_LT(w.off_m(), 0.05);
  }
  EXPECT_GT(untold, 300) << "else the test tells nothing";
}

// Learnt from lamps that were followed for a while. Where nothing is followed any more
// it takes two seconds to forget and one to give up what was learnt.
TEST(RelativeEstimator, WhatWasLearntOfLedsIsGivenUpWhereTheyAreAsWritten) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE(seed);
    OffRig w(seed);
    w.go(0.5, 0.7, 300);
    ASSERT_TRUE(w.report.tracked) << w.report.why_not;
    w.truth = w.rig;
    w.go(0.7, 0.7, 240, 0x3c);
    int told = 0;
    w.go(0.7, 0.7, 60, 0x3c, [&] {
      if (!w.report.tracked) return;
      ++told;
      EXPECT_LT(w.off_m(), 0.01);
      EXPECT_LT(w.off_deg(), 2);
    });
    EXPECT_GE(told, 45);
  }
}

/// Knows what moved the drone for a while only, as DroneResponse does, and complains
/// when asked for earlier.
struct ShortMemory final : MotionSource {
  static constexpr Time kMemory = 600'000'000;
  Time now = 0;
  PredictionInput at(Time t, const RelativeState&) const override {
    EXPECT_GE(t, now - kMemory);
    PredictionInput input;
    input.platform.t = t;
    input.f_N = Vector3(0.3 * std::sin(5 * to_seconds(t)), 0.2, kGravity);
    return input;
  }
};

TEST(RelativeEstimator, WithoutPicturesThePredictionIsCarriedOnWhileItIsKnownHow) {
  Watch w, v;
  w.follow(60);
  v.follow(60);
  ShortMemory motion;
  motion.now = w.now;
  const Time seen = w.now;
  // What it comes to when all is remembered.
  ShortMemory all;
  all.now = 0;
  while (motion.now < seen + from_seconds(3)) {
    motion.now += 10'000'000;
    w.estimator.advance(motion.now - from_seconds(0.5), motion);
    Covariance9 cov = Covariance9::Zero(), cov_other = Covariance9::Zero();
    const RelativeState x = w.estimator.carried_to(motion.now, motion, &cov).x;
    const RelativeState y = v.estimator.carried_to(motion.now, all, &cov_other).x;
    EXPECT_LT((x.p_NB - y.p_NB).norm(), 0.01);
    EXPECT_LT((x.v_NB - y.v_NB).norm(), 0.01);
    // The noise is added up in other steps.
    const double sd = std::sqrt(cov_other.trace());
    EXPECT_NEAR(std::sqrt(cov.trace()), sd, 0.2 * sd);
  }
  EXPECT_EQ(w.estimator.last_sight(), seen) << "that is no sight";
}

TEST(RelativeEstimatorConfig, NamesWhatIsOutOfBounds) {
  const Rig rig = small_rig();
  EXPECT_TRUE(RelativeEstimatorConfig{}.validate());
  EXPECT_TRUE(RelativeEstimatorConfig::paper().validate());
  EXPECT_TRUE(RelativeEstimatorConfig::camera_only().validate());
  const auto complaint = [&](auto&& change) {
    RelativeEstimatorConfig config;
    change(config);
    const auto bad = RelativeEstimator::create(config, rig);
    EXPECT_FALSE(bad);
    return bad ? std::string() : bad.error().detail;
  };
  const auto has = [](const std::string& text, const char* word) {
    return text.find(word) != std::string::npos;
  };
  EXPECT_TRUE(
      has(complaint([](auto& c) { c.prediction_step_ms = 0; }), "prediction_step_ms"));
  EXPECT_TRUE(has(complaint([](auto& c) { c.misses_before_search = 0; }),
                  "misses_before_search"));
  EXPECT_TRUE(has(complaint([](auto& c) { c.forget_after_s = std::nan(""); }),
                  "forget_after_s"));
  EXPECT_TRUE(has(complaint([](auto& c) { c.rest.led_sd_m = 0; }), "led_sd_m"));
  EXPECT_TRUE(has(complaint([](auto& c) { c.tracker.match_px = -1; }), "match_px"));
}

}  // namespace
}  // namespace alight
