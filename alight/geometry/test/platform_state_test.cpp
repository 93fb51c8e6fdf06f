#include "alight/geometry/platform_state.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"

namespace alight {
namespace {

Vector3 draw(Rng& rng, double sd) {
  return {rng.normal(0, sd), rng.normal(0, sd), rng.normal(0, sd)};
}

/// A circle of radius r at constant speed, in closed form.
PlatformState circle(double t, double speed, double r) {
  PlatformState s;
  const double w = speed / r, a = w * t;
  s.t = from_seconds(t);
  s.X_IN =
      make_pose(from_rpy(0, 0, a), Vector3(r * std::sin(a), r * (1 - std::cos(a)), 0));
  s.v_IN_N = Vector3(speed, 0, 0);
  s.w_IN_N = Vector3(0, 0, w);
  s.a_IN_N = Vector3(0, w * speed, 0);
  return s;
}

TEST(Predict, IsExactOnACircle) {
  for (const double dt : {-0.4, -0.01, 0.0, 1e-7, 0.05, 0.5, 3.0, 11.0}) {
    const PlatformState a = predict(circle(2, 0.9, 1.5), dt);
    const PlatformState b = circle(2 + dt, 0.9, 1.5);
    EXPECT_LT((a.X_IN.matrix() - b.X_IN.matrix()).norm(), 1e-12) << dt;
    EXPECT_EQ(a.t, b.t);
    EXPECT_EQ(a.v_IN_N, b.v_IN_N);
    EXPECT_EQ(a.a_IN_N, b.a_IN_N);
  }
}

TEST(Predict, ComposesAndReturns) {
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    PlatformState s;
    s.X_IN = make_pose(so3_exp(draw(rng, 1)), draw(rng, 2));
    s.v_IN_N = draw(rng, 1);
    s.w_IN_N = draw(rng, 0.7);
    const PlatformState two = predict(predict(s, 0.3), 0.4), one = predict(s, 0.7);
    EXPECT_LT((two.X_IN.matrix() - one.X_IN.matrix()).norm(), 1e-12);
    EXPECT_LT((predict(one, -0.7).X_IN.matrix() - s.X_IN.matrix()).norm(), 1e-12);
  }
}

TEST(Gravity, PointsDownInI) {
  PlatformState s;
  s.X_IN.linear() = from_rpy(0.1, -0.2, 1);
  EXPECT_LT((s.X_IN.linear() * gravity_N(s) - Vector3(0, 0, -kGravity)).norm(), 1e-14);
}

/// Platform with analytic motion (tumbling), body with analytic motion in N: what I
/// sees of B by differences, against the formulas.
struct Scene {
  static Vector3 p_IN(double t) {
    return {std::sin(0.9 * t), 0.5 * std::cos(1.3 * t), 0.2 * std::sin(2 * t)};
  }
  static Matrix3 R_IN(double t) {
    return from_rpy(0.2 * std::sin(1.1 * t), 0.15 * std::cos(0.8 * t), 0.6 * t);
  }
  static Vector3 p_NB(double t) {
    return {-1.2 + 0.3 * std::sin(1.7 * t), 0.4 * std::cos(t), 0.5 + 0.1 * t * t};
  }
};

constexpr double kH = 1e-3;
template <class F>
auto first(const F& f, double t) {
  return ((8 * (f(t + kH) - f(t - kH)) - (f(t + 2 * kH) - f(t - 2 * kH))) / (12 * kH))
      .eval();
}
template <class F>
Vector3 second(const F& f, double t) {
  return (16 * (f(t + kH) + f(t - kH)) - f(t + 2 * kH) - f(t - 2 * kH) - 30 * f(t)) /
         (12 * kH * kH);
}

/// Rate of R_IN in N.
Vector3 w_IN_N(double t) {
  const Matrix3 W = Scene::R_IN(t).transpose() * first(Scene::R_IN, t);
  return {W(2, 1), W(0, 2), W(1, 0)};
}

TEST(RelativeMotion, AgreesWithDifferencesSeenFromI) {
  for (double t = 0; t < 5; t += 0.13) {
    const Matrix3 R_NI = Scene::R_IN(t).transpose();
    PlatformState s;
    s.X_IN = make_pose(Scene::R_IN(t), Scene::p_IN(t));
    s.v_IN_N = R_NI * first(Scene::p_IN, t);
    s.a_IN_N = R_NI * second(Scene::p_IN, t);
    s.w_IN_N = w_IN_N(t);
    s.alpha_IN_N = first(w_IN_N, t);
    const Vector3 p = Scene::p_NB(t), v = first(Scene::p_NB, t);
    const Vector3 a = second(Scene::p_NB, t);
    const auto p_IB = [](double x) -> Vector3 {
      return Scene::p_IN(x) + Scene::R_IN(x) * Scene::p_NB(x);
    };
    EXPECT_LT((inertial_velocity_N(s, p, v) - R_NI * first(p_IB, t)).norm(), 1e-8);
    EXPECT_LT((inertial_acceleration_N(s, p, v, a) - R_NI * second(p_IB, t)).norm(),
              1e-6);
  }
}

TEST(RelativeMotion, AccelerationsAreInverse) {
  Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    PlatformState s;
    s.w_IN_N = draw(rng, 1);
    s.a_IN_N = draw(rng, 1);
    s.alpha_IN_N = draw(rng, 1);
    const Vector3 p = draw(rng, 1), v = draw(rng, 1), a = draw(rng, 1);
    EXPECT_LT((relative_acceleration(s, p, v, inertial_acceleration_N(s, p, v, a)) - a)
                  .norm(),
              1e-13);
  }
}

}  // namespace
}  // namespace alight
