#include <Eigen/Eigenvalues>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include "alight/base/rng.h"
#include "alight/mission/test/watch.h"

namespace alight {
namespace {

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

// From afar some of the five that are left run together, and a sixth that stood beside
// one of them would change its blob by little.
TEST(RelativeEstimator, WithAnyLedDeadItStartsFromOnePicture) {
  Rng rng(11);
  int flights = 0, at_once = 0, run_together = 0;
  for (int n = 0; n < 120; ++n) {
    Watch w;
    const auto dead = static_cast<std::size_t>(n % 6);
    const Pose X_NB =
        make_pose(from_rpy(rng.uniform(-0.15, 0.15), rng.uniform(-0.15, 0.15),
                           rng.uniform(-0.4, 0.4)),
                  Vector3(rng.uniform(-2.5, -1.7), rng.uniform(-0.3, 0.3),
                          rng.uniform(0.4, 0.8)));
    std::vector<Vector2> lit;
    bool in_view = true;
    for (int i = 0; i < w.truth.leds.size(); ++i) {
      const auto uv = project_led(w.truth.camera, X_NB, w.truth.leds.p_BL(i));
      in_view = in_view && uv && w.truth.camera.intrinsics.contains(*uv, 20);
      if (!uv || static_cast<std::size_t>(i) == dead) continue;
      w.picture.add(*uv, w.truth.leds.color(i), 220, 0.9);
      lit.push_back(*uv);
    }
    if (!in_view) continue;
    ++flights;
    bool near = false;
    for (std::size_t i = 0; i < lit.size(); ++i) {
      for (std::size_t k = 0; k < i; ++k) near = near || (lit[i] - lit[k]).norm() < 3.5;
    }
    run_together += near;
    ASSERT_TRUE(w.again());
    at_once += w.report.tracked;
    if (!w.report.tracked) continue;
    EXPECT_LT((w.report.x.p_NB - X_NB.translation()).norm(), 0.05) << n;
    EXPECT_LT(angle_between(w.report.x.R_NB, Matrix3(X_NB.linear())), 5 * kDegree) << n;
  }
  EXPECT_GT(flights, 60);
  EXPECT_GT(run_together, flights / 3);
  EXPECT_GE(at_once, 0.78 * flights);
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

}  // namespace
}  // namespace alight
