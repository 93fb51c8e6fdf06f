#include <algorithm>
#include <cmath>

#include "alight/planning/corridor.h"

namespace alight {
namespace {

constexpr int kEdgeSamples = 33;

}  // namespace

std::array<ViewPlane, 4> view_planes(const Camera& camera, double border_px) {
  const Intrinsics& k = camera.intrinsics;
  const double u0 = border_px;
  const double v0 = border_px;
  const double u1 = k.width - 1 - border_px;
  const double v1 = k.height - 1 - border_px;
  double left = -1e9;
  double right = 1e9;
  double top = -1e9;
  double bottom = 1e9;
  for (int i = 0; i < kEdgeSamples; ++i) {
    const double s = static_cast<double>(i) / (kEdgeSamples - 1);
    const double u = u0 + s * (u1 - u0);
    const double v = v0 + s * (v1 - v0);
    // Beyond where its distortion folds back the lens sees nothing.
    if (k.sees({u0, v})) left = std::max(left, k.unproject({u0, v}).x());
    if (k.sees({u1, v})) right = std::min(right, k.unproject({u1, v}).x());
    if (k.sees({u, v0})) top = std::max(top, k.unproject({u, v0}).y());
    if (k.sees({u, v1})) bottom = std::min(bottom, k.unproject({u, v1}).y());
  }
  const auto plane = [&](const Vector3& n_C, Constraint meaning) {
    return ViewPlane{camera.X_NC.linear() * n_C.normalized(), meaning};
  };
  return {plane({-1, 0, left}, Constraint::view_left),
          plane({1, 0, -right}, Constraint::view_right),
          plane({0, -1, top}, Constraint::view_upper),
          plane({0, 1, -bottom}, Constraint::view_lower)};
}

Vector3 pad_shadow_normal(const Camera& camera, const PadSpec& pad) {
  const Vector3 p_NC = camera.X_NC.translation();
  const Vector3 look = camera.X_NC.linear().col(2);
  // The pad's edge across the axis that the camera mostly looks along.
  const int axis = std::abs(look.x()) >= std::abs(look.y()) ? 0 : 1;
  const double ahead = look[axis] >= 0 ? 1.0 : -1.0;
  const double side = p_NC.z() >= 0 ? ahead : -ahead;  // far edge, or the near one
  const double run = side * pad.size_m / 2 - p_NC[axis];
  if (run * ahead <= 1e-6) return Vector3::Zero();  // no such edge in front of the lens
  // Direction of the ray in the vertical plane along `axis`, turned by 90 deg
  // downwards.
  Vector3 n = Vector3::Zero();
  n[axis] = -p_NC.z() / run * 1.0;
  n.z() = -1;
  return n.normalized();
}

double led_support(const Constellation& leds, const Vector3& n, const YawRange& yaw,
                   double angle) {
  double best = -1e9;
  const double n_h = std::hypot(n.x(), n.y());
  for (int i = 0; i < leds.size(); ++i) {
    const Vector3& p = leds.p_BL(i);
    const double p_h = std::hypot(p.x(), p.y());
    // n'Rz(yaw) p is greatest where the heading of p meets that of n.
    const double wanted = std::atan2(n.y(), n.x()) - std::atan2(p.y(), p.x());
    const double mid = 0.5 * (yaw.low + yaw.high);
    const double off =
        std::max(0.0, std::abs(wrap_angle(wanted - mid)) - 0.5 * (yaw.high - yaw.low));
    const double along = n.z() * p.z() + n_h * p_h * std::cos(off);
    const double length = p.norm();
    if (length < 1e-12) {
      best = std::max(best, 0.0);
      continue;
    }
    const double between = std::acos(std::clamp(along / length, -1.0, 1.0));
    best = std::max(best, length * std::cos(std::max(0.0, between - angle)));
  }
  return best;
}

YawRange yaw_range(double start, double end) {
  const double turn = wrap_angle(end - start);
  return {std::min(start, start + turn), std::max(start, start + turn)};
}

}  // namespace alight
