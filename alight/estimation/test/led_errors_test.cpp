#include "alight/estimation/led_errors.h"

#include <Eigen/Cholesky>

#include "alight/estimation/test/flight.h"

namespace alight::test {
namespace {

constexpr int kRuns = 200;
constexpr double kLedSd = 0.002, kPixelSd = 0.2;
constexpr LedErrorsConfig kBelieveAll{.share = 1, .memory_s = 1e6};

/// A filter that believes its pictures, and the LEDs it flies with.
struct Aloft {
  static RelativeFilterConfig with(double led_sd_m, double aspect_sd_m) {
    RelativeFilterConfig c;
    c.pixel_sd_px = 0;  // the pictures carry what they say
    c.gate_chi2 = 0;
    c.huber_sd = 0;
    c.mount_position_sd_m = c.mount_rotation_sd_rad = c.focal_sd_share = 0;
    c.led_position_sd_m = led_sd_m;
    c.led_aspect_sd_m = aspect_sd_m;
    return c;
  }

  RelativeFilterConfig config;
  Rig rig = alan_rig();
  Constellation truth_leds = rig.leds;
  Rng rng;
  RelativeFilter filter;
  LedErrors errors;
  MotionState truth{Flight{}.state(0)};
  Flight flight;

  Aloft(int run, bool learns, double led_sd_m = kLedSd,
        const LedErrorsConfig& learning = {}, double aspect_sd_m = 0.0003)
      : config(with(led_sd_m, aspect_sd_m)),
        rng(Rng(static_cast<std::uint64_t>(run)).fork("led_errors")),
        filter(RelativeFilter::create(config, rig.camera, rig.leds).value()),
        errors(learning, rig.leds, led_sd_m),
        learns_(learns) {
    for (Led& led : truth_leds.leds) led.p_BL += normal3(rng, led_sd_m);
    truth.d_N = normal3(rng, config.disturbance_sd);
    truth.b_N = normal3(rng, config.bias_sd);
    Vector9 off;
    for (int i = 0; i < 9; ++i) {
      off[i] = rng.normal(0, std::sqrt(start_covariance()(i, i)));
    }
    filter.correct_leds(errors.leds(), errors.cov());
    filter.reset(0, boxplus(truth.x, off), start_covariance());
  }

  /// `seen`: bit i: LED i is in the picture.
  void fly(int frames, unsigned seen = 0x3f) {
    for (int k = 0; k < frames; ++k) {
      const Time t = filter.time() + 16'666'667;
      const auto input = flight.input(to_seconds(t));
      const Seconds dt = to_seconds(t - filter.time());
      truth = moved_by_model(truth, input, dt, config, rng);
      ASSERT_TRUE(filter.predict_to(t, input).has_value());
      LedFrame frame =
          picture(rig.camera, truth_leds, truth.x.X_NB(), t, kPixelSd, rng);
      LedFrame left;
      left.t = t;
      for (const LedObservation& o : frame.seen) {
        if (o.leds & seen) left.seen.push_back(o);
      }
      LedInformation told;
      // Some are blown out of the picture.
      if (!filter.update(left, 0, &told) || !learns_) continue;
      ASSERT_TRUE(errors.add(told, dt));
      filter.correct_leds(errors.leds(), errors.cov());
    }
  }

  Vector9 error() const { return boxminus(filter.state(), truth.x); }
  Eigen::VectorXd led_error() const {
    Eigen::VectorXd e(3 * truth_leds.size());
    for (int i = 0; i < truth_leds.size(); ++i) {
      e.segment<3>(3 * i) = errors.leds().p_BL(i) - truth_leds.p_BL(i);
    }
    return e;
  }

 private:
  bool learns_;
};

double bound(int dof, double sign) {
  return dof + sign * 2.58 * std::sqrt(2.0 * dof / kRuns);
}

struct Nees {
  double state = 0, leds = 0;
};

template <class Begin>
Nees mean_nees(Begin&& begin, int frames) {
  Nees mean;
  for (int k = 0; k < kRuns; ++k) {
    Aloft run = begin(k);
    run.fly(frames);
    const Vector9 e = run.error();
    mean.state += e.dot(run.filter.covariance().llt().solve(e)) / kRuns;
    const Eigen::VectorXd d = run.led_error();
    const Eigen::MatrixXd cov = run.errors.cov();
    mean.leds += d.dot(cov.llt().solve(d)) / kRuns;
  }
  return mean;
}

// LEDs that are hardly off leave everything linear: then it is the filter with the LEDs
// in its state, and as sure as that.
TEST(LedErrors, StateAndLedsAreAsUncertainAsSaid) {
  for (const int frames : {10, 60}) {
    const Nees nees = mean_nees(
        [](int k) { return Aloft(k, true, 0.0002, kBelieveAll, 1e-9); }, frames);
    EXPECT_GT(nees.state, bound(9, -1));
    EXPECT_LT(nees.state, bound(9, 1));
    EXPECT_GT(nees.leds, bound(18, -1));
    EXPECT_LT(nees.leds, bound(18, 1));
  }
}

// With LEDs as far off as people mount them it is not linear: it believes so little of
// each picture that it is never surer than it may be.
TEST(LedErrors, NeverTooSureOfLedsThatAreFarOff) {
  for (const int frames : {1, 10, 60, 180}) {
    const Nees nees = mean_nees([](int k) { return Aloft(k, true); }, frames);
    EXPECT_LT(nees.state, bound(9, 1)) << frames;
    EXPECT_LT(nees.leds, bound(18, 1)) << frames;
  }
}

// What six LEDs have told holds when three are left.
TEST(LedErrors, FewLedsMakeNoSpeed) {
  double with = 0, without = 0;
  for (int k = 0; k < 60; ++k) {
    for (const bool learns : {true, false}) {
      Aloft run(k, learns);
      run.fly(60);
      run.fly(10, 0x15);
      (learns ? with : without) += run.error().tail<3>().squaredNorm();
    }
  }
  EXPECT_LT(with, 0.6 * without);
}

TEST(LedErrors, LedsThatNobodyMountsAreNotLearnt) {
  const Rig rig = alan_rig();
  const Eigen::Index n = 3 * rig.leds.size();
  LedErrors errors({}, rig.leds, kLedSd);
  LedInformation told{LedCovariance::Identity(n, n) * 1e8,
                      LedVector::Constant(n, 1e8 * 0.05)};
  EXPECT_FALSE(errors.add(told, 0));
  for (int i = 0; i < rig.leds.size(); ++i) {
    EXPECT_EQ(errors.leds().p_BL(i), rig.leds.p_BL(i));
  }
  // Two sd of each are possible.
  told.vector.setConstant(1e8 * 0.004);
  EXPECT_TRUE(errors.add(told, 0));
  EXPECT_NEAR(errors.leds().p_BL(0).x() - rig.leds.p_BL(0).x(), 0.004, 1e-4);
}

TEST(LedErrors, WhatIsNotConfirmedIsForgotten) {
  const Rig rig = alan_rig();
  const Eigen::Index n = 3 * rig.leds.size();
  LedErrors errors({.share = 1, .memory_s = 1}, rig.leds, kLedSd);
  const LedInformation told{LedCovariance::Identity(n, n) * 1e8,
                            LedVector::Constant(n, 1e8 * 0.002)};
  const LedInformation nothing{LedCovariance::Zero(n, n), LedVector::Zero(n)};
  ASSERT_TRUE(errors.add(told, 0));
  const double sd = std::sqrt(errors.cov()(0, 0));
  EXPECT_NEAR(sd, 1e-4, 1e-5);
  for (int k = 0; k < 100; ++k) ASSERT_TRUE(errors.add(nothing, 0.2));
  EXPECT_NEAR(std::sqrt(errors.cov()(0, 0)), kLedSd, 1e-5);
  EXPECT_NEAR((errors.leds().p_BL(0) - rig.leds.p_BL(0)).norm(), 0, 1e-5);
}

TEST(LedErrors, ConfigIsChecked) {
  EXPECT_TRUE(LedErrorsConfig{}.validate());
  EXPECT_FALSE((LedErrorsConfig{.share = 0}).validate());
  EXPECT_FALSE((LedErrorsConfig{.memory_s = 0}).validate());
  EXPECT_FALSE((LedErrorsConfig{.most_sds = 0}).validate());
}

}  // namespace
}  // namespace alight::test
