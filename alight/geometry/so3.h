#pragma once
#include <Eigen/Core>

namespace alight {

using Vector2 = Eigen::Vector2d;
using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
using Matrix2 = Eigen::Matrix2d;

/// The rotation group (Sola, Deray and Atchuthan 2018, "A micro Lie theory").
/// Tangent vectors are rotation vectors, rad; perturbations stand on the right.

/// hat(a) b = a x b.
Matrix3 hat(const Vector3& a);

/// Exp: rotation vector to rotation matrix. Exact to double precision near zero.
Matrix3 so3_exp(const Vector3& w);

/// Log: rotation vector of `R`, norm in [0, pi].
Vector3 so3_log(const Matrix3& R);

/// Right Jacobian: Exp(w + d) = Exp(w) Exp(J_r(w) d) to first order.
Matrix3 so3_right_jacobian(const Vector3& w);

/// Inverse of the right Jacobian: Log(Exp(w) Exp(d)) = w + J_r^-1(w) d.
Matrix3 so3_right_jacobian_inverse(const Vector3& w);

/// R = Rz(yaw) Ry(pitch) Rx(roll), rad.
Matrix3 from_rpy(double roll, double pitch, double yaw);

/// Heading of the first axis of `R` about z, rad in (-pi, pi].
double yaw_of(const Matrix3& R);

/// `angle` wrapped into (-pi, pi].
double wrap_angle(double angle);

/// The closest rotation to a matrix that has drifted from one.
Matrix3 orthonormalized(const Matrix3& R);

/// Angle between two rotations, rad in [0, pi].
double angle_between(const Matrix3& R_a, const Matrix3& R_b);

constexpr double kDegree = 3.14159265358979323846 / 180.0;
constexpr double kPi = 3.14159265358979323846;
constexpr double kGravity = 9.81;  ///< m/s^2, the paper's value.

}  // namespace alight
