#include "alight/estimation/relative_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "alight/estimation/test/flight.h"

namespace alight::test {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Bench {
  Rig rig = alan_rig();
  Flight flight;
  Rng rng{9};
  RelativeFilter filter;

  explicit Bench(const RelativeFilterConfig& config = {})
      : filter(RelativeFilter::create(config, rig.camera, rig.leds).value()) {
    filter.reset(0, flight.state(0), start_covariance());
  }
  Time time(int k) const { return from_seconds(k / 60.0); }
  LedFrame frame(int k) {
    return picture(rig.camera, rig.leds, truth(k).X_NB(), time(k), 0.2, rng);
  }
  RelativeState truth(int k) const { return flight.state(to_seconds(time(k))); }
  bool predict(int k) {
    return filter.predict_to(time(k), flight.input((k - 0.5) / 60)).has_value();
  }
  void run(int from, int to) {
    for (int k = from; k <= to; ++k) {
      ASSERT_TRUE(predict(k));
      ASSERT_TRUE(filter.update(frame(k)).has_value());
    }
  }
};

Fault fault_of(const Result<UpdateReport>& result) {
  return result ? Fault::io : result.error().fault;  // io: none of the filter's
}

void expect_sound(const RelativeFilter& filter) {
  const RelativeState& x = filter.state();
  ASSERT_TRUE(x.p_NB.allFinite() && x.R_NB.allFinite() && x.v_NB.allFinite());
  ASSERT_TRUE(filter.disturbance_N().allFinite());
  EXPECT_LT((x.R_NB.transpose() * x.R_NB - Matrix3::Identity()).norm(), 1e-9);
  EXPECT_EQ(filter.tracking_covariance().llt().info(), Eigen::Success);
  EXPECT_EQ(filter.covariance().llt().info(), Eigen::Success);
}

TEST(RelativeFilter, NeedsResetFirst) {
  const Rig rig = alan_rig();
  auto filter = RelativeFilter::create({}, rig.camera, rig.leds).value();
  EXPECT_FALSE(filter.initialized());
  EXPECT_FALSE(filter.predict_to(1, {}).has_value());
  EXPECT_EQ(fault_of(filter.update(LedFrame{})), Fault::invalid_input);
}

TEST(RelativeFilter, RefusesTooFewLeds) {
  const Rig rig = alan_rig();
  Constellation two;
  two.leds.push_back(rig.leds.leds[0]);
  two.leds.push_back(rig.leds.leds[1]);
  const auto filter = RelativeFilter::create({}, rig.camera, two);
  ASSERT_FALSE(filter.has_value());
  EXPECT_EQ(filter.error().fault, Fault::too_few_points);
}

// LEDs that are off as a whole are taken for a drone that is elsewhere: as far off as
// the covariance has it, it shows the same picture.
TEST(RelativeFilter, LedsThatAreOffAsAWholeMoveThePoseAsTold) {
  constexpr double kOff[3] = {1e-4, 1e-3, 1e-3};  // m, rad, share
  for (int which = 0; which < 7; ++which) {
    LedFrameSpec frame;
    const int kind = which / 3, axis = which % 3;
    if (kind == 0) frame.shift_sd_m[axis] = kOff[0];
    if (kind == 1) frame.turn_sd_rad[axis] = kOff[1];
    if (kind == 2) frame.size_sd = kOff[2];
    auto config = RelativeFilterConfig{}.with_perfect_rig();
    const Bench exact(config);
    config.led_frame = frame;
    const Bench b(config);
    const Covariance9 more = b.filter.covariance() - exact.filter.covariance();
    EXPECT_EQ(b.filter.tracking_covariance(), exact.filter.tracking_covariance());
    Eigen::Index k = 0;
    const double most = more.diagonal().maxCoeff(&k);
    ASSERT_GT(most, 0);
    const Eigen::Matrix<double, 6, 1> sd = (more.col(k) / std::sqrt(most)).head<6>();

    const Constellation& leds = b.rig.leds;
    const Vector3 middle = leds.middle_B();
    const Matrix3 turn = so3_exp(frame.turn_sd_rad);
    const Pose X_NB = b.filter.state().X_NB();
    double best = 1e9, unmoved = 0;
    for (const double sign : {1.0, -1.0}) {
      const Pose X_NB_taken = make_pose(X_NB.linear() * so3_exp(sign * sd.tail<3>()),
                                        X_NB.translation() + sign * sd.head<3>());
      double worst = 0;
      for (int i = 0; i < leds.size(); ++i) {
        const Vector3 p_BL = middle + frame.shift_sd_m +
                             (1 + frame.size_sd) * (turn * (leds.p_BL(i) - middle));
        const Vector2 seen = *project_led(b.rig.camera, X_NB, p_BL);
        const Vector2 taken = *project_led(b.rig.camera, X_NB_taken, leds.p_BL(i));
        worst = std::max(worst, (seen - taken).norm());
        unmoved = std::max(
            unmoved, (seen - *project_led(b.rig.camera, X_NB, leds.p_BL(i))).norm());
      }
      best = std::min(best, worst);
    }
    EXPECT_LT(best, 0.02 * unmoved) << which;
  }
}

// Shifted, it is what a prediction without noise says; shifted back, what it was.
TEST(RelativeFilter, ShiftIsAPredictionWithoutNoiseThatCanBeUndone) {
  RelativeFilterConfig quiet;
  quiet.noise = {.rate = 1e-7,
                 .acceleration = 1e-7,
                 .disturbance = 0,
                 .updraught = 0,
                 .bias = 0,
                 .thrust = 0,
                 .turn = 0};
  quiet.variance_per_frame = 0;
  for (const bool turns : {false, true}) {
    RelativeFilterConfig config = turns ? RelativeFilterConfig{} : quiet;
    if (turns) config.noise.turn = 3;
    Bench b(config);
    b.run(1, 20);
    const PredictionInput input = b.flight.input(20.5 / 60);
    const Covariance9 P = b.filter.covariance();
    const RelativeState x = b.filter.state();
    RelativeFilter shifted = b.filter;
    for (const Seconds dt : {0.008, -0.008}) {
      shifted.shift(dt, input);
      EXPECT_EQ(shifted.time(), b.filter.time());
      expect_sound(shifted);
      EXPECT_GT(boxminus(shifted.state(), x).norm(), 1e-3);
      if (!turns && dt > 0) {
        RelativeFilter later = b.filter;
        ASSERT_TRUE(later.predict_to(later.time() + from_seconds(dt), input));
        EXPECT_LT(boxminus(shifted.state(), later.state()).norm(), 1e-9);
        EXPECT_LT((shifted.covariance() - later.covariance()).norm(), 1e-9 * P.norm());
      }
      shifted.shift(-dt, input);
      EXPECT_LT(boxminus(shifted.state(), x).norm(), 1e-5);
      EXPECT_LT((shifted.covariance() - P).norm(), 1e-4 * P.norm());
    }
    const RelativeState before = shifted.state();
    shifted.shift(kNaN, input);
    EXPECT_EQ(boxminus(shifted.state(), before).norm(), 0);
  }
}

TEST(RelativeFilter, RefusesPicturesThatAreNotOfItsTime) {
  Bench b;
  b.run(1, 10);
  const auto before = b.filter.state();
  EXPECT_EQ(fault_of(b.filter.update(b.frame(10))), Fault::invalid_input);  // repeated
  EXPECT_EQ(fault_of(b.filter.update(b.frame(8))), Fault::invalid_input);   // late
  EXPECT_EQ(fault_of(b.filter.update(b.frame(12))), Fault::invalid_input);  // early
  EXPECT_EQ(boxminus(before, b.filter.state()).norm(), 0);
  EXPECT_FALSE(b.filter.predict_to(b.time(9), {}).has_value());
  EXPECT_TRUE(b.filter.predict_to(b.time(10), {}).has_value());  // nothing to do
  EXPECT_EQ(boxminus(before, b.filter.state()).norm(), 0);
}

TEST(RelativeFilter, RefusesInputsThatAreNotFinite) {
  Bench b;
  b.run(1, 5);
  for (int field = 0; field < 5; ++field) {
    auto u = b.flight.input(0.1);
    if (field == 0) u.f_N.x() = kNaN;
    if (field == 1) u.w_NB_B.y() = kNaN;
    if (field == 2) u.platform.w_IN_N.z() = kNaN;
    if (field == 3) u.platform.X_IN.linear()(0, 0) = kNaN;
    if (field == 4) u.f_N.z() = 1e300 * 1e300;
    EXPECT_FALSE(b.filter.predict_to(b.time(6), u).has_value()) << field;
    EXPECT_EQ(b.filter.time(), b.time(5));
  }
  expect_sound(b.filter);
}

TEST(RelativeFilter, SplittingAPredictionChangesLittle) {
  Bench a, b;
  a.run(1, 30);
  b.run(1, 30);
  const auto input = a.flight.input(0.5);
  ASSERT_TRUE(a.filter.predict_to(a.time(31), input).has_value());
  ASSERT_TRUE(
      b.filter.predict_through(b.time(31), 1'000'000, [&](Time) { return input; })
          .has_value());
  EXPECT_EQ(a.filter.time(), b.filter.time());
  EXPECT_LT(boxminus(a.filter.state(), b.filter.state()).norm(), 1e-4);
  const Covariance9 P = a.filter.tracking_covariance();
  EXPECT_LT((P - b.filter.tracking_covariance()).norm(), 1e-2 * P.norm());
}

TEST(RelativeFilter, AWrongBlobIsGatedAndTheRestUsed) {
  Bench b;
  b.run(1, 60);
  for (std::size_t wrong = 0; wrong < 6; ++wrong) {
    Bench c = b;
    ASSERT_TRUE(c.predict(61));
    auto frame = c.frame(61);
    frame.seen[wrong].uv += Vector2(25, 10);
    const auto report = c.filter.update(frame);
    ASSERT_TRUE(report.has_value());
    EXPECT_EQ(report->used, 5);
    EXPECT_EQ(report->gated, 1);
    ASSERT_EQ(report->refused.size(), 1u);
    EXPECT_EQ(report->refused[0].reason, Refusal::gated);
    EXPECT_EQ(report->refused[0].uv, frame.seen[wrong].uv);
    EXPECT_LT((c.filter.state().p_NB - c.truth(61).p_NB).norm(), 0.03);
  }
}

// While its pose is vague a light that stands 3 px off is probable; the others tell.
TEST(RelativeFilter, OneThatContradictsTheOthersIsLeftOutHoweverProbable) {
  Rng rng(21);
  constexpr double kMisfit_px = 0.5;
  double with_m = 0, without_m = 0;
  int runs = 0, left_out = 0, sound_left_out = 0, too_few = 0, told = 0;
  for (; runs < 200; ++runs) {
    const Bench b(RelativeFilterConfig{}.with_perfect_rig());
    RelativeFilter filter = b.filter;
    const RelativeState x = b.truth(0);
    RelativeState vague = x;
    vague.p_NB += normal3(rng, 0.03);
    vague.R_NB = vague.R_NB * so3_exp(normal3(rng, 0.06));
    Covariance9 cov = Covariance9::Identity();
    cov.diagonal() << Vector3::Constant(9e-4), Vector3::Constant(3.6e-3),
        Vector3::Constant(0.01);
    filter.reset(0, vague, cov);
    LedFrame frame = picture(b.rig.camera, b.rig.leds, x.X_NB(), 0, 0.1, rng);
    RelativeFilter sound = filter;
    const auto plain = sound.update(frame, 0, nullptr, kMisfit_px);
    ASSERT_TRUE(plain);
    sound_left_out += plain->used < 6;
    const std::size_t wrong = static_cast<std::size_t>(runs) % 6;
    const double turn = rng.uniform(0, 2 * kPi);
    const Vector2 off(3 * std::cos(turn), 3 * std::sin(turn));
    frame.seen[wrong].uv += off;
    const RelativeFilter clean = filter;
    RelativeFilter believing = filter, strict = filter;
    ASSERT_TRUE(believing.update(frame).has_value());
    with_m += (believing.state().p_NB - x.p_NB).norm();
    too_few +=
        fault_of(strict.update(frame, 6, nullptr, kMisfit_px)) == Fault::ambiguous;
    const auto report = filter.update(frame, 0, nullptr, kMisfit_px);
    ASSERT_TRUE(report);
    without_m += (filter.state().p_NB - x.p_NB).norm();
    EXPECT_EQ(report->used, static_cast<int>(report->seen.size()));
    const auto is_wrong = [&](const RefusedBlob& r) {
      return r.uv == frame.seen[wrong].uv && r.reason == Refusal::off_constellation;
    };
    left_out += std::any_of(report->refused.begin(), report->refused.end(), is_wrong);
    // Two of them are not told: the picture contradicts itself.
    frame.seen[(wrong + 1) % 6].uv += off;
    RelativeFilter with_two = clean;
    const auto two = with_two.update(frame, 0, nullptr, kMisfit_px);
    ASSERT_TRUE(two);
    told += two->contradicts || two->used < 6;
  }
  EXPECT_GE(left_out, 0.97 * runs);
  EXPECT_GE(too_few, 0.97 * runs);
  EXPECT_GE(told, 0.8 * runs);
  EXPECT_EQ(sound_left_out, 0);
  EXPECT_LT(without_m, 0.5 * with_m);
}

// LEDs of a rig that may be off by as much contradict nobody.
TEST(RelativeFilter, LedsThatAreOffAsTheyMayBeAreNotLeftOut) {
  Rng rng(22);
  int left_out = 0, contradicting = 0;
  constexpr int kRuns = 200;
  for (int run = 0; run < kRuns; ++run) {
    const Bench b;  // led_position_sd_m 2 mm: 1 px and more at that range
    Constellation truth = b.rig.leds;
    for (Led& led : truth.leds) led.p_BL += normal3(rng, 0.002);
    RelativeFilter filter = b.filter;
    LedFrame frame = picture(b.rig.camera, truth, b.truth(0).X_NB(), 0, 0.05, rng);
    const auto report = filter.update(frame, 0, nullptr, 0.25);
    ASSERT_TRUE(report);
    left_out += report->used < 6;
    contradicting += report->contradicts;
  }
  EXPECT_LE(left_out, 0.02 * kRuns);
  EXPECT_LE(contradicting, 0.02 * kRuns);
}

TEST(RelativeFilter, AContradictionIsReportedAndThePredictionStands) {
  Bench b;
  b.run(1, 60);
  ASSERT_TRUE(b.predict(61));
  const auto before = b.filter.state();
  const Covariance9 P = b.filter.covariance();
  auto frame = b.frame(61);
  for (auto& o : frame.seen) o.uv.x() += 40;
  EXPECT_EQ(fault_of(b.filter.update(frame)), Fault::ambiguous);
  EXPECT_EQ(boxminus(before, b.filter.state()).norm(), 0);
  EXPECT_EQ(P, b.filter.covariance());
  EXPECT_EQ(b.filter.last_report().gated, 6);
  EXPECT_EQ(b.filter.last_report().refused.size(), 6u);
}

TEST(RelativeFilter, AnEmptyPictureIsTooFewPoints) {
  Bench b;
  ASSERT_TRUE(b.predict(1));
  LedFrame empty;
  empty.t = b.time(1);
  EXPECT_EQ(fault_of(b.filter.update(empty)), Fault::too_few_points);
}

TEST(RelativeFilter, MalformedObservationsAreLeftOut) {
  Bench b;
  b.run(1, 20);
  ASSERT_TRUE(b.predict(21));
  auto frame = b.frame(21);
  frame.seen[0].uv.x() = kNaN;
  frame.seen[1].cov(0, 0) = kNaN;
  frame.seen[2].cov = -Matrix2::Identity();
  frame.seen[3].leds = 1u << 9;  // no such LED
  frame.seen[4].depth_m = kNaN;  // not used here
  const auto report = b.filter.update(frame);
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->malformed, 4);
  EXPECT_EQ(report->used, 2);
  expect_sound(b.filter);
}

TEST(RelativeFilter, ReportsResiduals) {
  Bench b;
  b.run(1, 30);
  ASSERT_TRUE(b.predict(31));
  const auto report = b.filter.update(b.frame(31));
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->used, 6);
  EXPECT_TRUE(report->converged);
  double sum = 0;
  for (const auto& o : report->seen) {
    sum += o.residual_px.squaredNorm();
    EXPECT_GE(o.nis, 0);
  }
  EXPECT_NEAR(report->reprojection_px, std::sqrt(sum / 6), 1e-12);
  EXPECT_LT(report->reprojection_px, 1);
}

TEST(RelativeFilter, BlindnessLowersConfidenceAndSightRestoresIt) {
  Bench b;
  b.run(1, 60);
  const double seeing = b.filter.position_sd();
  const double yaw = b.filter.yaw_sd();
  for (int k = 61; k <= 120; ++k) ASSERT_TRUE(b.predict(k));
  EXPECT_GT(b.filter.position_sd(), 10 * seeing);
  EXPECT_GT(b.filter.yaw_sd(), yaw);
  EXPECT_LT((b.filter.state().p_NB - b.truth(120).p_NB).norm(),
            4 * b.filter.position_sd());
  b.run(121, 150);
  EXPECT_LT(b.filter.position_sd(), 1.5 * seeing);
  EXPECT_LT((b.filter.state().p_NB - b.truth(150).p_NB).norm(), 0.03);
}

// Against the information form, and nothing but finite numbers counts.
TEST(RelativeFilter, AVelocityThatIsToldIsWeighedByItsNoise) {
  Bench b;
  b.run(1, 60);
  ASSERT_TRUE(b.filter.predict_to(b.time(63), b.flight.input(61.5 / 60)));
  const RelativeState x = b.filter.state();
  const Covariance9 P = b.filter.tracking_covariance();
  const Vector3 told = x.v_NB + Vector3(0.3, -0.2, 0.1);
  b.filter.update_velocity(Vector3(kNaN, 0, 0), 0.1);
  b.filter.update_velocity(told, kNaN);
  b.filter.update_velocity(told, 0);
  EXPECT_EQ(boxminus(b.filter.state(), x).norm(), 0);
  EXPECT_EQ((b.filter.tracking_covariance() - P).norm(), 0);

  const double sd = 0.2;
  b.filter.update_velocity(told, sd);
  Covariance9 information = P.inverse();
  information.bottomRightCorner<3, 3>().diagonal().array() += 1 / (sd * sd);
  const Covariance9 P_after = information.inverse();
  const Vector9 change = P_after.rightCols<3>() * (told - x.v_NB) / (sd * sd);
  EXPECT_LT((boxminus(b.filter.state(), x) - change).norm(), 1e-8);
  EXPECT_LT((b.filter.tracking_covariance() - P_after).norm(), 1e-8 * P.norm());
  expect_sound(b.filter);
}

TEST(RelativeFilter, APoseThatIsToldIsWeighedAgainstWhatIsKnown) {
  Bench b;
  b.run(1, 30);
  const RelativeState x = b.filter.state();
  const Covariance9 P = b.filter.tracking_covariance();
  Vector9 off = Vector9::Zero();
  off.head<6>() << 0.01, -0.006, 0.004, 0.02, -0.01, 0.03;
  const Pose told = boxplus(x, off).X_NB();
  Eigen::Matrix<double, 6, 6> R = 4e-4 * Eigen::Matrix<double, 6, 6>::Identity();
  R(0, 3) = R(3, 0) = 1e-4;
  Pose broken = told;
  broken.translation().x() = kNaN;
  b.filter.update_pose(broken, R);
  b.filter.update_pose(told, kNaN * R);
  EXPECT_EQ(boxminus(b.filter.state(), x).norm(), 0);
  EXPECT_EQ((b.filter.tracking_covariance() - P).norm(), 0);

  b.filter.update_pose(told, R);
  Covariance9 information = P.inverse();
  information.topLeftCorner<6, 6>() += R.inverse();
  const Covariance9 P_after = information.inverse();
  const Vector9 change = P_after.leftCols<6>() * R.inverse() * off.head<6>();
  EXPECT_LT((boxminus(b.filter.state(), x) - change).norm(), 1e-8);
  EXPECT_LT((b.filter.tracking_covariance() - P_after).norm(), 1e-8 * P.norm());
  expect_sound(b.filter);
}

// By every configuration, that which estimates the rate of turn, too.
TEST(RelativeFilter, VelocitiesThatAreToldLeaveItSound) {
  for (const auto& config : {RelativeFilterConfig{}, RelativeFilterConfig::paper(),
                             RelativeFilterConfig::camera_only()}) {
    Bench b(config);
    b.run(1, 30);
    for (int k = 31; k <= 90; ++k) {
      ASSERT_TRUE(b.predict(k));
      b.filter.update_velocity(b.truth(k).v_NB, 0.3);
      expect_sound(b.filter);
      EXPECT_LT((b.filter.state().v_NB - b.truth(k).v_NB).norm(), 1) << k;
    }
    b.run(91, 120);
    EXPECT_LT((b.filter.state().p_NB - b.truth(120).p_NB).norm(), 0.03);
  }
}

// A wind that nobody tells of: 1.5 s without a picture.
TEST(RelativeFilter, VelocitiesCarryABlindDroneThroughAWind) {
  const Vector3 wind_N(0.6, -0.4, 0.3);  // m/s^2, not in the inputs
  double off_m[2], learnt[2];
  for (const bool told : {false, true}) {
    Bench b;
    b.run(1, 60);
    MotionState blown;
    blown.x = b.truth(60);
    blown.d_N = wind_N;
    for (int k = 61; k <= 150; ++k) {
      ASSERT_TRUE(b.predict(k));
      blown = extrapolate(blown, b.flight.input((k - 0.5) / 60), 1.0 / 60);
      if (told) b.filter.update_velocity(blown.x.v_NB, 0.3);
      expect_sound(b.filter);
    }
    off_m[told] = (b.filter.state().p_NB - blown.x.p_NB).norm();
    learnt[told] = (b.filter.disturbance_N() - blown.d_N).norm();
  }
  EXPECT_GT(off_m[false], 0.5);
  EXPECT_LT(off_m[true], 0.15);
  EXPECT_LT(learnt[true], 0.3 * learnt[false]);
}

// Whatever happens to every n-th picture, the filter stays sound and on the drone.
TEST(RelativeFilter, EveryNthFrameLostLateRepeatedOrNaN) {
  enum class Mishap { lost, late, repeated, nan, empty, garbage, one_led };
  for (const auto& config : {RelativeFilterConfig{}, RelativeFilterConfig::paper(),
                             RelativeFilterConfig::camera_only()}) {
    for (const Mishap mishap :
         {Mishap::lost, Mishap::late, Mishap::repeated, Mishap::nan, Mishap::empty,
          Mishap::garbage, Mishap::one_led}) {
      // The paper's filter has no gate: garbage is not its business.
      if (mishap == Mishap::garbage && config.gate_chi2 == 0) continue;
      for (int n = 2; n <= 5; ++n) {
        Bench b(config);
        for (int k = 1; k <= 120; ++k) {
          if (k % n == 0 && mishap == Mishap::lost) continue;
          ASSERT_TRUE(b.predict(k));
          auto frame = b.frame(k);
          if (k % n == 0) {
            switch (mishap) {
              case Mishap::lost:
                break;
              case Mishap::late:
                frame.t -= 20'000'000;
                break;
              case Mishap::repeated:
                (void)b.filter.update(frame);
                break;
              case Mishap::nan:
                for (auto& o : frame.seen) o.uv.y() = kNaN;
                break;
              case Mishap::empty:
                frame.seen.clear();
                break;
              case Mishap::garbage:
                for (auto& o : frame.seen) {
                  o.uv = {b.rng.uniform(0, 848), b.rng.uniform(0, 480)};
                }
                break;
              case Mishap::one_led:
                frame.seen.truncate(1);
                break;
            }
          }
          (void)b.filter.update(frame);
          expect_sound(b.filter);
        }
        EXPECT_LT((b.filter.state().p_NB - b.truth(120).p_NB).norm(), 0.08)
            << "mishap " << static_cast<int>(mishap) << " every " << n;
      }
    }
  }
}

TEST(RelativeFilter, StopsWhenNothingIsKnownAnyMore) {
  Bench b;
  b.run(1, 10);
  int k = 11;
  while (b.predict(k)) ASSERT_LT(++k, 60 * 60);
  EXPECT_GT(k, 2 * 60);  // not before blindness of seconds
  EXPECT_FALSE(b.filter.initialized());
  expect_sound(b.filter);
  b.filter.reset(b.time(k), b.truth(k), start_covariance());
  b.run(k + 1, k + 10);
}

// Garbage for ever, absurd inputs: still finite, whether stopped or not.
TEST(RelativeFilter, NeverBecomesNaN) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Rng rng(seed);
    Bench b;
    for (int k = 1; k <= 300; ++k) {
      if (!b.filter.initialized()) {
        b.filter.reset(b.filter.time(), b.truth(k), start_covariance());
      }
      PredictionInput u = b.flight.input(k / 60.0);
      u.f_N = normal3(rng, 50);
      u.w_NB_B = normal3(rng, 30);
      u.platform.w_IN_N = normal3(rng, 5);
      (void)b.filter.predict_to(b.time(k), u);
      LedFrame frame;
      frame.t = b.time(k);
      const int count = static_cast<int>(rng.uniform(0, 8));
      for (int i = 0; i < count; ++i) {
        frame.seen.push_back({.leds = static_cast<std::uint16_t>(rng.uniform(0, 80)),
                              .uv = {rng.uniform(-1e3, 2e3), rng.uniform(-1e3, 2e3)},
                              .cov = Matrix2::Identity() * std::exp(rng.normal(0, 5)),
                              .depth_m = rng.normal()});
      }
      (void)b.filter.update(frame);
      ASSERT_NO_FATAL_FAILURE(expect_sound(b.filter));
    }
  }
}

TEST(RelativeFilter, SameInputSameBits) {
  Bench a, b;
  a.run(1, 50);
  b.run(1, 50);
  EXPECT_EQ(boxminus(a.filter.state(), b.filter.state()).norm(), 0);
  EXPECT_EQ(a.filter.covariance(), b.filter.covariance());
}

/// Rotation error, rad, 0.3 s after the last picture of a drone that turns on the spot.
double off_after_blackout(const RelativeFilterConfig& config) {
  const Rig rig = alan_rig();
  RelativeFilter filter = RelativeFilter::create(config, rig.camera, rig.leds).value();
  const auto truth = [](double t) {
    RelativeState x;
    x.p_NB = Vector3(-0.85, 0, 0.6);
    x.R_NB = from_rpy(0, 0, 0.8 * (t - 0.5));
    return x;
  };
  Rng rng(3);
  filter.reset(0, truth(0), start_covariance());
  for (int k = 1; k <= 78; ++k) {
    const Time t = from_seconds(k / 60.0);
    EXPECT_TRUE(filter.predict_to(t, {}).has_value());
    if (k > 60) continue;
    const Pose X_NB = truth(to_seconds(t)).X_NB();
    EXPECT_TRUE(
        filter.update(picture(rig.camera, rig.leds, X_NB, t, 0.1, rng)).has_value());
  }
  expect_sound(filter);
  return angle_between(filter.state().R_NB, truth(78 / 60.0).R_NB);
}

TEST(RelativeFilter, LearnsTheRateOfTurnThatNobodyTells) {
  RelativeFilterConfig config = RelativeFilterConfig::camera_only();
  EXPECT_LT(off_after_blackout(config), 6 * kDegree);
  config.noise.turn = 0;
  config.noise.rate = 0.3;
  EXPECT_GT(off_after_blackout(config), 10 * kDegree);
}

/// Told against tracked variance of the velocity, and of the position, after `pictures`
/// of a drone that sways.
std::pair<double, double> told_share(const RelativeFilterConfig& config, int pictures,
                                     double range_m) {
  const Rig rig = alan_rig();
  auto filter = RelativeFilter::create(config, rig.camera, rig.leds).value();
  const auto truth = [&](double t) {
    RelativeState x;
    x.p_NB = Vector3(0.54 - range_m, 0.2 * std::sin(3 * t), 0.6);
    x.v_NB = Vector3(0, 0.6 * std::cos(3 * t), 0);
    return x;
  };
  Rng rng(8);
  filter.reset(0, truth(0), start_covariance());
  for (int k = 1; k <= pictures; ++k) {
    const Time t = from_seconds(k / 60.0);
    EXPECT_TRUE(filter.predict_to(t, {}).has_value());
    (void)filter.update(
        picture(rig.camera, rig.leds, truth(k / 60.0).X_NB(), t, 0.05, rng));
  }
  const Covariance9 told = filter.covariance(), tracked = filter.tracking_covariance();
  EXPECT_EQ(Eigen::LLT<Covariance9>(told).info(), Eigen::Success);
  return {told.diagonal().tail<3>().sum() / tracked.diagonal().tail<3>().sum(),
          told.diagonal().head<3>().sum() / tracked.diagonal().head<3>().sum()};
}

// The nearer, the shorter it averages, the less of its process noise is there.
TEST(RelativeFilter, TellsTheVelocityAsSmoothFlightsLeaveIt) {
  RelativeFilterConfig config = RelativeFilterConfig::camera_only();
  config.learn_from_residuals = false;
  const auto near = told_share(config, 120, 0.7), far = told_share(config, 120, 2.8);
  EXPECT_LT(near.first, 0.85);
  EXPECT_GT(near.first, 0.55);
  EXPECT_GT(far.first, near.first);
  EXPECT_LT(near.second, far.second);
  EXPECT_GT(near.second, 0.85);
  EXPECT_LT(far.second, 1.2);
  // What it began with is no process noise.
  EXPECT_NEAR(told_share(config, 1, 0.7).first, 1, 1e-9);
  EXPECT_GT(told_share(config, 3, 0.7).first, 0.95);
  RelativeFilterConfig landing;
  const auto known = told_share(landing.with_perfect_rig(), 120, 0.7);
  EXPECT_NEAR(known.first, 1, 1e-9);
  EXPECT_NEAR(known.second, 1, 1e-9);
}

// Corrections of what pushes it that go on in one direction show that the velocity
// lags.
TEST(RelativeFilter, TellsTheVelocityMoreVaguelyWhileItLags) {
  const Rig rig = alan_rig();
  RelativeFilterConfig config = RelativeFilterConfig::camera_only();
  config.learn_from_residuals = false;
  const auto mean_share = [&](double jerk_m_s3) {
    constexpr int kSeeds = 40, kPictures = 130, kJerked = 10;
    double sum = 0;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      auto filter = RelativeFilter::create(config, rig.camera, rig.leds).value();
      Rng rng(seed);
      RelativeState x;
      for (int k = 0; k <= kPictures; ++k) {
        const Time t = from_seconds(k / 60.0);
        const double rising_s = std::max(k - (kPictures - kJerked), 0) / 60.0;
        x.p_NB = Vector3(-0.9, 0, 0.6 + jerk_m_s3 * std::pow(rising_s, 3) / 6);
        x.v_NB = Vector3(0, 0, jerk_m_s3 * std::pow(rising_s, 2) / 2);
        if (k == 0) {
          filter.reset(0, x, start_covariance());
          continue;
        }
        EXPECT_TRUE(filter.predict_to(t, {}));
        EXPECT_TRUE(
            filter.update(picture(rig.camera, rig.leds, x.X_NB(), t, 0.05, rng)));
      }
      const Matrix3 tracked = filter.tracking_covariance().bottomRightCorner<3, 3>();
      const Matrix3 told = filter.covariance().bottomRightCorner<3, 3>();
      sum += told.trace() / tracked.trace();
    }
    return sum / kSeeds;
  };
  const double still = mean_share(0);
  EXPECT_GT(mean_share(3), 1.04 * still);
}

TEST(RelativeFilter, ItsWayShowsWhatPushesTheDroneHoweverItLeans) {
  const Rig rig = alan_rig();
  for (const bool alone : {true, false}) {
    const RelativeFilterConfig config =
        alone ? RelativeFilterConfig::camera_only() : RelativeFilterConfig{};
    for (const double lean_deg : {0.0, 25.0, 45.0}) {
      RelativeFilter filter =
          RelativeFilter::create(config, rig.camera, rig.leds).value();
      // It rests in the air, held by something: no rotors push it.
      RelativeState truth;
      truth.p_NB = Vector3(-1.3, 0.1, 0.5);
      truth.R_NB = from_rpy(lean_deg * kDegree, 0, 0.2);
      filter.reset(0, truth, start_covariance());
      Rng rng(3);
      for (int k = 1; k <= 20; ++k) {
        const Time t = from_seconds(k / 60.0);
        ASSERT_TRUE(filter.predict_to(t, {}));
        ASSERT_TRUE(
            filter.update(picture(rig.camera, rig.leds, truth.X_NB(), t, 0.05, rng)));
        if (k < 5 || !alone) {
          EXPECT_FALSE(filter.push());
        } else if (k > 12) {
          ASSERT_TRUE(filter.push());
          const Vector3 off_N = filter.push()->f_N - Vector3(0, 0, kGravity);
          const Vector3 z_N = truth.R_NB.col(2);
          EXPECT_LT((off_N - off_N.dot(z_N) * z_N).norm(), 1.5) << lean_deg << " " << k;
          EXPECT_NEAR(filter.push()->across(z_N),
                      kGravity * std::sin(lean_deg * kDegree), 1.5);
        }
      }
      filter.reset(from_seconds(1), truth, start_covariance());
      EXPECT_FALSE(filter.push());
    }
  }
}

struct DragFlight {
  double speed_rms = 0, speed_nees = 0;
  Vector3 drag_N = Vector3::Zero();
};

/// A drone with drag that leans to and fro for ten seconds; the last six count.
DragFlight fly_with_drag(double drag, bool estimate, std::uint64_t seed) {
  const Rig rig = alan_rig();
  RelativeFilterConfig config = RelativeFilterConfig::camera_only();
  config.estimate_drag = estimate;
  if (!estimate) config.bias_sd = config.lift_sd = config.noise.bias = 0.4;
  RelativeFilter filter = RelativeFilter::create(config, rig.camera, rig.leds).value();
  Rng rng(seed);
  const double phase = rng.uniform(0, 2 * kPi), pace = rng.uniform(1.5, 2.5);
  const auto lean = [&](double t) {
    return from_rpy(0.15 * std::sin(pace * t + phase), 0.1 * std::sin(0.8 * pace * t),
                    0);
  };
  MotionState truth;
  truth.x.p_NB = Vector3(-1.1, 0.15 * std::sin(phase), 0.6);
  truth.x.R_NB = lean(0);
  truth.x.v_NB = kGravity / pace * Vector3(-0.1 / 0.8, 0.15 * std::cos(phase), 0);
  truth.b_N = Vector3::Constant(drag);
  const MotionModel flown{.force = ProcessModel::hover, .memory_s = 1e6, .drag = true};
  filter.reset(0, truth.x, start_covariance());
  DragFlight flight;
  constexpr int kFrames = 600, kFrom = 240, kSteps = 4;
  for (int k = 1; k <= kFrames; ++k) {
    const Time t = from_seconds(k / 60.0);
    for (int i = 0; i < kSteps; ++i) {
      const double at = (k - 1 + (i + 0.5) / kSteps) / 60;
      truth.x.R_NB = lean(at);
      // Level flight: thrust carries its weight however it leans.
      truth.d_N = Vector3(0, 0, kGravity * (1 - truth.x.R_NB(2, 2)));
      truth = extrapolate(truth, {}, 1.0 / 60 / kSteps, flown);
    }
    truth.x.R_NB = lean(k / 60.0);
    EXPECT_TRUE(filter.predict_to(t, {}).has_value());
    (void)filter.update(picture(rig.camera, rig.leds, truth.x.X_NB(), t, 0.05, rng));
    if (k <= kFrom) continue;
    const Vector3 e = truth.x.v_NB - filter.state().v_NB;
    const Matrix3 P = filter.covariance().bottomRightCorner<3, 3>();
    flight.speed_rms += e.squaredNorm() / (kFrames - kFrom);
    flight.speed_nees += e.dot(P.llt().solve(e)) / (kFrames - kFrom);
  }
  flight.speed_rms = std::sqrt(flight.speed_rms);
  flight.drag_N = filter.motion_state().b_N;
  return flight;
}

TEST(RelativeFilter, LearnsTheDragOfADrone) {
  constexpr int kRuns = 20;
  for (const double drag : {0.0, 0.4}) {
    double with = 0, without = 0, nees = 0, found = 0;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      const DragFlight one = fly_with_drag(drag, true, seed);
      with += one.speed_rms / kRuns;
      nees += one.speed_nees / kRuns;
      found += one.drag_N.head<2>().mean() / kRuns;
      without += fly_with_drag(drag, false, seed).speed_rms / kRuns;
    }
    EXPECT_NEAR(found, drag, 0.1);
    EXPECT_LT(nees, 6) << drag;
    EXPECT_LT(with, (drag > 0 ? 0.8 : 1.1) * without) << drag;
  }
}

TEST(RelativeFilter, FollowsWhatMovesAsNoDroneDoes) {
  // Carried to and fro upright: its attitude tells nothing of its acceleration.
  const Rig rig = alan_rig();
  RelativeFilter filter =
      RelativeFilter::create(RelativeFilterConfig::camera_only(), rig.camera, rig.leds)
          .value();
  const auto truth = [](double t) {
    const double w = 2 * kPi * 0.7;
    RelativeState x;
    x.p_NB = Vector3(-0.85, 0.3 * std::sin(w * t), 0.6);
    x.v_NB = Vector3(0, 0.3 * w * std::cos(w * t), 0);
    return x;
  };
  Rng rng(4);
  filter.reset(0, truth(0), start_covariance());
  for (int k = 1; k <= 240; ++k) {
    const Time t = from_seconds(k / 60.0);
    const Pose X_NB = truth(to_seconds(t)).X_NB();
    ASSERT_TRUE(filter.predict_to(t, {}).has_value());
    ASSERT_TRUE(
        filter.update(picture(rig.camera, rig.leds, X_NB, t, 0.1, rng)).has_value())
        << k;
    EXPECT_LT((filter.state().p_NB - X_NB.translation()).norm(), 0.02) << k;
  }
}

/// Of a drone that hovers, over the last two of four seconds: mean NEES of the pose,
/// and the stated sd of its position. LEDs that run `together` do so in threes.
std::pair<double, double> hovering(double noise_px, Rng rng, bool together = false) {
  const Rig rig = alan_rig();
  RelativeFilterConfig config = RelativeFilterConfig::camera_only();
  RelativeFilter filter = RelativeFilter::create(config, rig.camera, rig.leds).value();
  RelativeState x;
  x.p_NB = Vector3(-0.85, 0, 0.6);
  filter.reset(0, x, start_covariance());
  double nees = 0, sd = 0;
  for (int k = 1; k <= 240; ++k) {
    const Time t = from_seconds(k / 60.0);
    EXPECT_TRUE(filter.predict_to(t, {}).has_value());
    // Claimed as 0.1 px, whatever it is.
    LedFrame frame = picture(rig.camera, rig.leds, x.X_NB(), t, noise_px, rng);
    for (LedObservation& o : frame.seen) o.cov = 0.01 * Matrix2::Identity();
    for (int first = 0; together && first < 6; first += 3) {
      frame.groups.push_back({first, 3, 100 * GroupMatrix::Identity(6, 6)});
    }
    EXPECT_TRUE(filter.update(frame).has_value()) << k;
    if (k <= 120) continue;
    const Eigen::Matrix<double, 6, 1> e =
        boxminus(x, filter.state()).template head<6>();
    const Eigen::Matrix<double, 6, 6> P = filter.covariance().topLeftCorner<6, 6>();
    nees += e.dot(P.llt().solve(e)) / 120;
    sd += filter.position_sd() / 120;
  }
  return {nees, sd};
}

TEST(RelativeFilter, LearnsHowExactPicturesAndHowEvenMotionIs) {
  double nees_exact = 0, nees_rough = 0, sd_exact = 0, sd_rough = 0;
  constexpr int kRuns = 20;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    const auto [nees_a, sd_a] = hovering(0.03, Rng(seed));
    const auto [nees_b, sd_b] = hovering(0.3, Rng(seed));
    nees_exact += nees_a / kRuns;
    nees_rough += nees_b / kRuns;
    sd_exact += sd_a / kRuns;
    sd_rough += sd_b / kRuns;
  }
  EXPECT_LT(4 * sd_exact, sd_rough);
  for (const double nees : {nees_exact, nees_rough}) {
    EXPECT_GT(nees, 2);
    EXPECT_LT(nees, 9);
  }
}

TEST(RelativeFilter, LightsThatRunTogetherTellOfTheirNoiseToo) {
  double apart = 0, together = 0, nees = 0;
  constexpr int kRuns = 20;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    apart += hovering(0.03, Rng(seed)).second / kRuns;
    const auto [nees_one, sd_one] = hovering(0.03, Rng(seed), true);
    nees += nees_one / kRuns;
    together += sd_one / kRuns;
  }
  EXPECT_NEAR(together, apart, 0.1 * apart);
  EXPECT_GT(nees, 3);
  EXPECT_LT(nees, 9);
}

TEST(RelativeFilter, VelocitiesOfWhatRestsAreStatedToBeWellKnown) {
  const Rig rig = alan_rig();
  RelativeFilter filter =
      RelativeFilter::create(RelativeFilterConfig::camera_only(), rig.camera, rig.leds)
          .value();
  RelativeState x;
  x.p_NB = Vector3(-0.85, 0, 0.6);
  filter.reset(0, x, start_covariance());
  Rng rng(8);
  double square = 0, stated = 0;
  for (int k = 1; k <= 600; ++k) {
    const Time t = from_seconds(k / 60.0);
    ASSERT_TRUE(filter.predict_to(t, {}).has_value());
    ASSERT_TRUE(filter.update(picture(rig.camera, rig.leds, x.X_NB(), t, 0.02, rng))
                    .has_value());
    if (k <= 300) continue;
    square += filter.state().v_NB.squaredNorm();
    stated += filter.covariance().bottomRightCorner<3, 3>().trace();
  }
  EXPECT_LT(std::sqrt(stated / 300), 0.003);
  EXPECT_LT(square, 1.2 * stated);
}

TEST(RelativeFilter, WhatMovesAfterLongRestIsFollowed) {
  for (const double push : {1.0, 2.0, 4.0}) {  // m/s^2, from one picture to the next
    const Rig rig = alan_rig();
    RelativeFilter filter = RelativeFilter::create(RelativeFilterConfig::camera_only(),
                                                   rig.camera, rig.leds)
                                .value();
    const auto truth = [&](double t) {
      RelativeState x;
      const double since = std::clamp(t - 3, 0.0, 0.3);
      x.p_NB = Vector3(-0.85, push * since * (since / 2 + std::max(0.0, t - 3.3)), 0.6);
      return x;
    };
    Rng rng(5);
    filter.reset(0, truth(0), start_covariance());
    for (int k = 1; k <= 200; ++k) {
      const Time t = from_seconds(k / 60.0);
      const Pose X_NB = truth(to_seconds(t)).X_NB();
      ASSERT_TRUE(filter.predict_to(t, {}).has_value());
      ASSERT_TRUE(
          filter.update(picture(rig.camera, rig.leds, X_NB, t, 0.05, rng)).has_value())
          << k << ", " << push << " m/s^2";
      EXPECT_LT((filter.state().p_NB - X_NB.translation()).norm(), 0.03) << k;
    }
  }
}

TEST(RelativeFilterConfig, EveryProfileIsValid) {
  EXPECT_TRUE(RelativeFilterConfig{}.validate().has_value());
  EXPECT_TRUE(RelativeFilterConfig::paper().validate().has_value());
  EXPECT_TRUE(RelativeFilterConfig::camera_only().validate().has_value());
}

TEST(RelativeFilterConfig, NamesFieldValueAndBounds) {
  RelativeFilterConfig c;
  c.velocity_alpha = 1.5;
  auto valid = c.validate();
  ASSERT_FALSE(valid.has_value());
  EXPECT_EQ(valid.error().fault, Fault::invalid_config);
  EXPECT_EQ(valid.error().detail, "estimation.velocity_alpha: 1.5 is outside [0, 1]");
  c = {};
  c.noise.rate = kNaN;
  EXPECT_FALSE(c.validate().has_value());
  c = {};
  c.max_iterations = 0;
  EXPECT_FALSE(c.validate().has_value());
  const Rig rig = alan_rig();
  EXPECT_FALSE(RelativeFilter::create(c, rig.camera, rig.leds).has_value());
}

}  // namespace
}  // namespace alight::test
