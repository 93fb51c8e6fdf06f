#pragma once
#include <Eigen/Core>

#include "alight/geometry/pose.h"

namespace alight {

using Vector9 = Eigen::Matrix<double, 9, 1>;
using Matrix9 = Eigen::Matrix<double, 9, 9>;

/// Covariance of [p, R, v] in the tangent space; rotation as Log(Rhat' R) in B.
using Covariance9 = Matrix9;

/// Standard deviation in the direction in which it is largest. @pre covariance
/// symmetric
double largest_sd(const Matrix3& covariance);

/// The state of the paper (eqn:states): x = (p, R, v) on R3 x SO(3) x R3.
struct RelativeState {
  Vector3 p_NB = Vector3::Zero();  ///< m
  Matrix3 R_NB = Matrix3::Identity();
  Vector3 v_NB = Vector3::Zero();  ///< m/s, derivative taken in N.

  Pose X_NB() const { return make_pose(R_NB, p_NB); }
};

/// x [+] d, with d = (dp, dR, dv).
RelativeState boxplus(const RelativeState& x, const Vector9& d);

/// a [-] b: the d with b [+] d = a.
Vector9 boxminus(const RelativeState& a, const RelativeState& b);

}  // namespace alight
