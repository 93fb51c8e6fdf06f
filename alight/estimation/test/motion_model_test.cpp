#include "alight/estimation/motion_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr double kForever = std::numeric_limits<double>::infinity();

Vector3 random3(Rng& rng, double sd) {
  return {rng.normal(0, sd), rng.normal(0, sd), rng.normal(0, sd)};
}

PredictionInput random_input(Rng& rng) {
  PredictionInput u;
  u.platform.X_IN = make_pose(so3_exp(random3(rng, 0.5)), random3(rng, 2));
  u.platform.v_IN_N = random3(rng, 1);
  u.platform.w_IN_N = random3(rng, 0.7);
  u.platform.a_IN_N = random3(rng, 1);
  u.platform.alpha_IN_N = random3(rng, 1);
  u.f_N = random3(rng, 5);
  u.w_NB_B = random3(rng, 2);
  u.lift_N = Vector3::UnitZ() + random3(rng, 0.3);
  return u;
}

MotionState random_state(Rng& rng) {
  return {{random3(rng, 2), so3_exp(random3(rng, 1)), random3(rng, 1)},
          random3(rng, 1),
          random3(rng, 1)};
}

class BothModels : public testing::TestWithParam<ProcessModel> {};

TEST_P(BothModels, JacobianAgreesWithDifferences) {
  Rng rng(1);
  for (int trial = 0; trial < 50; ++trial) {
    const auto u = random_input(rng);
    const auto s = random_state(rng);
    const double dt = rng.uniform(-0.02, 0.1);
    Matrix15 F;
    const MotionModel model{GetParam(), trial % 2 == 0 ? 30.0 : 1.0, trial % 3 == 0};
    extrapolate(s, u, dt, model, &F);
    const double h = 1e-5;
    for (int i = 0; i < 15; ++i) {
      const Vector15 d = h * Vector15::Unit(i);
      const Vector15 column = boxminus(extrapolate(boxplus(s, d), u, dt, model),
                                       extrapolate(boxplus(s, -d), u, dt, model)) /
                              (2 * h);
      EXPECT_LT((column - F.col(i)).norm(), 1e-7) << "column " << i;
    }
  }
}

TEST_P(BothModels, OneStepAgreesWithManySmallOnes) {
  Rng rng(2);
  for (int trial = 0; trial < 20; ++trial) {
    auto u = random_input(rng);
    u.w_NB_B *= 0.3;
    const auto s = random_state(rng);
    MotionState fine = s;
    const MotionModel model{.force = GetParam(), .drag = trial % 2 == 0};
    for (int i = 0; i < 1000; ++i) fine = extrapolate(fine, u, 1e-5, model);
    const Vector15 d = boxminus(extrapolate(s, u, 0.01, model), fine);
    EXPECT_LT(d.head<3>().norm(), 2e-5);
    EXPECT_LT(d.segment<3>(3).norm(), 1e-9);
    EXPECT_LT(d.segment<3>(6).norm(), 1e-4);
    EXPECT_LT(d.tail<6>().norm(), 1e-9);
  }
}

INSTANTIATE_TEST_SUITE_P(MotionModel, BothModels,
                         testing::Values(ProcessModel::hover,
                                         ProcessModel::set_points));

// A drone that falls freely in I, seen from a platform that turns and accelerates.
TEST(MotionModel, FreeFallSeenFromACircle) {
  const double w = 0.6, radius = 1.5, T = 0.5;
  const auto platform_at = [&](double t) {
    PlatformState p;
    p.X_IN = make_pose(from_rpy(0, 0, w * t + kPi / 2),
                       radius * Vector3(std::cos(w * t), std::sin(w * t), 0));
    p.v_IN_N = Vector3(w * radius, 0, 0);
    p.w_IN_N = Vector3(0, 0, w);
    p.a_IN_N = Vector3(0, w * w * radius, 0);
    return p;
  };
  const Vector3 p_0(3, -1, 4), v_0(0.5, 0.4, 2);
  const auto truth = [&](double t) {
    const auto p = platform_at(t);
    const Vector3 g(0, 0, -kGravity);
    const Vector3 p_IB = p_0 + v_0 * t + 0.5 * g * t * t;
    RelativeState x;
    x.p_NB = p.X_IN.inverse() * p_IB;
    x.v_NB =
        p.X_IN.linear().transpose() * (v_0 + g * t) - p.v_IN_N - p.w_IN_N.cross(x.p_NB);
    return x;
  };
  MotionState s{truth(0)};
  const int steps = 100;
  for (int i = 0; i < steps; ++i) {
    PredictionInput u;
    u.platform = platform_at(T * (i + 0.5) / steps);
    s = extrapolate(s, u, T / steps);
  }
  EXPECT_LT((s.x.p_NB - truth(T).p_NB).norm(), 2e-5);
  EXPECT_LT((s.x.v_NB - truth(T).v_NB).norm(), 2e-5);
}

TEST(MotionModel, AtRestWithHoverThrustStaysAtRest) {
  MotionState s;
  s.x.p_NB = {-1, 0.2, 1};
  const auto next = extrapolate(s, {}, 0.1, {ProcessModel::hover});
  EXPECT_LT(boxminus(next, s).norm(), 1e-12);
}

TEST(MotionModel, DisturbanceIsAnAcceleration) {
  PredictionInput u;
  u.f_N = {0, 0, kGravity};
  MotionState s;
  s.d_N = {1, 0, 0};
  s.b_N = {0, 2, 0};
  const auto x = extrapolate(s, u, 0.2, {.memory_s = kForever}).x;
  EXPECT_LT((x.v_NB - Vector3(0.2, 0.4, 0)).norm(), 1e-12);
  EXPECT_LT((x.p_NB - Vector3(0.02, 0.04, 0)).norm(), 1e-12);
}

// A drone a tenth too heavy for its thrust, leaning: it lacks a tenth of what pushes it
// to the side, too.
TEST(MotionModel, ThrustThatIsLackingLacksWhereverItPoints) {
  PredictionInput u;
  u.f_N = {3, -1, kGravity};
  u.lift_N = u.f_N / kGravity;
  MotionState s;
  s.b_N.z() = -0.1 * kGravity;
  const auto x = extrapolate(s, u, 0.2, {.memory_s = kForever}).x;
  EXPECT_LT((x.v_NB - 0.2 * Vector3(2.7, -0.9, -0.1 * kGravity)).norm(), 1e-12);
}

TEST(MotionModel, DragSlowsByAShareOfTheSpeed) {
  MotionState s;
  s.x.v_NB = {2, -1, 0.5};
  s.b_N = {0.3, 0.3, 0};
  const MotionModel model{
      .force = ProcessModel::hover, .memory_s = kForever, .drag = true};
  for (int i = 0; i < 100; ++i) s = extrapolate(s, {}, 0.01, model);
  const double kept = std::exp(-0.3);
  EXPECT_LT((s.x.v_NB - Vector3(2 * kept, -kept, 0.5)).norm(), 1e-4);
}

// A drone that pushes a tenth too hard along its z goes on to do so as it turns.
TEST(MotionModel, ThrustThatDiffersTurnsWithTheDrone) {
  MotionState s;
  s.x.R_NB = from_rpy(0.2, -0.1, 1);
  s.d_N = 0.1 * kGravity * s.x.R_NB.col(2);
  PredictionInput u;
  u.w_NB_B = {0.8, -0.5, 0.3};
  const MotionModel model{
      .force = ProcessModel::hover, .memory_s = kForever, .drag = true};
  Vector3 v_NB = Vector3::Zero();
  for (int i = 0; i < 100; ++i) {
    const Matrix3 R_NB = s.x.R_NB * so3_exp(u.w_NB_B * 0.005);
    v_NB += 0.01 * kGravity * (1.1 * R_NB.col(2) - Vector3::UnitZ());
    s = extrapolate(s, u, 0.01, model);
  }
  EXPECT_LT((s.d_N - 0.1 * kGravity * s.x.R_NB.col(2)).norm(), 1e-9);
  EXPECT_LT((s.x.v_NB - v_NB).norm(), 1e-3);
}

TEST(MotionModel, WindStaysInIAndBiasInN) {
  PredictionInput u;
  u.platform.w_IN_N = {0, 0, 0.6};
  MotionState s;
  s.d_N = s.b_N = {1, 0.5, -0.3};
  const MotionState faded = extrapolate(s, u, 0.5);
  const double kept = std::exp(-0.5 / MotionModel{}.memory_s);
  EXPECT_LT((from_rpy(0, 0, 0.3) * faded.d_N - kept * s.d_N).norm(), 1e-12);
  EXPECT_LT((faded.b_N - kept * s.b_N).norm(), 1e-12);
  const MotionState lasting = extrapolate(s, u, 0.5, {.memory_s = kForever});
  EXPECT_LT((lasting.b_N - s.b_N).norm(), 1e-12);
}

// The integral of white noise over T does not depend on how T is split.
TEST(MotionModel, ProcessCovarianceAddsUpOverSteps) {
  const ProcessNoise noise{.disturbance = 0.9, .bias = 0.4};
  PredictionInput u;
  u.f_N = {0, 0, kGravity};
  const Vector3 z_N = Vector3(0.2, 0.1, 1).normalized();
  for (const bool drag : {false, true}) {
    Matrix15 F;
    extrapolate(MotionState{}, u, 0.01, {.memory_s = kForever, .drag = drag}, &F);
    Matrix15 P = Matrix15::Zero();
    for (int i = 0; i < 10; ++i) {
      P = F * P * F.transpose() + process_covariance(noise, 0.01, z_N, drag);
    }
    const Matrix15 whole = process_covariance(noise, 0.1, z_N, drag);
    EXPECT_LT((P - whole).norm(), 1e-9 * whole.norm()) << drag;
  }
}

}  // namespace
}  // namespace alight
