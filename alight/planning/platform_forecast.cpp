#include "alight/planning/platform_forecast.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

/// Value and two derivatives of the cubic with these values and rates at its ends.
struct Cubic {
  Vector3 x, dx, ddx;

  Cubic(const Vector3& x0, const Vector3& d0, const Vector3& x1, const Vector3& d1,
        double s, Seconds h) {
    const Vector3 b = h * d0;
    const Vector3 c = 3 * (x1 - x0) - h * (2 * d0 + d1);
    const Vector3 d = 2 * (x0 - x1) + h * (d0 + d1);
    x = x0 + s * (b + s * (c + s * d));
    dx = (b + s * (2 * c + 3 * s * d)) / h;
    ddx = (2 * c + 6 * s * d) / (h * h);
  }
};

FrameMotion assembled(const Vector3& v, const Vector3& a, const Vector3& da,
                      const Vector3& w, const Vector3& alpha, const Vector3& dalpha,
                      const Vector3& g) {
  const Matrix3 W = hat(w);
  const Matrix3 A = hat(alpha);
  FrameMotion motion;
  motion.v0 = v;
  motion.a0 = a;
  motion.f0 = a - g;
  motion.j0 = da + w.cross(a);
  motion.w = W;
  motion.a_p = W * W + A;
  motion.j_v = 3 * motion.a_p;
  motion.j_p = A * W + 2 * W * A + hat(dalpha) + W * W * W;
  return motion;
}

}  // namespace

bool PlatformForecast::add(const PlatformState& state) {
  PlatformNode node;
  node.v_IN_N = state.v_IN_N;
  node.w_IN_N = state.w_IN_N;
  node.dv_N = state.a_IN_N - state.w_IN_N.cross(state.v_IN_N);
  node.dw_N = state.alpha_IN_N;
  node.g_N = gravity_N(state);
  return nodes.push_back(node);
}

PlatformForecast constant_acceleration(const PlatformState& state, Seconds duration) {
  PlatformForecast forecast;
  forecast.step = duration / (PlatformForecast::kNodes - 1);
  PlatformState at = state;
  const Vector3 dv = state.a_IN_N - state.w_IN_N.cross(state.v_IN_N);
  for (std::size_t k = 0; k < PlatformForecast::kNodes; ++k) {
    const Seconds t = static_cast<double>(k) * forecast.step;
    at.v_IN_N = state.v_IN_N + dv * t;
    at.w_IN_N = state.w_IN_N + state.alpha_IN_N * t;
    at.a_IN_N = dv + at.w_IN_N.cross(at.v_IN_N);
    forecast.add(at);
    // Attitude in between by the mean turn rate: exact about a fixed axis.
    const Vector3 mean = at.w_IN_N + 0.5 * forecast.step * state.alpha_IN_N;
    at.X_IN.linear() =
        orthonormalized(at.X_IN.linear() * so3_exp(mean * forecast.step));
  }
  return forecast;
}

FrameMotion frame_motion(const PlatformState& platform,
                         const PlatformForecast& forecast, Seconds t) {
  const Vector3 zero = Vector3::Zero();
  const auto& nodes = forecast.nodes;
  if (nodes.empty()) {
    // All that is told of the platform stays as it is, its accelerations too.
    FrameMotion motion =
        assembled(platform.v_IN_N, platform.a_IN_N, zero, platform.w_IN_N,
                  platform.alpha_IN_N, zero, gravity_N(platform));
    motion.j_v = motion.a_p + 2 * motion.w * motion.w;
    motion.j_p = motion.w * motion.a_p;
    return motion;
  }
  const double last = static_cast<double>(nodes.size() - 1);
  const double at = std::max(t + forecast.begin, 0.0) / forecast.step;
  if (at >= last && (nodes.size() == 1 || at > last + 1e-9)) {
    const PlatformNode& n = nodes.back();
    return assembled(n.v_IN_N, n.w_IN_N.cross(n.v_IN_N), zero, n.w_IN_N, zero, zero,
                     n.g_N);
  }
  const double begin = std::min(std::floor(at), last - 1);
  const auto i = static_cast<std::size_t>(begin);
  const PlatformNode& a = nodes[i];
  const PlatformNode& b = nodes[i + 1];
  const double s = at - begin;
  const Seconds h = forecast.step;
  const Cubic v(a.v_IN_N, a.dv_N, b.v_IN_N, b.dv_N, s, h);
  const Cubic w(a.w_IN_N, a.dw_N, b.w_IN_N, b.dw_N, s, h);
  const Cubic g(a.g_N, -a.w_IN_N.cross(a.g_N), b.g_N, -b.w_IN_N.cross(b.g_N), s, h);
  const Vector3 a_IN = v.dx + w.x.cross(v.x);
  const Vector3 da = v.ddx + w.dx.cross(v.x) + w.x.cross(v.dx);
  return assembled(v.x, a_IN, da, w.x, w.dx, w.ddx, g.x);
}

}  // namespace alight
