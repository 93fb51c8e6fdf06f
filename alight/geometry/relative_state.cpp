#include "alight/geometry/relative_state.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace alight {

double largest_sd(const Matrix3& covariance) {
  Eigen::SelfAdjointEigenSolver<Matrix3> solver;
  solver.computeDirect(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

RelativeState boxplus(const RelativeState& x, const Vector9& d) {
  return {x.p_NB + d.head<3>(), x.R_NB * so3_exp(d.segment<3>(3)),
          x.v_NB + d.tail<3>()};
}

Vector9 boxminus(const RelativeState& a, const RelativeState& b) {
  Vector9 d;
  d << a.p_NB - b.p_NB, so3_log(b.R_NB.transpose() * a.R_NB), a.v_NB - b.v_NB;
  return d;
}

}  // namespace alight
