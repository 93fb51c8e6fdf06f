#include "alight/geometry/camera.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kNearest = 0.01;  // m; nothing closer to the lens has an image.
constexpr double kWidest =
    20;  // tangent off the axis; no lens with this model sees more
constexpr int kFoldSteps = 32;
constexpr double kSamePx = 0.01;

/// Distorts normalized coordinates; `D` receives the derivative when given.
Vector2 distort(const std::array<double, 5>& d, const Vector2& n, Matrix2* D) {
  const auto [k1, k2, p1, p2, k3] = d;
  const double x = n.x(), y = n.y();
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  if (D != nullptr) {
    const double slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3));  // d radial / d(r2/2)
    (*D)(0, 0) = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x;
    (*D)(0, 1) = x * y * slope + 2 * p1 * x + 2 * p2 * y;
    (*D)(1, 0) = (*D)(0, 1);
    (*D)(1, 1) = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x;
  }
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

}  // namespace

bool Intrinsics::has_distortion() const {
  const auto [k1, k2, p1, p2, k3] = distortion;
  return k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0;
}

std::optional<Vector2> Intrinsics::project(const Vector3& p_CL) const {
  if (!(p_CL.z() > kNearest)) return std::nullopt;
  Vector2 n = p_CL.head<2>() / p_CL.z();
  if (has_distortion()) n = distort(distortion, n, nullptr);
  return Vector2(fx * n.x() + cx, fy * n.y() + cy);
}

std::optional<Vector2> Intrinsics::project(const Vector3& p_CL,
                                           Matrix23& duv_dp) const {
  if (!(p_CL.z() > kNearest)) return std::nullopt;
  const double iz = 1 / p_CL.z();
  Vector2 n = p_CL.head<2>() * iz;
  duv_dp << iz, 0, -n.x() * iz, 0, iz, -n.y() * iz;
  if (has_distortion()) {
    Matrix2 D;
    n = distort(distortion, n, &D);
    duv_dp = D * duv_dp;
  }
  duv_dp.row(0) *= fx;
  duv_dp.row(1) *= fy;
  return Vector2(fx * n.x() + cx, fy * n.y() + cy);
}

Vector3 Intrinsics::unproject(const Vector2& uv) const {
  const Vector2 distorted((uv.x() - cx) / fx, (uv.y() - cy) / fy);
  Vector2 n = distorted;
  if (has_distortion()) {
    for (int i = 0; i < 20; ++i) {
      Matrix2 D;
      const Vector2 residual = distort(distortion, n, &D) - distorted;
      const Vector2 step = D.inverse() * residual;
      n -= step;
      if (step.squaredNorm() < 1e-24) break;
    }
  }
  return {n.x(), n.y(), 1};
}

bool Intrinsics::sees(const Vector2& uv) const {
  if (!has_distortion()) return true;
  const Vector3 ray = unproject(uv);
  const double widest = ray.head<2>().norm();
  if (!(widest < kWidest)) return false;
  const auto [k1, k2, p1, p2, k3] = distortion;
  for (int i = 1; i <= kFoldSteps; ++i) {
    const double r = widest * i / kFoldSteps;
    const double r2 = r * r;
    if (1 + r2 * (3 * k1 + r2 * (5 * k2 + r2 * 7 * k3)) <= 0) return false;
  }
  const auto again = project(ray);
  return again && (*again - uv).norm() < kSamePx;
}

bool Intrinsics::contains(const Vector2& uv, double border) const {
  return uv.x() >= border - 0.5 && uv.x() <= width - 0.5 - border &&
         uv.y() >= border - 0.5 && uv.y() <= height - 0.5 - border;
}

std::optional<Vector2> project_led(const Camera& camera, const Pose& X_NB,
                                   const Vector3& p_BL, Matrix26* J) {
  const Matrix3 R_CN = camera.X_NC.linear().transpose();
  const Vector3 p_CL = R_CN * (X_NB * p_BL - camera.X_NC.translation());
  if (J == nullptr) return camera.intrinsics.project(p_CL);
  Matrix23 duv_dp;
  const auto uv = camera.intrinsics.project(p_CL, duv_dp);
  if (uv) {
    const Matrix23 duv_dpN = duv_dp * R_CN;
    J->leftCols<3>() = duv_dpN;
    // duv_dpB * -[p_BL]x, column by column.
    const Matrix23 duv_dpB = duv_dpN * X_NB.linear();
    J->col(3) = duv_dpB.col(2) * p_BL.y() - duv_dpB.col(1) * p_BL.z();
    J->col(4) = duv_dpB.col(0) * p_BL.z() - duv_dpB.col(2) * p_BL.x();
    J->col(5) = duv_dpB.col(1) * p_BL.x() - duv_dpB.col(0) * p_BL.y();
  }
  return uv;
}

}  // namespace alight
