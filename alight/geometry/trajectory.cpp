#include "alight/geometry/trajectory.h"

#include <algorithm>

namespace alight {

void evaluate_bezier(const SegmentPoints& c, double u, Seconds T, FlatState& out) {
  // De Casteljau: the last levels of the triangle hold the differences that the
  // hodograph needs.
  std::array<Vector3, kControlPoints> b = c;
  int level = kControlPoints - 1;
  const auto reduce = [&] {
    for (int i = 0; i < level; ++i) {
      const auto k = static_cast<std::size_t>(i);
      b[k] = (1 - u) * b[k] + u * b[k + 1];
    }
    --level;
  };
  constexpr double n = kControlPoints - 1;
  while (level > 3) reduce();
  out.j_NB = n * (n - 1) * (n - 2) / (T * T * T) * (b[3] - 3 * b[2] + 3 * b[1] - b[0]);
  reduce();
  out.a_NB = n * (n - 1) / (T * T) * (b[2] - 2 * b[1] + b[0]);
  reduce();
  out.v_NB = n / T * (b[1] - b[0]);
  reduce();
  out.p_NB = b[0];
}

FlatState Trajectory::at(Seconds t) const {
  FlatState state;
  t = std::clamp(t, 0.0, duration());
  const std::size_t k = t < durations[0] ? 0 : 1;
  const double u = (k == 0 ? t : t - durations[0]) / durations[k];
  evaluate_bezier(c[k], std::clamp(u, 0.0, 1.0), durations[k], state);
  // Quintic Hermite polynomials of the end, the start's rate and its acceleration.
  const Seconds T = duration();
  const double s = t / T;
  const double r = 1 - s;
  const double turn = wrap_angle(yaw_end - yaw_start);
  const double rate = yaw_rate_start * T;
  const double bend = yaw_acceleration_start * T * T;
  const double yaw = turn * s * s * s * (10 - 15 * s + 6 * s * s) +
                     rate * s * r * r * r * (1 + 3 * s) +
                     bend * 0.5 * s * s * r * r * r;
  state.yaw = wrap_angle(yaw_start + yaw);
  state.yaw_rate =
      (turn * 30 * s * s * r * r + rate * r * r * (1 + 2 * s - 15 * s * s) +
       bend * 0.5 * s * r * r * (2 - 5 * s)) /
      T;
  state.yaw_acceleration =
      (turn * 60 * s * r * (1 - 2 * s) - rate * 12 * s * r * (3 - 5 * s) +
       bend * r * (1 - 8 * s + 10 * s * s)) /
      (T * T);
  return state;
}

}  // namespace alight
