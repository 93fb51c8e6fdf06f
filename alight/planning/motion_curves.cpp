#include <algorithm>
#include <cmath>

#include "alight/planning/limits.h"

namespace alight {
namespace {

constexpr int kDegreeOfCurve = kControlPoints - 1;

double binomial(int n, int k) {
  double value = 1;
  for (int i = 1; i <= k; ++i) value = value * (n - k + i) / i;
  return value;
}

/// w[j][k]: product_weight(kForecastDegree, j, k).
using Weights = std::array<std::array<double, kControlPoints>, kForecastDegree + 1>;
const Weights& weights() {
  static const Weights table = [] {
    Weights w{};
    for (int j = 0; j <= kForecastDegree; ++j) {
      for (int k = 0; k <= kDegreeOfCurve; ++k) {
        w[static_cast<std::size_t>(j)][static_cast<std::size_t>(k)] =
            binomial(kForecastDegree, j) * binomial(kDegreeOfCurve, k) /
            binomial(kForecastDegree + kDegreeOfCurve, j + k);
      }
    }
    return w;
  }();
  return table;
}

using Raise = Eigen::Matrix<double, kMotionPoints, kControlPoints>;
const Raise& raise_curve() {
  static const Raise raise = [] {
    Eigen::MatrixXd E = Eigen::MatrixXd::Identity(kControlPoints, kControlPoints);
    for (int n = kControlPoints; n < kMotionPoints; ++n) E = degree_elevation(n) * E;
    return Raise(E);
  }();
  return raise;
}

using RaiseFrame = Eigen::Matrix<double, kMotionPoints, kForecastDegree + 1>;
const RaiseFrame& raise_frame() {
  static const RaiseFrame raise = [] {
    Eigen::MatrixXd E =
        Eigen::MatrixXd::Identity(kForecastDegree + 1, kForecastDegree + 1);
    for (int n = kForecastDegree + 1; n < kMotionPoints; ++n) {
      E = degree_elevation(n) * E;
    }
    return RaiseFrame(E);
  }();
  return raise;
}

using Full = Eigen::Matrix<double, kMotionPoints, 3>;

/// out += (matrix polynomial) times curve.
template <class Part>
void add_product(const SegmentFrame& frame, double factor, Part part,
                 const ControlPoints& curve, Full& out) {
  const Weights& w = weights();
  for (std::size_t j = 0; j <= kForecastDegree; ++j) {
    const Matrix3 m = factor * part(frame.at[j]).transpose();
    const ControlPoints moved = curve * m;
    for (std::size_t k = 0; k < kControlPoints; ++k) {
      out.row(static_cast<Eigen::Index>(j + k)) +=
          w[j][k] * moved.row(static_cast<Eigen::Index>(k));
    }
  }
}

template <class Part>
Full raised_constant(const SegmentFrame& frame, Part part) {
  Eigen::Matrix<double, kForecastDegree + 1, 3> c;
  for (std::size_t j = 0; j <= kForecastDegree; ++j) {
    c.row(static_cast<Eigen::Index>(j)) = part(frame.at[j]).transpose();
  }
  return raise_frame() * c;
}

FrameMotion combined(const std::array<FrameMotion, kForecastDegree + 1>& f,
                     const std::array<double, kForecastDegree + 1>& by) {
  FrameMotion sum;
  for (std::size_t i = 0; i < f.size(); ++i) {
    sum.v0 += by[i] * f[i].v0;
    sum.a0 += by[i] * f[i].a0;
    sum.f0 += by[i] * f[i].f0;
    sum.j0 += by[i] * f[i].j0;
    sum.w += by[i] * f[i].w;
    sum.a_p += by[i] * f[i].a_p;
    sum.j_v += by[i] * f[i].j_v;
    sum.j_p += by[i] * f[i].j_p;
  }
  return sum;
}

/// Cubics through four instants of the forecast; what they miss in between, with the
/// greatest p, v and a that the limits allow, is the slack.
SegmentFrame fitted(const DynamicLimitRows& limits, Seconds begin, Seconds T) {
  const auto motion = [&](double share) {
    return frame_motion(limits.platform, limits.forecast, begin + share * T);
  };
  const std::array<FrameMotion, 4> f{motion(0), motion(1.0 / 3), motion(2.0 / 3),
                                     motion(1)};
  SegmentFrame frame;
  frame.degree = kForecastDegree;
  frame.at[0] = f[0];
  frame.at[1] = combined(f, {-5.0 / 6, 3, -1.5, 1.0 / 3});
  frame.at[2] = combined(f, {1.0 / 3, -1.5, 3, -5.0 / 6});
  frame.at[3] = f[3];
  // Where the error of a cubic through thirds is greatest, with room for waves.
  constexpr double kRoom = 1.5;
  for (const double u : {0.13, 0.5, 0.87}) {
    const double r = 1 - u;
    const FrameMotion told =
        combined(frame.at, {r * r * r, 3 * r * r * u, 3 * r * u * u, u * u * u});
    const FrameMotion true_one = motion(u);
    const double w = (told.w - true_one.w).norm();
    const double p = limits.reach;
    const double v = limits.speed_inside + true_one.v0.norm() + true_one.w.norm() * p;
    const double a = limits.acceleration_inside + true_one.a0.norm() +
                     2 * true_one.w.norm() * v + true_one.a_p.norm() * p;
    const double a_terms = 2 * w * v + (told.a_p - true_one.a_p).norm() * p;
    frame.slack_v =
        std::max(frame.slack_v, kRoom * ((told.v0 - true_one.v0).norm() + w * p));
    frame.slack_a =
        std::max(frame.slack_a, kRoom * ((told.a0 - true_one.a0).norm() + a_terms));
    frame.slack_f =
        std::max(frame.slack_f, kRoom * ((told.f0 - true_one.f0).norm() + a_terms));
    frame.slack_j =
        std::max(frame.slack_j, kRoom * ((told.j0 - true_one.j0).norm() + 3 * w * a +
                                         (told.j_v - true_one.j_v).norm() * v +
                                         (told.j_p - true_one.j_p).norm() * p));
  }
  return frame;
}

}  // namespace

double product_weight(int q, int j, int k) {
  if (q == 0) return 1;
  return weights()[static_cast<std::size_t>(j)][static_cast<std::size_t>(k)];
}

int velocity_points(const DynamicLimitRows& limits) {
  if (limits.varying()) return kMotionPoints;
  return velocity_map(limits.raised).count;
}

int acceleration_points(const DynamicLimitRows& limits) {
  if (limits.varying()) return kMotionPoints;
  return acceleration_map(limits.raised).count;
}

SegmentFrames segment_frames(const DynamicLimitRows& limits,
                             const std::array<Seconds, kSegments>& T) {
  SegmentFrames frames;
  if (limits.varying()) {
    frames[0] = fitted(limits, 0, T[0]);
    frames[1] = fitted(limits, T[0], T[1]);
    return frames;
  }
  for (SegmentFrame& frame : frames) {
    frame.at[0] = frame_motion(limits.platform, limits.forecast, 0);
  }
  return frames;
}

MotionCurves motion_curves(const DynamicLimitRows& limits, const SegmentFrame& frame,
                           const ControlPoints& c, Seconds T) {
  MotionCurves out;
  const FrameMotion& f = frame.at[0];
  if (!limits.raised) {
    const int vs = velocity_map(false).count;
    const int as = acceleration_map(false).count;
    out.v = velocity_map(false).map.topRows(vs) * c / T;
    out.a = acceleration_map(false).map.topRows(as) * c / (T * T);
    out.v.rowwise() += f.v0.transpose();
    out.a.rowwise() += f.a0.transpose();
    return out;
  }
  const ControlPoints v = velocity_map(true).map * c / T;
  const ControlPoints a = acceleration_map(true).map * c / (T * T);
  const ControlPoints j = raised_jerk_map() * c / (T * T * T);
  if (frame.degree == 0) {
    ControlPoints x = v;
    ControlPoints y = a;
    ControlPoints z = j;
    if (limits.turning) {
      x += c * f.w.transpose();
      y += 2 * v * f.w.transpose() + c * f.a_p.transpose();
      z += 3 * a * f.w.transpose() + v * f.j_v.transpose() + c * f.j_p.transpose();
    }
    out.v = x.rowwise() + f.v0.transpose();
    out.a = y.rowwise() + f.a0.transpose();
    out.f = y.rowwise() + f.f0.transpose();
    out.j = z.rowwise() + f.j0.transpose();
    return out;
  }
  const Raise& up = raise_curve();
  Full x = up * v;
  Full y = up * a;
  Full z = up * j;
  const auto w = [](const FrameMotion& m) -> const Matrix3& { return m.w; };
  add_product(frame, 1, w, c, x);
  add_product(frame, 2, w, v, y);
  add_product(frame, 3, w, a, z);
  add_product(
      frame, 1, [](const FrameMotion& m) -> const Matrix3& { return m.a_p; }, c, y);
  add_product(
      frame, 1, [](const FrameMotion& m) -> const Matrix3& { return m.j_v; }, v, z);
  add_product(
      frame, 1, [](const FrameMotion& m) -> const Matrix3& { return m.j_p; }, c, z);
  out.v = x + raised_constant(frame, [](const FrameMotion& m) { return m.v0; });
  out.a = y + raised_constant(frame, [](const FrameMotion& m) { return m.a0; });
  out.f = y + raised_constant(frame, [](const FrameMotion& m) { return m.f0; });
  out.j = z + raised_constant(frame, [](const FrameMotion& m) { return m.j0; });
  return out;
}

}  // namespace alight
