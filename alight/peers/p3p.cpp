#include "alight/peers/p3p.h"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <complex>

namespace alight {
namespace {

using Complex = std::complex<double>;

/// Roots of v^4 + b v^3 + c v^2 + d v + e by Ferrari's resolvent.
std::array<Complex, 4> quartic_roots(double b, double c, double d, double e) {
  // Depressed: y^4 + p y^2 + q y + r, v = y - b / 4.
  const double bb = b * b;
  const double p = c - 3 * bb / 8;
  const double q = d - b * c / 2 + bb * b / 8;
  const double r = e - b * d / 4 + bb * c / 16 - 3 * bb * bb / 256;
  // m solves 8 m^3 + 8 p m^2 + (2 p^2 - 8 r) m - q^2 = 0: a real one that is not
  // negative exists. As a cubic in m: m^3 + p m^2 + (p^2 / 4 - r) m - q^2 / 8.
  const double P = p * p / 4 - r - p * p / 3;
  const double Q = 2 * p * p * p / 27 - p * (p * p / 4 - r) / 3 - q * q / 8;
  double t;
  const double discriminant = Q * Q / 4 + P * P * P / 27;
  if (discriminant >= 0) {
    const double root = std::sqrt(discriminant);
    t = std::cbrt(-Q / 2 + root) + std::cbrt(-Q / 2 - root);
  } else {
    const double radius = std::sqrt(-P / 3);
    const double cosine = -Q / (2 * radius * radius * radius);
    t = 2 * radius * std::cos(std::acos(std::clamp(cosine, -1.0, 1.0)) / 3);
  }
  const double m = std::max(t - p / 3, 0.0);
  const double w = std::sqrt(2 * m);
  std::array<Complex, 4> v;
  if (w > 1e-9 * (1 + std::abs(p))) {
    const Complex first = std::sqrt(Complex(-2 * (p + m) - 2 * q / w));
    const Complex second = std::sqrt(Complex(-2 * (p + m) + 2 * q / w));
    v = {(w + first) / 2.0, (w - first) / 2.0, (-w + second) / 2.0,
         (-w - second) / 2.0};
  } else {  // y^4 + p y^2 + r
    const Complex root = std::sqrt(Complex(p * p / 4 - r));
    const Complex s = std::sqrt(-p / 2 + root), u = std::sqrt(-p / 2 - root);
    v = {s, -s, u, -u};
  }
  for (Complex& root : v) root -= b / 4;
  return v;
}

/// Axes along the first side of a triangle, across it in its plane, and out of it.
Matrix3 axes(const Vector3& p0, const Vector3& p1, const Vector3& p2) {
  const Vector3 x = (p1 - p0).normalized();
  const Vector3 z = x.cross(p2 - p0).normalized();
  Matrix3 R;
  R << x, z.cross(x), z;
  return R;
}

/// Newton on the three sides' lengths by the three distances.
void polish(const Vector3 rays[3], const Vector3& sides2, Vector3& s) {
  for (int k = 0; k < 3; ++k) {
    const Vector3 a = s[1] * rays[1] - s[2] * rays[2];
    const Vector3 b = s[0] * rays[0] - s[2] * rays[2];
    const Vector3 c = s[0] * rays[0] - s[1] * rays[1];
    const Vector3 f(a.squaredNorm() - sides2[0], b.squaredNorm() - sides2[1],
                    c.squaredNorm() - sides2[2]);
    Matrix3 J;
    J << 0, a.dot(rays[1]), -a.dot(rays[2]),  //
        b.dot(rays[0]), 0, -b.dot(rays[2]),   //
        c.dot(rays[0]), -c.dot(rays[1]), 0;
    const double det = J.determinant();
    if (!(std::abs(det) > 1e-14 * s.norm())) return;
    const Vector3 step = 0.5 * (J.inverse() * f);
    // Away from a root it would run off to another one.
    if (!(step.norm() < 0.05 * s.norm())) return;
    s -= step;
  }
}

}  // namespace

FixedVector<Pose, 4> solve_p3p(const Vector3 p_B[3], const Vector3 rays[3]) {
  FixedVector<Pose, 4> found;
  const Vector3 j[3] = {rays[0].normalized(), rays[1].normalized(),
                        rays[2].normalized()};
  const double aa = (p_B[1] - p_B[2]).squaredNorm();
  const double bb = (p_B[0] - p_B[2]).squaredNorm();
  const double cc = (p_B[0] - p_B[1]).squaredNorm();
  const double area = (p_B[1] - p_B[0]).cross(p_B[2] - p_B[0]).norm();
  if (!(area > 1e-3 * std::max({aa, bb, cc}))) return found;
  const double cos_a = j[1].dot(j[2]), cos_b = j[0].dot(j[2]), cos_g = j[0].dot(j[1]);

  // With s1 = u s0, s2 = v s0: a quartic in v.
  const double A = aa / bb, C = cc / bb, D = A - C, S = A + C;
  const double aa4 = (D - 1) * (D - 1) - 4 * C * cos_a * cos_a;
  const double a3 = 4 * (D * (1 - D) * cos_b - (1 - S) * cos_a * cos_g +
                         2 * C * cos_a * cos_a * cos_b);
  const double a2 =
      2 * (D * D - 1 + 2 * D * D * cos_b * cos_b + 2 * (1 - C) * cos_a * cos_a -
           4 * S * cos_a * cos_b * cos_g + 2 * (1 - A) * cos_g * cos_g);
  const double a1 = 4 * (-D * (1 + D) * cos_b + 2 * A * cos_g * cos_g * cos_b -
                         (1 - S) * cos_a * cos_g);
  const double a0 = (1 + D) * (1 + D) - 4 * A * cos_g * cos_g;
  if (!(std::abs(aa4) > 1e-14)) return found;

  const Matrix3 R_BT = axes(p_B[0], p_B[1], p_B[2]);
  for (const Complex& root : quartic_roots(a3 / aa4, a2 / aa4, a1 / aa4, a0 / aa4)) {
    const double v = root.real();
    // Of a complex pair one is enough.
    if (!(v > 0) || root.imag() < -1e-6 || root.imag() > 0.2 * v) continue;
    const double below = 2 * (cos_g - v * cos_a);
    double u = ((D - 1) * v * v - 2 * D * cos_b * v + 1 + D) / below;
    const double s0 = std::sqrt(bb / (1 + v * v - 2 * v * cos_b));
    if (!(u > 0) || !std::isfinite(u) || !std::isfinite(s0)) continue;
    Vector3 s(s0, u * s0, v * s0);
    polish(j, Vector3(aa, bb, cc), s);
    if (!(s.minCoeff() > 0)) continue;
    const Vector3 p_C[3] = {s[0] * j[0], s[1] * j[1], s[2] * j[2]};
    if (!(p_C[0].z() > 0 && p_C[1].z() > 0 && p_C[2].z() > 0)) continue;
    const Matrix3 R_CB = axes(p_C[0], p_C[1], p_C[2]) * R_BT.transpose();
    const Vector3 centre_B = (p_B[0] + p_B[1] + p_B[2]) / 3;
    const Vector3 centre_C = (p_C[0] + p_C[1] + p_C[2]) / 3;
    const Pose X_CB = make_pose(R_CB, centre_C - R_CB * centre_B);
    if (X_CB.matrix().allFinite()) found.push_back(X_CB);
  }
  return found;
}

}  // namespace alight
