#include "alight/mission/relative_estimator.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr Time kFrame = 16'666'667;

/// A rig with a small picture: pixels as large as the authors', fewer of them.
Rig small_rig() {
  Rig rig = alan_rig();
  Intrinsics& lens = rig.camera.intrinsics;
  lens.width = 480;
  lens.height = 320;
  lens.cx = 239.5;
  lens.cy = 159.5;
  return rig;
}

/// A dark picture with Gaussian lights in it.
class Picture {
 public:
  explicit Picture(const Intrinsics& lens)
      : width_(lens.width),
        height_(lens.height),
        bytes_(static_cast<std::size_t>(lens.width * lens.height * 3), 3) {}

  void clear() { std::fill(bytes_.begin(), bytes_.end(), std::uint8_t{3}); }

  void add(const Vector2& uv, LedColor color, double peak = 700, double sd = 1.0) {
    const Vector3 bgr = color == LedColor::red     ? Vector3(0.25, 0.2, 1)
                        : color == LedColor::green ? Vector3(0.3, 1, 0.2)
                        : color == LedColor::blue  ? Vector3(1, 0.3, 0.2)
                                                   : Vector3(1, 1, 1);
    const int cu = static_cast<int>(std::lround(uv.x()));
    const int cv = static_cast<int>(std::lround(uv.y()));
    for (int v = std::max(cv - 6, 0); v <= std::min(cv + 6, height_ - 1); ++v) {
      for (int u = std::max(cu - 6, 0); u <= std::min(cu + 6, width_ - 1); ++u) {
        const double value =
            peak * std::exp(-(Vector2(u, v) - uv).squaredNorm() / (2 * sd * sd));
        for (int c = 0; c < 3; ++c) {
          auto& byte = bytes_[static_cast<std::size_t>((v * width_ + u) * 3 + c)];
          byte = static_cast<std::uint8_t>(std::min(byte + value * bgr[c], 255.0));
        }
      }
    }
  }

  /// Dark left of the column `u`.
  void cover(int u) {
    const int right = std::clamp(u, 0, width_);
    for (int v = 0; v < height_; ++v) {
      for (int i = 0; i < 3 * right; ++i) {
        bytes_[static_cast<std::size_t>(3 * v * width_ + i)] = 3;
      }
    }
  }

  void dot(int u, int v, std::uint8_t value) {
    bytes_[static_cast<std::size_t>((v * width_ + u) * 3)] = value;
  }

  ImageView view() const {
    return {bytes_.data(), width_, height_, 3, static_cast<std::ptrdiff_t>(width_) * 3};
  }

 private:
  int width_, height_;
  std::vector<std::uint8_t> bytes_;
};

/// An estimator, and the drone it looks at.
struct Watch {
  explicit Watch(const RelativeEstimatorConfig& config = config_for_tests(),
                 const Rig& rig_in = small_rig())
      : rig(rig_in),
        truth(rig_in),
        estimator(RelativeEstimator::create(config, rig_in).value()),
        picture(rig_in.camera.intrinsics) {}

  static RelativeEstimatorConfig config_for_tests() {
    return RelativeEstimatorConfig::camera_only();
  }

  /// A drone that sways slowly about a place of the approach, upright.
  static Pose sway(Time t) {
    const double s = to_seconds(t);
    const Vector3 p_NB(-0.35 + 0.05 * std::sin(s), 0.06 * std::sin(0.8 * s),
                       0.35 + 0.04 * std::cos(1.1 * s));
    return make_pose(from_rpy(0, 0, 0.1 * std::sin(0.7 * s)), p_NB);
  }

  void draw(const Pose& X_NB, unsigned which = 0x3f) {
    picture.clear();
    add(X_NB, which);
  }
  void add(const Pose& X_NB, unsigned which = 0x3f) {
    for (int i = 0; i < truth.leds.size(); ++i) {
      if (((which >> i) & 1) == 0) continue;
      const auto uv = project_led(truth.camera, X_NB, truth.leds.p_BL(i));
      if (uv) picture.add(*uv, truth.leds.color(i));
    }
  }
  bool fuse(Time t) {
    CameraFrame frame;
    frame.captured = t;
    frame.received = t + 30'000'000;
    frame.color = picture.view();
    return estimator.fuse(frame, motion, report);
  }
  /// A picture of the drone where it truly is.
  bool look(Time t, unsigned which = 0x3f) {
    draw(sway(t), which);
    return fuse(t);
  }
  /// The last picture, as if it were a new one.
  bool again() {
    now += kFrame;
    return fuse(now);
  }
  /// Pictures in a row without the drone.
  void miss(int pictures) {
    picture.clear();
    for (int i = 0; i < pictures; ++i) again();
  }
  /// Pictures in a row, all tracked.
  void follow(int pictures) {
    for (int i = 0; i < pictures; ++i) {
      now += kFrame;
      ASSERT_TRUE(look(now));
      ASSERT_TRUE(report.tracked) << i << ": " << report.why_not;
    }
  }
  double position_error() const {
    return (report.x.p_NB - sway(report.t).translation()).norm();
  }
  double rotation_error_deg() const {
    return angle_between(report.x.R_NB, Matrix3(sway(report.t).linear())) / kDegree;
  }

  Rig rig, truth;
  RelativeEstimator estimator;
  Picture picture;
  NoMotion motion;
  FrameReport report;
  Time now = 0;
};

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

TEST(RelativeEstimator, LedsThatAreDimAreFoundToo) {
  for (const bool dim : {true, false}) {
    RelativeEstimatorConfig config = Watch::config_for_tests();
    if (!dim) config.blobs.dim_threshold = 0;
    Watch w(config);
    const Pose X_NB = Watch::sway(kFrame);
    w.picture.clear();
    for (int i = 0; i < w.rig.leds.size(); ++i) {
      const auto uv = project_led(w.rig.camera, X_NB, w.rig.leds.p_BL(i));
      ASSERT_TRUE(uv);
      w.picture.add(*uv, w.rig.leds.color(i), i < 3 ? 700 : 52);
    }
    ASSERT_TRUE(w.fuse(kFrame));
    EXPECT_EQ(w.report.tracked, dim) << w.report.why_not;
    if (!w.report.tracked) continue;
    EXPECT_LT(w.position_error(), 0.02);
    EXPECT_LT(w.rotation_error_deg(), 3);
  }
}

// Two of six dead leave four, which may look like another four.
TEST(RelativeEstimator, WithAnyTwoLedsDeadNoPoseThatIsToldIsWrong) {
  int started = 0, pairs = 0;
  for (int a = 0; a < 6; ++a) {
    for (int b = a + 1; b < 6; ++b) {
      SCOPED_TRACE(testing::Message() << a << " and " << b);
      Watch w;
      bool told = false;
      for (int k = 0; k < 60; ++k) {
        w.now += kFrame;
        ASSERT_TRUE(w.look(w.now, 0x3fu & ~(1u << a) & ~(1u << b)));
        EXPECT_TRUE(w.report.tracked || !told) << "lost at " << k;
        told = told || w.report.tracked;
        if (!w.report.tracked) continue;
        EXPECT_LT(w.position_error(), 0.05) << k;
        EXPECT_LT(w.rotation_error_deg(), 10) << k;
      }
      started += told;
      ++pairs;
    }
  }
  EXPECT_GE(started, pairs - 2);
}

// From afar LEDs 2 to 5 of a drone turned by 20 to 32 deg lie nearly as others of their
// colours would, of one turned by 20 deg more or less. Their centroids may leave the
// wrong one of the two; placed by their pixels they fit the right one far better.
TEST(RelativeEstimator, FourLedsThatFitFarBetterAsOthersAreNotTold) {
  const Rig rig = small_rig();
  const Intrinsics& lens = rig.camera.intrinsics;
  Rng rng(77);
  int told = 0, wrong = 0;
  for (int run = 0; run < 60;) {
    const Vector2 uv(rng.uniform(40, lens.width - 40),
                     rng.uniform(40, lens.height - 40));
    const Vector3 p_NB =
        rig.camera.X_NC * Vector3(rng.uniform(2, 3) * lens.unproject(uv).normalized());
    const Vector3 to_lens = rig.camera.X_NC.translation() - p_NB;
    const double yaw =
        std::atan2(to_lens.y(), to_lens.x()) + rng.uniform(20, 32) * kDegree;
    const Pose X_NB_0 = make_pose(from_rpy(0, 0, yaw), p_NB);
    const Vector3 v_NB = 0.1 * Vector3(rng.normal(), rng.normal(), rng.normal());
    bool in_view = true;
    for (const Led& led : rig.leds.leds) {
      const auto image = project_led(rig.camera, X_NB_0, led.p_BL);
      in_view = in_view && image && lens.contains(*image, 20);
    }
    if (!in_view) continue;
    ++run;
    Watch w;
    for (int k = 0; k < 30 && !w.report.tracked; ++k) {
      w.now += kFrame;
      const Pose X_NB =
          make_pose(X_NB_0.linear(), X_NB_0.translation() + to_seconds(w.now) * v_NB);
      w.draw(X_NB, 0x3c);
      ASSERT_TRUE(w.fuse(w.now));
      if (!w.report.tracked) continue;
      ++told;
      wrong += angle_between(w.report.x.R_NB, Matrix3(X_NB.linear())) > 15 * kDegree;
    }
  }
  RecordProperty("told", told);
  RecordProperty("wrong", wrong);
  EXPECT_LE(wrong, 3);
  EXPECT_GE(told, 10);
}

TEST(RelativeEstimator, AWrongPoseLiesThreeOfTheSdOffThatAreTold) {
  Rng rng(31);
  int told = 0;
  for (int run = 0; run < 12; ++run) {
    Watch w;
    for (Led& led : w.truth.leds.leds) {
      led.p_BL += 0.003 * Vector3(rng.normal(), rng.normal(), rng.normal());
    }
    for (int k = 0; k < 60; ++k) {
      w.now += kFrame;
      ASSERT_TRUE(w.look(w.now, k % 2 == 0 ? 0x3fu : 0x3fu & ~(1u << run % 6)));
      if (!w.report.tracked) continue;
      ++told;
      const Eigen::SelfAdjointEigenSolver<Matrix3> place(
          w.report.cov.block<3, 3>(0, 0)),
          turn(w.report.cov.block<3, 3>(3, 3));
      EXPECT_LT(3 * std::sqrt(place.eigenvalues()[2]), 0.15) << run << ", " << k;
      EXPECT_LT(3 * std::sqrt(turn.eigenvalues()[2]), 15 * kDegree) << run << ", " << k;
    }
  }
  EXPECT_GT(told, 0);
}

/// The first `count` LEDs as white lights, each off by `sd_px` along both axes.
void draw_white(Watch& w, const Pose& X_NB, int count, double sd_px, Rng& rng) {
  w.picture.clear();
  for (int i = 0; i < count; ++i) {
    const auto uv = project_led(w.rig.camera, X_NB, w.rig.leds.p_BL(i));
    ASSERT_TRUE(uv);
    w.picture.add(*uv + sd_px * Vector2(rng.normal(), rng.normal()), LedColor::white);
  }
}

// White lamps that stand nearly like the LEDs, and stand still.
TEST(RelativeEstimator, LampsThatLookNearlyLikeTheDroneAreNotTakenForIt) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    Watch w;
    draw_white(w, Watch::sway(kFrame), 5, 0.5, rng);
    for (int k = 0; k < 60; ++k) {
      w.again();
      EXPECT_FALSE(w.report.tracked) << k << ", " << w.report.reprojection_px << " px";
    }
  }
}

// LEDs that are washed out, in a picture with noise.
TEST(RelativeEstimator, WhiteLightsThatFitExactlyStartItAtOnce) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    Watch w;
    draw_white(w, Watch::sway(kFrame), w.rig.leds.size(), 0.15, rng);
    ASSERT_TRUE(w.fuse(kFrame));
    EXPECT_TRUE(w.report.initialized) << w.report.why_not;
    EXPECT_LT(w.position_error(), 0.02);
  }
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

// Four lights go on where the drone was expected; all six LEDs shine elsewhere.
TEST(RelativeEstimator, GoesOverToThePoseThatExplainsMoreLeds) {
  Watch w;
  w.follow(30);
  const Pose aside = make_pose(Matrix3::Identity(), Vector3(0.1, 0.3, 0.05));
  int over = 0;
  for (int k = 1; k <= 40; ++k) {
    w.now += kFrame;
    w.draw(Watch::sway(w.now), 0x1e);
    w.add(aside * Watch::sway(w.now));
    ASSERT_TRUE(w.fuse(w.now));
    const Vector3 p_NB = w.report.x.p_NB;
    if (w.report.tracked && over == 0 &&
        (p_NB - (aside * Watch::sway(w.now)).translation()).norm() < 0.05) {
      over = k;
      EXPECT_TRUE(w.report.initialized);
    }
  }
  EXPECT_GT(over, 4) << "one picture, or none, is not enough";
  EXPECT_LT(over, 20);
}

// LEDs that left no doubt are hidden one by one; elsewhere four lamps of a ceiling lie
// as four LEDs of another pose may.
TEST(RelativeEstimator, FourLampsElsewhereAreNoReasonToLeaveLedsThatWereSure) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    Watch w;
    w.follow(30);
    const Pose aside = make_pose(Matrix3::Identity(), Vector3(0.1, 0.3, 0.05));
    std::vector<Vector2> lamps;
    for (int i = 0; i < 4; ++i) {
      const auto uv =
          project_led(w.truth.camera, aside * Watch::sway(w.now), w.truth.leds.p_BL(i));
      ASSERT_TRUE(uv);
      lamps.push_back(*uv + 0.1 * Vector2(rng.normal(), rng.normal()));
    }
    int told = 0;
    for (int k = 1; k <= 120; ++k) {
      w.now += kFrame;
      w.draw(Watch::sway(w.now), 0x2c);
      for (const Vector2& lamp : lamps) w.picture.add(lamp, LedColor::white);
      ASSERT_TRUE(w.fuse(w.now));
      if (!w.report.tracked) continue;
      ++told;
      EXPECT_LT(w.position_error(), 0.05) << k;
    }
    EXPECT_GT(told, 100) << "three LEDs that are seen well tell the pose";
  }
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
    EXPECT_EQ(w.report.tracked, k < 3) << k;
  }
  EXPECT_LE(w.estimator.last_sight(), seen + kFrame);
  EXPECT_LE(w.estimator.filter().time(), seen + kFrame) << "its autopilot may tell";
  EXPECT_STREQ(w.report.why_not, "the camera repeats its picture");
  w.follow(3);
  EXPECT_TRUE(w.report.tracked);
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

/// Far from where the drone was last seen, as another constellation of lights would be.
Pose elsewhere(Time t) {
  Pose X_NB = Watch::sway(t);
  X_NB.translation() += Vector3(-0.75, -0.3, 0.28);
  return X_NB;
}

// A whole constellation where the drone cannot be: once is chance, again and again is
// the drone.
TEST(RelativeEstimator, ASearchThatContradictsThePredictionMustRepeatItself) {
  const auto config = Watch::config_for_tests();
  Watch w;
  w.follow(60);
  const RelativeState before = w.report.x;
  int told = 0, pictures = 0;
  bool taken = false;
  for (; pictures < 30 && !taken; ++pictures) {
    w.now += kFrame;
    w.draw(elsewhere(w.now));
    w.fuse(w.now);
    taken = w.report.tracked;
    if (taken) break;
    told += std::string(w.report.why_not) == "a pose that contradicts the prediction";
    EXPECT_LT((w.estimator.filter().state().p_NB - before.p_NB).norm(), 0.1)
        << "not believed yet";
  }
  ASSERT_TRUE(taken);
  EXPECT_EQ(told, config.search_confirmations - 1);
  EXPECT_TRUE(w.report.initialized);
  EXPECT_LT((w.report.x.p_NB - elsewhere(w.now).translation()).norm(), 0.05);
}

TEST(RelativeEstimator, AContradictionThatDoesNotRepeatIsNeverBelieved) {
  Watch w;
  w.follow(60);
  // As long as the prediction is not so old that it could be there.
  for (int i = 0; i < 17; ++i) {
    w.now += kFrame;
    // Here and there, never twice in a row at one place.
    Pose X_NB = elsewhere(w.now);
    X_NB.translation().y() += (i % 2 == 0) ? 0.0 : 0.7;
    w.draw(X_NB);
    w.fuse(w.now);
    EXPECT_FALSE(w.report.tracked) << i;
    EXPECT_FALSE(w.report.initialized);
  }
  // The drone is where it was all the time.
  w.now += kFrame;
  ASSERT_TRUE(w.look(w.now));
  EXPECT_TRUE(w.report.tracked) << w.report.why_not;
  EXPECT_LT(w.position_error(), 0.02);
}

TEST(RelativeEstimator, AfterMissesTooFewLedsAreNotFused) {
  const auto config = Watch::config_for_tests();
  const unsigned few[] = {0x01, 0x03, 0x07, 0x38, 0x15, 0x20};
  for (const unsigned which : few) {
    ASSERT_LT(std::popcount(which), config.leds_after_misses);
    SCOPED_TRACE(which);
    Watch w;
    w.follow(30);
    w.picture.clear();
    for (int i = 0; i < config.misses_before_search; ++i) {
      w.now += kFrame;
      w.fuse(w.now);
    }
    for (int i = 0; i < 20; ++i) {
      const Time at = w.now + kFrame;
      // The same without the picture: a mere prediction.
      const RelativeState predicted = w.estimator.carried_to(at, w.motion).x;
      w.now = at;
      w.look(w.now, which);
      EXPECT_FALSE(w.report.tracked);
      EXPECT_TRUE(w.report.leds.empty());
      EXPECT_LT((w.estimator.filter().state().p_NB - predicted.p_NB).norm(), 1e-9);
    }
    w.now += kFrame;
    w.look(w.now);
    EXPECT_TRUE(w.report.tracked) << w.report.why_not;
  }
  // Before any miss a few do, and with another rule they would here.
  Watch w;
  w.follow(30);
  w.now += kFrame;
  w.look(w.now, 0x15);
  EXPECT_TRUE(w.report.tracked) << w.report.why_not;
  RelativeEstimatorConfig careless = config;
  careless.leds_after_misses = 1;
  Watch c(careless);
  c.follow(30);
  c.picture.clear();
  for (int i = 0; i < config.misses_before_search; ++i) c.fuse(c.now += kFrame);
  for (int i = 1; i <= config.search_confirmations; ++i) {
    c.now += kFrame;
    c.look(c.now, 0x15);
    EXPECT_EQ(c.report.tracked, i == config.search_confirmations) << i;
  }
}

TEST(RelativeEstimator, FewLedsSeenAgainMustBeConfirmed) {
  const auto config = Watch::config_for_tests();
  Watch w;
  w.follow(30);
  w.miss(config.misses_before_search);
  for (int i = 1; i <= config.search_confirmations; ++i) {
    w.now += kFrame;
    w.look(w.now, 0x0f);
    EXPECT_EQ(w.report.tracked, i == config.search_confirmations) << i;
  }
}

/// By how much one picture, of the LEDs `which` to the one and of none to the other,
/// moves the drone's place once there are dark ones again.
double moved_by(Watch& w, Watch& unaware, unsigned which) {
  const auto fuse = [](Watch& watch, unsigned leds) {
    watch.now += kFrame;
    watch.look(watch.now, leds);
  };
  fuse(w, which);
  EXPECT_FALSE(w.report.tracked);
  EXPECT_EQ(static_cast<int>(w.report.leds.size()), std::popcount(which));
  fuse(unaware, 0);
  for (Watch* watch : {&w, &unaware}) fuse(*watch, 0);
  return (w.estimator.filter().state().p_NB - unaware.estimator.filter().state().p_NB)
      .norm();
}

// Four lights that are gone again were none of its LEDs.
TEST(RelativeEstimator, LightsThatAreNotConfirmedChangeNothing) {
  const auto config = Watch::config_for_tests();
  Watch w, unaware;
  for (Watch* watch : {&w, &unaware}) {
    watch->follow(30);
    watch->miss(config.misses_before_search);
  }
  EXPECT_LT(moved_by(w, unaware, 0x0f), 1e-9);
}

// Nor do they tell where its LEDs are: what was learnt from lamps would throw the
// prediction off, the farther the longer ago it was seen.
TEST(RelativeEstimator, LightsThatAreNotConfirmedTeachNothing) {
  Watch w(RelativeEstimatorConfig{}), unaware(RelativeEstimatorConfig{});
  for (Watch* watch : {&w, &unaware}) {
    watch->follow(60);
    watch->miss(100);
    ASSERT_GT(watch->estimator.filter().position_sd(), 0.15);
  }
  for (std::size_t i = 0; i < w.truth.leds.leds.size(); ++i) {
    const auto n = static_cast<double>(i % 3);
    w.truth.leds.leds[i].p_BL += 1e-4 * Vector3(2 * n, 3 - n, -1.5 * n);
  }
  EXPECT_LT(moved_by(w, unaware, 0x1f), 1e-9);
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

/// A drone at rest, and a rig that is not as it was written down.
struct AtRest : Watch {
  explicit AtRest(unsigned seed, const RelativeEstimatorConfig& c = config())
      : Watch(c, alan_rig()) {
    Rng rng(seed);
    for (Led& led : truth.leds.leds) {
      led.p_BL += 0.002 * Vector3(rng.normal(), rng.normal(), rng.normal());
    }
    X_NB_rest = make_pose(
        from_rpy(rng.normal(0, 0.02), rng.normal(0, 0.02), rng.normal(0, 0.05)),
        Vector3(rng.uniform(-0.03, 0.03), rng.uniform(-0.03, 0.03),
                rig.drone.gear_height_m));
    cov.diagonal() << 3.6e-3, 3.6e-3, 1e-5, 3e-3, 3e-3, 3e-2;
  }
  static RelativeEstimatorConfig config() {
    RelativeEstimatorConfig c = RelativeEstimatorConfig::camera_only();
    c.calibrate_at_rest = true;
    return c;
  }
  void expect() {
    estimator.expect(
        make_pose(Matrix3::Identity(), Vector3(0, 0, rig.drone.gear_height_m)), cov);
  }
  int stand(int pictures, unsigned which = 0x3f) {
    int tracked = 0;
    draw(X_NB_rest, which);
    for (int i = 0; i < pictures; ++i) {
      now += kFrame;
      fuse(now);
      tracked += report.tracked;
    }
    return tracked;
  }
  Pose X_NB_rest;
  Matrix6 cov = Matrix6::Zero();
};

// Elsewhere four lights that fit no better would be lamps.
TEST(RelativeEstimator, FourLedsThatAreOffStartADroneWhereItIsKnownToStand) {
  int known = 0, unknown = 0;
  for (const unsigned which : {0x39u, 0x2du}) {
    for (unsigned seed = 1; seed <= 12; ++seed) {
      for (const bool expected : {true, false}) {
        AtRest w(seed);
        if (expected) w.expect();
        w.draw(w.X_NB_rest, which);
        for (int i = 0; i < 10 && !w.estimator.initialized(); ++i) w.again();
        (expected ? known : unknown) += w.estimator.initialized();
      }
    }
  }
  EXPECT_GE(known, 18);
  EXPECT_LE(unknown, 6);
}

// Five LEDs that are off fit a drone that leans otherwise better than the one that
// stands there.
TEST(RelativeEstimator, AtRestADroneIsNotTurnedOverToFitLedsThatAreOff) {
  int upright = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    AtRest w(seed);
    for (int i = 0; i < w.rig.leds.size(); ++i) {
      Vector3& p_BL = w.truth.leds.leds[static_cast<std::size_t>(i)].p_BL;
      p_BL += 0.5 * (p_BL - w.rig.leds.p_BL(i));
    }
    w.cov.diagonal() << 3.6e-3, 3.6e-3, 4e-4, 1.1e-2, 1.1e-2, 3e-2;
    w.expect();
    w.stand(120, 0x1f);
    const Matrix3 R_NB = w.estimator.filter().state().R_NB;
    const double off = so3_log(w.X_NB_rest.linear().transpose() * R_NB).norm();
    upright += w.report.tracked && off < 20 * kDegree;
  }
  EXPECT_GE(upright, 180);  // 160 by the pictures alone
}

// The way it stands is known better than LEDs are that are off: one that misfits is not
// let go, for another to take its light.
TEST(RelativeEstimator, AtRestEveryLedThatIsOffIsSeenInItsOwnLight) {
  for (const unsigned dark : {0u, 0x04u}) {
    int all = 0, others = 0;
    double turned = 0;
    for (unsigned seed = 1; seed <= 200; ++seed) {
      AtRest w(seed, RelativeEstimatorConfig{});
      w.expect();
      w.stand(20, 0x3f & ~dark);
      all += w.report.tracked &&
             std::popcount(0x3f & ~dark) == static_cast<int>(w.report.leds.size());
      for (const LedUse& use : w.report.leds) {
        const int led = std::countr_zero(use.observation.leds);
        const auto uv =
            project_led(w.truth.camera, w.X_NB_rest, w.truth.leds.p_BL(led));
        others += (use.observation.uv - *uv).norm() > 2;
      }
      const Matrix3 R_NB = w.estimator.filter().state().R_NB;
      turned += so3_log(w.X_NB_rest.linear().transpose() * R_NB).norm() / kDegree;
    }
    EXPECT_GE(all, 196) << dark;
    EXPECT_EQ(others, 0) << dark;
    EXPECT_LT(turned / 200, 4) << dark;
  }
}

// Four fit many ways to stand; what six have told is not given up for them.
TEST(RelativeEstimator, AtRestAFewLedsLessChangeNothing) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    AtRest w(seed, RelativeEstimatorConfig{});
    w.expect();
    w.stand(20);
    const Matrix3 R_NB = w.estimator.filter().state().R_NB;
    for (const unsigned left : {0x3bu, 0x3au, 0x38u, 0x3au}) {
      w.stand(10, left);
      const double turned =
          so3_log(R_NB.transpose() * w.estimator.filter().state().R_NB).norm();
      EXPECT_LT(turned, 3 * kDegree) << seed << ' ' << left;
    }
  }
}

TEST(RelativeEstimator, AtRestLampsElsewhereDoNotMatter) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    AtRest w(seed, RelativeEstimatorConfig{});
    Rng rng(seed);
    w.expect();
    w.draw(w.X_NB_rest);
    for (int k = 0; k < 120; ++k) {
      w.picture.add(Vector2(10 + 6.9 * k, rng.uniform(5, 35)), LedColor::white);
    }
    w.now += kFrame;
    w.fuse(w.now);
    EXPECT_TRUE(w.report.tracked) << w.report.why_not;
    EXPECT_EQ(w.report.leds.size(), 6u);
  }
}

// By the lens a few mm are many pixels.
TEST(RelativeEstimator, AllLedsThatAreOffStartADroneWhereItIsKnownToStand) {
  int tracked = 0;
  for (unsigned seed = 1; seed <= 100; ++seed) {
    AtRest w(seed);
    for (int i = 0; i < w.rig.leds.size(); ++i) {
      Vector3& p_BL = w.truth.leds.leds[static_cast<std::size_t>(i)].p_BL;
      p_BL += 0.5 * (p_BL - w.rig.leds.p_BL(i));
    }
    w.expect();
    tracked += w.stand(10) > 0;
  }
  EXPECT_GE(tracked, 99);
}

TEST(RelativeEstimator, AtRestARepeatedPictureIsOneOnlyOfACameraThatHasNoise) {
  RelativeEstimatorConfig config = AtRest::config();
  config.frozen_pictures = 2;
  for (const bool noise : {false, true}) {
    SCOPED_TRACE(noise);
    AtRest w(3, config);
    w.expect();
    w.draw(w.X_NB_rest);
    for (int i = 0; i < 60; ++i) {
      // One pixel far from the LEDs, in a row that is compared.
      if (noise) w.picture.dot(20, 16, static_cast<std::uint8_t>(5 + i % 7));
      w.now += kFrame;
      w.fuse(w.now);
      if (i >= config.search_confirmations) {
        EXPECT_TRUE(w.report.tracked) << i << ": " << w.report.why_not;
      }
    }
    EXPECT_EQ(w.estimator.picture_repeats(), !noise);
    for (int i = 0; i < 10; ++i) {
      w.again();
      EXPECT_EQ(w.report.tracked, !noise) << i;
      EXPECT_EQ(w.estimator.camera_frozen(), noise);
      EXPECT_TRUE(w.estimator.picture_repeats());
    }
    w.picture.dot(20, 16, 90);
    w.now += kFrame;
    w.fuse(w.now);
    EXPECT_TRUE(w.report.tracked) << "it looks again";
  }
}

/// Telemetry tells how the drone leans.
struct Leaning final : MotionSource {
  Matrix3 R_NB = Matrix3::Identity();
  double thrust = 1;  ///< per weight
  PredictionInput at(Time t, const RelativeState&) const override {
    PredictionInput input;
    input.platform.t = t;
    input.lift_N = thrust * R_NB.col(2);
    input.f_N = kGravity * input.lift_N;
    return input;
  }
};

// Found at the start, or again after a second without pictures.
TEST(RelativeEstimator, LightsThatLeanOtherwiseThanTheDroneAreNotIt) {
  const Pose X_NB = Watch::sway(0);
  for (const bool lost : {false, true}) {
    for (const double turn : {0.0, 0.2, 0.5, 1.0, 2.5}) {
      for (const double way : {0.0, 2.0, 4.0}) {
        Watch w(RelativeEstimatorConfig{}, small_rig());
        Leaning motion;
        motion.R_NB = X_NB.linear();
        const auto look = [&] {
          CameraFrame frame;
          frame.captured = frame.received = w.now += kFrame;
          frame.color = w.picture.view();
          w.estimator.fuse(frame, motion, w.report);
          return w.report.tracked;
        };
        w.draw(X_NB);
        for (int i = 0; lost && i < 30; ++i) look();
        ASSERT_EQ(w.report.tracked, lost) << w.report.why_not;
        w.now += from_seconds(1);
        const Vector3 axis(std::cos(way), std::sin(way), 0);
        motion.R_NB = X_NB.linear() * so3_exp(turn * axis);
        int tracked = 0;
        for (int i = 0; i < 5; ++i) tracked += look();
        if (turn < 0.3) {
          EXPECT_GT(tracked, 0) << turn << ": " << w.report.why_not;
        } else {
          EXPECT_EQ(tracked, 0) << turn << (lost ? ", lost" : "");
        }
        // A drone that does not fly leans as it stands.
        motion.thrust = 0.1;
        tracked = 0;
        for (int i = 0; i < 5; ++i) tracked += look();
        EXPECT_GT(tracked, 0) << turn << ": " << w.report.why_not;
      }
    }
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

TEST(RelativeEstimator, FewLampsWhereItMayHaveComeToMustRepeatThemselves) {
  const auto config = Watch::config_for_tests();
  ASSERT_EQ(config.search_leds, 5);
  const unsigned four = 0x2d, five = 0x3d, all = 0x3f;
  for (const unsigned which : {four, five, all}) {
    SCOPED_TRACE(which);
    int pictures = 0;
    Watch w;
    w.follow(60);
    w.picture.clear();
    for (int i = 0; i < 40; ++i) w.fuse(w.now += kFrame);
    for (bool taken = false; !taken && pictures < 20; ++pictures) {
      w.now += kFrame;
      Pose X_NB = Watch::sway(w.now);
      X_NB.translation().y() += 0.3;
      w.draw(X_NB, which);
      w.fuse(w.now);
      taken = w.report.tracked;
    }
    if (which == all) {
      EXPECT_LE(pictures, config.search_confirmations);
    } else {
      EXPECT_GE(pictures, config.search_confirmations);
      EXPECT_LT(pictures, 20);
    }
  }
}

double shape_error(const Constellation& a, const Constellation& b) {
  double sum = 0;
  for (int i = 0; i < a.size(); ++i) {
    for (int j = 0; j < i; ++j) {
      sum +=
          std::pow((a.p_BL(i) - a.p_BL(j)).norm() - (b.p_BL(i) - b.p_BL(j)).norm(), 2);
    }
  }
  return std::sqrt(sum);
}

TEST(RelativeEstimator, MeasuresTheRigAtRestAndGoesOnWithIt) {
  int better = 0, answered = 0;
  double before_px = 0, after_px = 0;
  constexpr int kRigs = 20;
  for (unsigned seed = 0; seed < kRigs; ++seed) {
    SCOPED_TRACE(seed);
    AtRest w(seed);
    w.expect();
    ASSERT_GE(w.stand(40), 35);
    const auto fit = w.estimator.calibrate_at_rest();
    if (!fit) continue;
    before_px += fit->rms_before_px;
    ++answered;
    EXPECT_LT(fit->rms_px, 0.3);
    EXPECT_LT(fit->rms_px, fit->rms_before_px);
    better +=
        shape_error(fit->leds, w.truth.leds) < shape_error(w.rig.leds, w.truth.leds);
    // From where it stands, with the rig as found.
    const RelativeState& x = w.estimator.filter().state();
    EXPECT_TRUE(x.p_NB.isApprox(Vector3(fit->X_NB.translation()), 1e-12));
    EXPECT_EQ(w.estimator.filter().time(), w.now);
    ASSERT_EQ(w.stand(5), 5);
    EXPECT_FALSE(w.report.initialized);
    EXPECT_LT(w.report.reprojection_px, 0.3);
    after_px += w.report.reprojection_px;
    // Once found the rig is the filter's: where it stands fits.
    EXPECT_LT((w.report.x.p_NB - fit->X_NB.translation()).norm(), 0.003);
  }
  EXPECT_EQ(answered, kRigs);
  EXPECT_GE(better, kRigs - 3);
  EXPECT_LT(after_px, 0.5 * before_px);
}

TEST(RelativeEstimator, MeasuresNothingItHasNotSeenLongEnough) {
  {
    AtRest never_told(1);
    never_told.stand(40);
    EXPECT_EQ(never_told.estimator.calibrate_at_rest().error().fault,
              Fault::too_few_points);
  }
  {
    AtRest short_look(1);
    short_look.expect();
    short_look.stand(AtRest::config().rest_pictures - 5);
    EXPECT_EQ(short_look.estimator.calibrate_at_rest().error().fault,
              Fault::too_few_points);
    // Told anew, it begins anew.
    short_look.expect();
    short_look.stand(10);
    EXPECT_EQ(short_look.estimator.calibrate_at_rest().error().fault,
              Fault::too_few_points);
    short_look.stand(AtRest::config().rest_pictures);
    EXPECT_TRUE(short_look.estimator.calibrate_at_rest());
  }
  {
    AtRest unseen(1);
    unseen.expect();
    unseen.picture.clear();
    for (int i = 0; i < 40; ++i) unseen.fuse(unseen.now += kFrame);
    EXPECT_EQ(unseen.estimator.calibrate_at_rest().error().fault,
              Fault::too_few_points);
  }
  {
    RelativeEstimatorConfig off = AtRest::config();
    off.calibrate_at_rest = false;
    AtRest w(1);
    w.estimator = RelativeEstimator::create(off, w.rig).value();
    w.expect();
    w.stand(40);
    EXPECT_FALSE(w.estimator.calibrate_at_rest());
  }
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
