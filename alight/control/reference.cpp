#include "alight/control/reference.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/geometry/so3.h"

namespace alight {
namespace {

using Row6 = Eigen::Matrix<double, 1, 6>;

/// Quintic from (p, v, a) to rest at `to` within T.
Row6 quintic(double p, double v, double a, double to, double T) {
  const double d = to - p - v * T - 0.5 * a * T * T;
  const double dv = -v - a * T;
  const double da = -a;
  const double T2 = T * T, T3 = T2 * T;
  Row6 c;
  c << p, v, 0.5 * a, (10 * d - 4 * dv * T + 0.5 * da * T2) / T3,
      (-15 * d + 7 * dv * T - da * T2) / (T3 * T),
      (6 * d - 3 * dv * T + 0.5 * da * T2) / (T3 * T2);
  return c;
}

/// Of t, and their derivatives.
Eigen::Matrix<double, 6, 4> powers(double t) {
  const double t2 = t * t, t3 = t2 * t, t4 = t3 * t, t5 = t4 * t;
  Eigen::Matrix<double, 6, 4> basis;
  basis << 1, 0, 0, 0,              //
      t, 1, 0, 0,                   //
      t2, 2 * t, 2, 0,              //
      t3, 3 * t2, 6 * t, 6,         //
      t4, 4 * t3, 12 * t2, 24 * t,  //
      t5, 5 * t4, 20 * t3, 60 * t2;
  return basis;
}

}  // namespace

PointToPoint::PointToPoint(Time start, const FlatState& from, const Vector3& to_p_NB,
                           double to_yaw, const MoveLimits& limits)
    : start_(start), from_(from), to_(to_p_NB) {
  const double turn = wrap_angle(to_yaw - from.yaw);
  to_yaw_ = from.yaw + turn;

  const auto prepare = [&](Seconds T) {
    duration_ = rise_ = T;
    for (int i = 0; i < 3; ++i) {
      c_.row(i) = quintic(from.p_NB[i], from.v_NB[i], from.a_NB[i], to_[i], T);
    }
    yaw_c_ = quintic(from.yaw, from.yaw_rate, 0, to_yaw_, T);
  };
  // A start beyond the bounds is forgiven, with a tenth on top to let it brake.
  const double v_max = std::max(limits.speed_m_s, 1.1 * from.v_NB.norm());
  const double a_max = std::max(limits.acceleration_m_s2, 1.1 * from.a_NB.norm());
  const double yaw_max = std::max(limits.yaw_rate_rad_s, 1.1 * std::abs(from.yaw_rate));
  // How far beyond its bounds the move goes; 1 is just within.
  const auto excess = [&] {
    constexpr int samples = 32;
    double most = 0;
    for (int k = 0; k <= samples; ++k) {
      const FlatState s = evaluate(duration_ * k / samples);
      most = std::max({most, s.v_NB.norm() / v_max, s.a_NB.norm() / a_max,
                       std::abs(s.yaw_rate) / yaw_max});
    }
    return most;
  };

  // Peaks of the move from rest bound the duration from below; then in small ratios up.
  const double d = (to_ - from.p_NB).norm();
  double T = std::max({0.2, 1.5 * d / v_max, std::sqrt(4 * d / a_max)});
  // A start that gains speed by itself leaves its bounds whatever the duration, and the
  // further the longer it takes: then the least of them.
  Seconds best = T;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 80; ++k, T *= 1.06) {
    prepare(T);
    const double now = excess();
    if (now < least) {
      least = now;
      best = T;
    }
    if (now <= 1.001) break;
  }
  if (best != duration_) prepare(best);
  if (from.v_NB.z() < 0 && to_.z() > from.p_NB.z()) rise_sooner(limits);
}

void PointToPoint::rise_sooner(const MoveLimits& limits) {
  constexpr int kSamples = 32;
  for (Seconds T = duration_; T > 0.1; T *= 0.94) {
    const Row6 z = quintic(from_.p_NB.z(), from_.v_NB.z(), from_.a_NB.z(), to_.z(), T);
    double least = from_.p_NB.z(), hardest = 0;
    for (int k = 0; k <= kSamples; ++k) {
      const Eigen::Matrix<double, 6, 4> basis = powers(T * k / kSamples);
      least = std::min(least, double(z * basis.col(0)));
      hardest = std::max(hardest, std::abs(double(z * basis.col(2))));
    }
    if (hardest > std::max(limits.lift_m_s2, 1.1 * std::abs(from_.a_NB.z()))) return;
    rise_ = T;
    c_.row(2) = z;
    if (from_.p_NB.z() - least <= limits.dip_m) return;
  }
}

FlatState PointToPoint::evaluate(Seconds t) const {
  FlatState s;
  const Eigen::Matrix<double, 6, 4> basis = powers(t);
  Eigen::Matrix<double, 3, 4> r = c_ * basis;
  if (t > rise_) r.row(2) << to_.z(), 0, 0, 0;
  s.p_NB = r.col(0);
  s.v_NB = r.col(1);
  s.a_NB = r.col(2);
  s.j_NB = r.col(3);
  s.yaw = yaw_c_ * basis.col(0);
  s.yaw_rate = yaw_c_ * basis.col(1);
  return s;
}

FlatState PointToPoint::at(Time t) const {
  const Seconds s = to_seconds(t - start_);
  if (s > 0 && s < duration_) return evaluate(s);
  FlatState rest;
  rest.p_NB = s <= 0 ? from_.p_NB : to_;
  rest.yaw = s <= 0 ? from_.yaw : to_yaw_;
  // At the very start the motion is the one it came with.
  if (s == 0 && duration_ > 0) return evaluate(0);
  return rest;
}

}  // namespace alight
