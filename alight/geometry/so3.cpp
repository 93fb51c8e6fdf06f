#include "alight/geometry/so3.h"

#include <Eigen/Geometry>
#include <cmath>

namespace alight {
namespace {
// Below this angle the series is more exact than the quotient.
constexpr double kSmall = 1e-4;
}  // namespace

Matrix3 hat(const Vector3& a) {
  Matrix3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

Matrix3 so3_exp(const Vector3& w) {
  const double t2 = w.squaredNorm();
  const double t = std::sqrt(t2);
  double a, b;  // sin(t) / t and (1 - cos(t)) / t^2
  if (t < kSmall) {
    a = 1 - t2 / 6;
    b = 0.5 - t2 / 24;
  } else {
    a = std::sin(t) / t;
    const double half = std::sin(0.5 * t);
    b = 2 * half * half / t2;
  }
  const Matrix3 W = hat(w);
  return Matrix3::Identity() + a * W + b * W * W;
}

Vector3 so3_log(const Matrix3& R) {
  // By the quaternion: well-conditioned near zero and near a half turn alike.
  Eigen::Quaterniond q(R);
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double n = q.vec().norm();
  if (n < 1e-9) return 2 * q.vec() / q.w();
  return 2 * std::atan2(n, q.w()) / n * q.vec();
}

Matrix3 so3_right_jacobian(const Vector3& w) {
  const double t2 = w.squaredNorm();
  const double t = std::sqrt(t2);
  double b, c;  // (1 - cos(t)) / t^2 and (t - sin(t)) / t^3
  if (t < kSmall) {
    b = 0.5 - t2 / 24;
    c = 1.0 / 6 - t2 / 120;
  } else {
    const double half = std::sin(0.5 * t);
    b = 2 * half * half / t2;
    c = (t - std::sin(t)) / (t2 * t);
  }
  const Matrix3 W = hat(w);
  return Matrix3::Identity() - b * W + c * W * W;
}

Matrix3 so3_right_jacobian_inverse(const Vector3& w) {
  const double t2 = w.squaredNorm();
  const double t = std::sqrt(t2);
  const double d =
      t < kSmall ? 1.0 / 12 + t2 / 720 : (1 - 0.5 * t / std::tan(0.5 * t)) / t2;
  const Matrix3 W = hat(w);
  return Matrix3::Identity() + 0.5 * W + d * W * W;
}

Matrix3 from_rpy(double roll, double pitch, double yaw) {
  return (Eigen::AngleAxisd(yaw, Vector3::UnitZ()) *
          Eigen::AngleAxisd(pitch, Vector3::UnitY()) *
          Eigen::AngleAxisd(roll, Vector3::UnitX()))
      .toRotationMatrix();
}

double yaw_of(const Matrix3& R) { return std::atan2(R(1, 0), R(0, 0)); }

double wrap_angle(double angle) {
  const double wrapped = std::remainder(angle, 2 * kPi);
  return wrapped <= -kPi ? wrapped + 2 * kPi : wrapped;
}

Matrix3 orthonormalized(const Matrix3& R) {
  return Eigen::Quaterniond(R).normalized().toRotationMatrix();
}

double angle_between(const Matrix3& R_a, const Matrix3& R_b) {
  return so3_log(R_a.transpose() * R_b).norm();
}

}  // namespace alight
