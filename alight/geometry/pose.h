#pragma once
#include <Eigen/Geometry>

#include "alight/geometry/so3.h"

namespace alight {

/// X_AB: the pose of frame B in frame A. p_A = X_AB * p_B, X_AC = X_AB * X_BC,
/// X_BA = X_AB.inverse(). R_AB is linear(), p_AB is translation().
using Pose = Eigen::Isometry3d;

inline Pose make_pose(const Matrix3& R_AB, const Vector3& p_AB) {
  Pose X_AB = Pose::Identity();
  X_AB.linear() = R_AB;
  X_AB.translation() = p_AB;
  return X_AB;
}

}  // namespace alight
