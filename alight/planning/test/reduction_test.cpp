#include "alight/planning/reduction.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"
#include "alight/planning/test/bezier_state.h"

namespace alight {
namespace {

Vector3 random_vector(Rng& rng, double size) {
  return {rng.uniform(-size, size), rng.uniform(-size, size), rng.uniform(-size, size)};
}

struct Sample {
  FlatState start, end;
  std::array<Seconds, kSegments> T;
  Matrix73 x;

  explicit Sample(unsigned seed) {
    Rng rng(seed);
    start.p_NB = random_vector(rng, 2);
    start.v_NB = random_vector(rng, 1);
    start.a_NB = random_vector(rng, 3);
    end.p_NB = random_vector(rng, 1);
    end.v_NB = random_vector(rng, 0.5);
    end.a_NB = random_vector(rng, 1);
    T = {rng.uniform(0.4, 4), rng.uniform(0.4, 4)};
    for (double& value : x.reshaped()) value = rng.uniform(-2, 2);
  }
};

void expect_same(const FlatState& a, const FlatState& b) {
  EXPECT_LT((a.p_NB - b.p_NB).norm(), 1e-12);
  EXPECT_LT((a.v_NB - b.v_NB).norm(), 1e-10);
  EXPECT_LT((a.a_NB - b.a_NB).norm(), 1e-9);
}

class ReductionProperty : public testing::TestWithParam<unsigned> {};

TEST_P(ReductionProperty, EveryXMeetsStartEndAndContinuity) {
  const Sample s(GetParam());
  const Reduction r(s.start, s.end, s.T);
  const ControlPoints c = r.points(0, s.x);
  const ControlPoints d = r.points(1, s.x);
  expect_same(test::bezier_state(c, 0, s.T[0]), s.start);
  expect_same(test::bezier_state(d, 1, s.T[1]), s.end);
  expect_same(test::bezier_state(c, 1, s.T[0]), test::bezier_state(d, 0, s.T[1]));
}

TEST_P(ReductionProperty, QuadraticFormIsTheJerkCost) {
  const Sample s(GetParam());
  const Reduction r(s.start, s.end, s.T);
  const double cost =
      jerk_cost(r.points(0, s.x), s.T[0]) + jerk_cost(r.points(1, s.x), s.T[1]);
  const double form = (r.H * s.x + 2 * r.g).cwiseProduct(s.x).sum() + r.k;
  EXPECT_NEAR(form / std::pow(r.h, 5) / cost, 1, 1e-9);
}

TEST_P(ReductionProperty, WhiteningIsAnIsometryOfTheCost) {
  const Sample s(GetParam());
  const Reduction r(s.start, s.end, s.T);
  const Whitened w(r);
  // s.x taken as u: the cost is |u|^2 away from that of the unconstrained optimum.
  const auto cost = [&](const Matrix73& u) {
    double sum = 0;
    for (std::size_t k = 0; k < kSegments; ++k) {
      sum += jerk_cost(w.c0[k] + w.W[k].transpose() * u, s.T[k]);
    }
    return sum * std::pow(r.h, 5);
  };
  const Matrix73 zero = Matrix73::Zero();
  EXPECT_NEAR((cost(s.x) - cost(zero)) / s.x.squaredNorm(), 1, 1e-6);
  const Matrix73 x = w.variables(s.x);
  for (std::size_t k = 0; k < kSegments; ++k) {
    const ControlPoints same = w.c0[k] + w.W[k].transpose() * s.x;
    EXPECT_LT((r.points(k, x) - same).norm(), 1e-9);
  }
}

TEST_P(ReductionProperty, HessianDependsOnTheRatioAlone) {
  const Sample s(GetParam());
  const Reduction a(s.start, s.end, s.T);
  const Reduction b(s.end, s.start, {3 * s.T[0], 3 * s.T[1]});
  EXPECT_LT((a.H - b.H).norm(), 1e-12 * a.H.norm());
}

INSTANTIATE_TEST_SUITE_P(Seeds, ReductionProperty, testing::Range(0u, 50u));

}  // namespace
}  // namespace alight
