#include <bit>
#include <cmath>
#include <cstdint>

#include "alight/base/rng.h"
#include "alight/mission/test/watch.h"

namespace alight {
namespace {

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
  /// LEDs are off by so many times as much.
  void misplace(double times) {
    for (int i = 0; i < rig.leds.size(); ++i) {
      Vector3& p_BL = truth.leds.leds[static_cast<std::size_t>(i)].p_BL;
      p_BL += (times - 1) * (p_BL - rig.leds.p_BL(i));
    }
  }
  /// LEDs that are said to be where there are others.
  int mistaken() const {
    int out = 0;
    for (const LedUse& use : report.leds) {
      const int led = std::countr_zero(use.observation.leds);
      const auto uv = project_led(truth.camera, X_NB_rest, truth.leds.p_BL(led));
      out += (use.observation.uv - *uv).norm() > 2;
    }
    return out;
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
    w.misplace(1.5);
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
      others += w.mistaken();
      const Matrix3 R_NB = w.estimator.filter().state().R_NB;
      turned += so3_log(w.X_NB_rest.linear().transpose() * R_NB).norm() / kDegree;
    }
    EXPECT_GE(all, 196) << dark;
    EXPECT_EQ(others, 0) << dark;
    EXPECT_LT(turned / 200, 4) << dark;
  }
}

// Hand-built drones are off by 4 mm; taken for its neighbour, an LED there has one take
// off by a rig that is none.
TEST(RelativeEstimator, AtRestLedsThatAreOffByTwiceAsMuchAreNotTakenForOthers) {
  int all = 0, others = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    AtRest w(seed, RelativeEstimatorConfig{});
    w.misplace(2);
    w.expect();
    w.stand(20);
    all += w.report.tracked && w.report.leds.size() == 6;
    others += w.mistaken() > 0;
  }
  EXPECT_GE(all, 170);
  EXPECT_LE(others, 2);
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
      if (noise) w.picture.dot(20, 120, static_cast<std::uint8_t>(5 + i % 7));
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
    w.picture.dot(20, 120, 90);
    w.now += kFrame;
    w.fuse(w.now);
    EXPECT_TRUE(w.report.tracked) << "it looks again";
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

// One side has shown where its LEDs are across the line of sight, but not along it.
TEST(RelativeEstimator, MeasuredAtRestItsLedsGoOnBeingLearntInFlight) {
  double swings = 0;
  constexpr int kRigs = 12;
  for (unsigned seed = 1; seed <= kRigs; ++seed) {
    SCOPED_TRACE(seed);
    AtRest w(seed);
    w.expect();
    w.stand(40);
    ASSERT_TRUE(w.estimator.calibrate_at_rest());
    w.estimator.expect_nothing();
    Vector3 sum = Vector3::Zero();
    double square = 0;
    constexpr int kPictures = 480, kLast = 240;
    for (int k = 0; k < kPictures; ++k) {
      const double s = k / 60.0;
      const Vector3 way(-0.25 - 0.15 * std::cos(s), 0.15 * std::sin(1.3 * s), 0.3);
      const Pose X_NB = make_pose(from_rpy(0.2 * std::sin(1.7 * s), 0.25 * std::sin(s),
                                           0.3 * std::sin(0.8 * s)),
                                  w.X_NB_rest.translation() + std::min(s, 1.0) * way);
      w.draw(X_NB);
      w.again();
      if (k < kPictures - kLast) continue;
      ASSERT_TRUE(w.report.tracked) << k << ": " << w.report.why_not;
      const Vector3 off =
          so3_log(X_NB.linear().transpose() * w.report.x.R_NB) / kDegree;
      sum += off / kLast;
      square += off.squaredNorm() / kLast;
    }
    // How far it is turned all the time is that of the LEDs as a whole.
    swings += (square - sum.squaredNorm()) / kRigs;
  }
  EXPECT_LT(std::sqrt(swings), 0.5);  // deg
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

}  // namespace
}  // namespace alight
