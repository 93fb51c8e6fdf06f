#pragma once
#include <Eigen/Core>
#include <algorithm>

#include "alight/geometry/pose.h"

namespace alight {

/// What pushes a drone besides gravity (thrust, drag and wind over mass), in N, m/s^2,
/// as the way shows it that it has flown. Rotors push along z of B only: of two
/// readings of the same lights, the one that has the drone lean otherwise than it is
/// pushed is wrong.
struct Push {
  Vector3 f_N = Vector3::Zero();
  Matrix3 cov = Matrix3::Zero();

  /// The part of it across z_N, a unit vector.
  double across(const Vector3& z_N) const {
    return (f_N - std::max(f_N.dot(z_N), 0.0) * z_N).norm();
  }

  /// -2 log likelihood of a drone's z being z_N, wind and drag (sd `across_sd`, m/s^2)
  /// being all that pushes it across.
  double against(const Vector3& z_N, double across_sd) const {
    const double known = (cov.trace() - z_N.dot(cov * z_N)) / 2;
    const double a = across(z_N);
    return a * a / (across_sd * across_sd + known);
  }
};

}  // namespace alight
