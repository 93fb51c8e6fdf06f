#include "alight/planning/bezier_basis.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

namespace alight {
namespace {

ControlPoints random_points(Rng& rng) {
  ControlPoints c;
  for (double& value : c.reshaped()) value = rng.uniform(-2, 2);
  return c;
}

std::array<Vector3, kControlPoints> as_array(const ControlPoints& c) {
  std::array<Vector3, kControlPoints> out;
  for (int i = 0; i < kControlPoints; ++i) {
    out[static_cast<std::size_t>(i)] = c.row(i).transpose();
  }
  return out;
}

double bernstein(int n, int i, double u) {
  double value = 1;
  for (int k = 1; k <= i; ++k) value = value * (n - i + k) / k;
  return value * std::pow(u, i) * std::pow(1 - u, n - i);
}

Vector3 value(const ControlPoints& c, int count, double u) {
  Vector3 x = Vector3::Zero();
  for (int i = 0; i < count; ++i)
    x += bernstein(count - 1, i, u) * c.row(i).transpose();
  return x;
}

class BezierProperty : public testing::TestWithParam<unsigned> {};

TEST_P(BezierProperty, HodographIsTheDerivativeWhateverItsDegree) {
  Rng rng(GetParam());
  const ControlPoints c = random_points(rng);
  const double T = rng.uniform(0.3, 4);
  const double u = rng.uniform();
  FlatState state;
  evaluate_bezier(as_array(c), u, T, state);
  for (const bool raised : {false, true}) {
    const Hodograph& v = velocity_map(raised);
    const Hodograph& a = acceleration_map(raised);
    EXPECT_EQ(v.count, raised ? 8 : 7);
    EXPECT_EQ(a.count, raised ? 8 : 6);
    const ControlPoints cv = v.map * c / T;
    const ControlPoints ca = a.map * c / (T * T);
    EXPECT_LT((value(cv, v.count, u) - state.v_NB).norm(), 1e-11 / T);
    EXPECT_LT((value(ca, a.count, u) - state.a_NB).norm(), 1e-10 / (T * T));
  }
}

TEST_P(BezierProperty, JerkCostIsTheIntegralOfTheSquaredJerk) {
  Rng rng(GetParam());
  const ControlPoints c = random_points(rng);
  const double T = rng.uniform(0.3, 4);
  // Degree 8 in u: Gauss-Legendre with five points is exact.
  const double x[] = {0, 0.5384693101056831, 0.9061798459386640};
  const double w[] = {0.5688888888888889, 0.4786286704993665, 0.2369268850561891};
  double integral = 0;
  for (int k = -2; k <= 2; ++k) {
    const double u = 0.5 + 0.5 * (k < 0 ? -1 : 1) * x[std::abs(k)];
    FlatState state;
    evaluate_bezier(as_array(c), u, T, state);
    integral += 0.5 * T * w[std::abs(k)] * state.j_NB.squaredNorm();
  }
  EXPECT_NEAR(jerk_cost(c, T) / integral, 1, 1e-11);
}

INSTANTIATE_TEST_SUITE_P(Seeds, BezierProperty, testing::Range(0u, 50u));

TEST(BezierBasis, JerkOfAParabolaIsNothing) {
  ControlPoints c;
  for (int i = 0; i < kControlPoints; ++i) c.row(i) << i, 3 - 2 * i, i * (i - 1);
  EXPECT_NEAR(jerk_cost(c, 0.7), 0, 1e-18);
}

}  // namespace
}  // namespace alight
