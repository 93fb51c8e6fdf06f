#pragma once
#include <Eigen/Core>

#include "alight/geometry/trajectory.h"

namespace alight {

using Matrix8 = Eigen::Matrix<double, kControlPoints, kControlPoints>;
using ControlPoints = Eigen::Matrix<double, kControlPoints, 3>;

/// Linear maps from the control points of a segment of unit duration to those of its
/// derivatives (hodograph); divide by T or T^2. Rows 0 .. count-1 are used.
struct Hodograph {
  Matrix8 map = Matrix8::Zero();
  int count = 0;
};

/// Velocity, degree 6 (7 rows), or raised to degree 7 (8 rows).
const Hodograph& velocity_map(bool raised);
/// Acceleration, degree 5 (6 rows), or raised to degree 7 (8 rows).
const Hodograph& acceleration_map(bool raised);

/// Third differences times 7*6*5: control points of the jerk, degree 4, unit duration.
const Eigen::Matrix<double, 5, 8>& jerk_map();

/// The same raised to degree 7.
const Matrix8& raised_jerk_map();

/// Gram matrix of the Bernstein basis of degree 4: integral of b_i b_j over [0, 1].
const Eigen::Matrix<double, 5, 5>& jerk_gram();

/// Integral of the squared jerk over one segment (eqn:MP_COST), exact. m^2/s^5
double jerk_cost(const ControlPoints& c, Seconds T);

/// Degree elevation: (n + 1) x n matrix from degree n - 1 to degree n.
Eigen::MatrixXd degree_elevation(int n);

}  // namespace alight
