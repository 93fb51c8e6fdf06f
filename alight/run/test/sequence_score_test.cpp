#include "alight/run/sequence_score.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "alight/run/measure_run.h"

namespace alight {
namespace {

Vector9 normal9(Rng& rng) {
  Vector9 z;
  for (int i = 0; i < 9; ++i) z[i] = rng.normal();
  return z;
}

RelativeState some_state(Rng& rng) {
  RelativeState x;
  x.p_NB = Vector3(-1, 0.2, 0.6);
  x.R_NB = from_rpy(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(-3, 3));
  x.v_NB = Vector3(0.3, -0.2, 0.1);
  return x;
}

TEST(SequenceScore, NeesOfATrueCovarianceIsTheDegreesOfFreedom) {
  Rng rng(5);
  double pose = 0, state = 0;
  constexpr int kRuns = 4000;
  for (int run = 0; run < kRuns; ++run) {
    Matrix9 root = Matrix9::Zero();
    for (int i = 0; i < 9; ++i) root.col(i) = 0.01 * normal9(rng);
    FrameReport report;
    report.tracked = true;
    report.x = some_state(rng);
    report.cov = root * root.transpose();
    const RelativeState truth = boxplus(report.x, root * normal9(rng));
    const FrameScore score = score_frame(report, truth, Vector3::Zero());
    pose += score.nees_pose;
    state += score.nees_state;
  }
  // The mean of n chi-squares of k degrees has an sd of sqrt(2 k / n); the tangent at
  // a random draw bends by a little more.
  EXPECT_NEAR(pose / kRuns, 6, 5 * std::sqrt(12.0 / kRuns));
  EXPECT_NEAR(state / kRuns, 9, 5 * std::sqrt(18.0 / kRuns));
}

TEST(SequenceScore, WrongBeyondEitherLimitAndSureUnlessTheCovarianceAllowsIt) {
  Rng rng(6);
  FrameReport report;
  report.tracked = true;
  report.x = some_state(rng);
  report.cov = Matrix9::Identity() * 1e-4;
  const auto score_of = [&](const Vector3& dp, const Vector3& dR) {
    Vector9 d = Vector9::Zero();
    d.head<3>() = dp;
    d.segment<3>(3) = dR;
    return score_frame(report, boxplus(report.x, d), Vector3::Zero());
  };
  EXPECT_FALSE(score_of({0.149, 0, 0}, {0, 0, 0}).wrong());
  EXPECT_TRUE(score_of({0.151, 0, 0}, {0, 0, 0}).wrong());
  EXPECT_FALSE(score_of({0, 0, 0}, {0, 14.9 * kDegree, 0}).wrong());
  EXPECT_TRUE(score_of({0, 0, 0}, {0, 15.1 * kDegree, 0}).wrong());
  // 15 sd off: the covariance does not claim it.
  EXPECT_FALSE(score_of({0.151, 0, 0}, {0, 0, 0}).surely_wrong());
  // "Told with confidence" is a wrong pose that the covariance holds for likely.
  report.cov = Matrix9::Identity();
  EXPECT_TRUE(score_of({0.151, 0, 0}, {0, 0, 0}).surely_wrong());
  // No covariance at all says nothing in its favour.
  report.cov(0, 0) = std::nan("");
  EXPECT_TRUE(score_of({0.151, 0, 0}, {0, 0, 0}).surely_wrong());
  report.tracked = false;
  EXPECT_FALSE(score_of({0.151, 0, 0}, {0, 0, 0}).wrong());
}

MeasureOptions short_flights() {
  MeasureOptions options;
  options.sequence.rig = alan_rig();
  options.sequence.frames = 8;
  options.seeds = 4;
  options.mixed = true;
  return options;
}

TEST(MeasureRun, ThreadsChangeNoFigure) {
  MeasureOptions options = short_flights();
  options.jobs = 1;
  const auto one = run_measure(options);
  options.jobs = 3;
  const auto three = run_measure(options);
  ASSERT_TRUE(one && three);
  for (std::size_t i = 0; i < one->sequences.size(); ++i) {
    const auto& a = one->sequences[i].frames;
    const auto& b = three->sequences[i].frames;
    ASSERT_EQ(a.size(), 8u);
    ASSERT_EQ(b.size(), 8u);
    for (std::size_t k = 0; k < a.size(); ++k) {
      EXPECT_EQ(a[k].tracked, b[k].tracked);
      if (a[k].tracked) {
        EXPECT_EQ(a[k].position_m, b[k].position_m);
        EXPECT_EQ(a[k].nees_state, b[k].nees_state);
      }
    }
  }
}

TEST(MeasureRun, PiecesMakeTheWhole) {
  MeasureOptions options = short_flights();
  const auto whole = run_measure(options);
  options.seeds = 2;
  options.first_seed = 3;
  const auto part = run_measure(options);
  ASSERT_TRUE(whole && part);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(part->sequences[i].options.seed, whole->sequences[i + 2].options.seed);
    for (std::size_t k = 0; k < 8; ++k) {
      EXPECT_EQ(part->sequences[i].frames[k].range_m,
                whole->sequences[i + 2].frames[k].range_m);
      EXPECT_EQ(part->sequences[i].frames[k].tracked,
                whole->sequences[i + 2].frames[k].tracked);
    }
  }
}

// Of five lights in a row of lamps the pixels spoke against one, and the other four
// passed for LEDs (1 and 2 dead), or all five for more than the four that were followed
// (0 and 1); what other readings of the first picture had taught let LEDs 1 and 3,
// dead, seem to shine in the next.
TEST(MeasureRun, WhatPixelsSpeakAgainstIsNoDrone) {
  const std::pair<std::vector<int>, std::uint64_t> flights[] = {
      {{1, 2}, 610504}, {{1, 3}, 884702}, {{0, 1}, 630008}};
  MeasureOptions options;
  options.sequence.rig = alan_rig();
  options.sequence.kind = SequenceKind::hard;
  options.sequence.frames = 140;
  options.seeds = 1;
  for (const auto& [dead, seed] : flights) {
    options.sequence.dead = dead;
    options.first_seed = seed;
    const auto measured = run_measure(options);
    ASSERT_TRUE(measured);
    EXPECT_EQ(summarize(*measured).wrong, 0) << seed;
  }
}

// LEDs that run together in the first picture are told apart by their pixels there and
// then: of poses that blobs leave open, or know to 8 cm only.
TEST(MeasureRun, DronesInHardPicturesAreToldFromTheFirstOne) {
  MeasureOptions options;
  options.sequence.rig = alan_rig();
  options.sequence.kind = SequenceKind::hard;
  options.sequence.frames = 3;
  options.seeds = 200;
  options.first_seed = 510001;
  const auto measured = run_measure(options);
  ASSERT_TRUE(measured);
  int at_once = 0, in_the_end = 0;
  for (const auto& sequence : measured->sequences) {
    at_once += sequence.frames.front().tracked;
    in_the_end += sequence.frames.back().tracked;
  }
  EXPECT_EQ(summarize(*measured).wrong, 0);
  EXPECT_GE(at_once, 196);  // 98.6 % of 3,000 are; 94.9 before
  EXPECT_EQ(in_the_end, 200);
}

// Blobs of four LEDs leave several poses open in one of four pictures, their pixels
// hardly any.
TEST(MeasureRun, DronesOfFourLedsAreToldFromTheFirstPicture) {
  MeasureOptions options;
  options.sequence.rig = alan_rig();
  options.sequence.frames = 3;
  options.seeds = 25;
  options.first_seed = 700001;
  int at_once = 0, flights = 0;
  for (const auto& dead :
       std::vector<std::vector<int>>{{0, 1}, {0, 5}, {2, 3}, {3, 5}}) {
    options.sequence.dead = dead;
    const auto measured = run_measure(options);
    ASSERT_TRUE(measured);
    EXPECT_EQ(summarize(*measured).wrong, 0);
    for (const auto& sequence : measured->sequences) {
      at_once += sequence.frames.front().tracked;
      ++flights;
    }
    options.first_seed += 100;
  }
  // 96 % of 900 flights, of all pairs, are; 76 before.
  EXPECT_GE(at_once, 0.9 * flights);
}

// Two of three pixels that a lens of one colour could have told by are gone; what is
// left must be used as it is.
TEST(MeasureRun, UnderAMosaicFlightsAreFollowedNearlyAsExactly) {
  MeasureOptions options;
  options.sequence.rig = alan_rig();
  options.sequence.frames = 60;
  options.seeds = 6;
  const auto rms_mm = [&](Mosaic mosaic) {
    options.sequence.rig.mosaic = mosaic;
    const auto measured = run_measure(options);
    EXPECT_TRUE(measured);
    double sum = 0;
    int tracked = 0, frames = 0;
    for (const auto& sequence : measured->sequences) {
      for (const FrameScore& frame : sequence.frames) {
        ++frames;
        if (!frame.tracked) continue;
        EXPECT_FALSE(frame.wrong());
        sum += 1e6 * frame.position_m * frame.position_m;
        ++tracked;
      }
    }
    EXPECT_GE(tracked, frames - 6) << to_string(mosaic);
    return std::sqrt(sum / std::max(tracked, 1));
  };
  const double whole = rms_mm(Mosaic::none);
  EXPECT_LT(rms_mm(Mosaic::rggb), std::max(2.5 * whole, 2.0));
  EXPECT_LT(rms_mm(Mosaic::grbg), std::max(2.5 * whole, 2.0));
}

// Most cameras store no light but a power of it, told in the rig or found out.
TEST(SequenceScore, ACameraThatStoresAPowerOfLightIsAsGoodAsALinearOne) {
  double linear = 0, told = 0, found_out = 0, denied = 0;
  constexpr int kFrames = 300, kFrom = 150;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SequenceOptions options;
    options.rig = alan_rig();
    options.seed = 960000 + seed;
    options.frames = kFrames;
    // Squared errors, mm^2, once there was time to find out.
    const auto errors = [&](double gamma, double in_the_rig) {
      options.rig.gamma = gamma;
      auto sequence = Sequence::create(options);
      EXPECT_TRUE(sequence);
      Rig rig = options.rig;
      rig.gamma = in_the_rig;
      const auto scores = score_sequence(*sequence, rig, Profile::standard);
      EXPECT_TRUE(scores);
      double sum = 0;
      for (std::size_t k = kFrom; k < kFrames; ++k) {
        const FrameScore& score = (*scores)[k];
        EXPECT_TRUE(score.tracked) << seed << ": " << k;
        EXPECT_FALSE(score.wrong());
        if (score.tracked) sum += 1e6 * score.position_m * score.position_m;
      }
      return sum;
    };
    linear += errors(0, 0);
    told += errors(2.2, 2.2);
    found_out += errors(2.2, 0);
    denied += errors(2.2, 1);
  }
  EXPECT_LT(told, 2 * linear);
  EXPECT_LT(found_out, 3 * linear);
  EXPECT_GT(denied, 6 * linear);
}

TEST(MeasureRun, MixedFlightsAreOfEveryKind) {
  MeasureOptions options = short_flights();
  int hard = 0, dead = 0, dark = 0, strays = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const SequenceOptions one = measured_sequence(options, seed);
    EXPECT_TRUE(one.validate()) << one.validate().error().detail;
    hard += one.kind == SequenceKind::hard;
    dead += !one.dead.empty();
    dark += one.dark_to > one.dark_from;
    strays += one.strays > 0;
    EXPECT_LE(one.dead.size(), 2u);
  }
  for (const int count : {hard, dead, dark, strays}) {
    EXPECT_GT(count, 20);
    EXPECT_LT(count, 180);
  }
}

}  // namespace
}  // namespace alight
