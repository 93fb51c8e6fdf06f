#include "alight/vision/pad_mirror.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kHighest = 0.5;          // m, of a light above the pad
const double kTurn = 4 * kDegree;         // by which mount and lens may be off together
constexpr double kTolerance_px = 2;       // two centroids, one of them dim
constexpr double kToleranceShare = 0.08;  // of the way between: mount and pad not level

}  // namespace

Vector3 PadMirror::point_on_pad(const Vector3& ray_N) const {
  const Vector3& lens = camera_.X_NC.translation();
  return lens - lens.z() / ray_N.z() * ray_N;
}

Vector3 PadMirror::nearest_on_pad(const Vector3& q) const {
  // A mount that is off by little moves what is seen flatly by a long way, but towards
  // the lens or away from it: there is where to look, as far as the pad reaches.
  const Vector3& lens = camera_.X_NC.translation();
  double begin = 0, end = 1;
  for (int k = 0; k < 2; ++k) {
    const double way = q[k] - lens[k];
    if (way == 0) {
      if (std::abs(lens[k]) > half_) end = -1;
      continue;
    }
    const double a = (-half_ - lens[k]) / way, b = (half_ - lens[k]) / way;
    begin = std::max(begin, std::min(a, b));
    end = std::min(end, std::max(a, b));
  }
  if (begin <= end) {
    return {lens.x() + end * (q.x() - lens.x()), lens.y() + end * (q.y() - lens.y()),
            0};
  }
  return {std::clamp(q.x(), -half_, half_), std::clamp(q.y(), -half_, half_), 0};
}

bool PadMirror::shows(const Vector2& uv) const {
  const Vector3 ray = camera_.X_NC.linear() * camera_.intrinsics.unproject(uv);
  if (half_ <= 0 || ray.z() >= -1e-6 || camera_.X_NC.translation().z() <= 0) {
    return false;
  }
  const Vector3 way = nearest_on_pad(point_on_pad(ray)) - camera_.X_NC.translation();
  return way.dot(ray) >= std::cos(kTurn) * way.norm() * ray.norm();
}

bool PadMirror::may_mirror(const Vector2& light_uv, const Vector2& uv) const {
  if (!shows(uv)) return false;
  const Matrix3& R_NC = camera_.X_NC.linear();
  const Vector3 down = R_NC * camera_.intrinsics.unproject(uv);
  const Vector3 q = point_on_pad(down);
  // The light lies somewhere on the reflected ray: nearest to the ray it is seen along.
  const Vector3 up = Vector3(down.x(), down.y(), -down.z()).normalized();
  const Vector3 seen = (R_NC * camera_.intrinsics.unproject(light_uv)).normalized();
  const Vector3 w = q - camera_.X_NC.translation();
  const double c = up.dot(seen);
  if (1 - c * c < 1e-9) return false;
  const double along = (c * seen.dot(w) - up.dot(w)) / (1 - c * c);
  if (along <= 0 || along * up.z() > kHighest) return false;
  const Vector3 p_NL = q + along * up;
  const auto image = camera_.intrinsics.project(camera_.X_NC.inverse() * p_NL);
  return image && (*image - light_uv).norm() <=
                      kTolerance_px + kToleranceShare * (light_uv - uv).norm();
}

}  // namespace alight
