#include "alight/planning/reduction.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace alight {
namespace {

// Control points at either end of a segment follow from position, velocity and
// acceleration there: 7 (c1 - c0) = v T, 42 (c2 - 2 c1 + c0) = a T^2.
constexpr double kV = 1.0 / 7;
constexpr double kA = 1.0 / 42;
constexpr double kJ = 1.0 / 210;

}  // namespace

Reduction::Reduction(const FlatState& start, const FlatState& end,
                     const std::array<Seconds, kSegments>& durations, bool keep_jerk)
    : h(std::min(durations[0], durations[1])), T(durations) {
  const double r1 = T[0] / h;
  const double r2 = T[1] / h;
  for (PointBasis& basis : M) basis.setZero();
  for (ControlPoints& points : m0) points.setZero();

  const auto row = [](const Vector3& v) { return v.transpose(); };
  m0[0].row(0) = row(start.p_NB);
  m0[0].row(1) = row(start.p_NB + kV * T[0] * start.v_NB);
  m0[0].row(2) =
      row(start.p_NB + 2 * kV * T[0] * start.v_NB + kA * T[0] * T[0] * start.a_NB);
  if (keep_jerk) {
    // 210 (c3 - 3 c2 + 3 c1 - c0) = j T^3
    m0[0].row(3) =
        row(start.p_NB + 3 * kV * T[0] * start.v_NB +
            3 * kA * T[0] * T[0] * start.a_NB + kJ * T[0] * T[0] * T[0] * start.j_NB);
  } else {
    M[0](0, 3) = 1;
  }
  M[0](1, 4) = 1;
  M[0].col(5).segment<3>(2) << 1, -2 * kV * r1, kA * r1 * r1;
  M[0].col(6).segment<3>(2) << 1, -kV * r1, 0;
  M[0](2, 7) = 1;

  M[1](2, 0) = 1;
  M[1].col(1).segment<3>(2) << 1, kV * r2, 0;
  M[1].col(2).segment<3>(2) << 1, 2 * kV * r2, kA * r2 * r2;
  M[1](5, 3) = 1;
  M[1](6, 4) = 1;
  m0[1].row(5) = row(end.p_NB - 2 * kV * T[1] * end.v_NB + kA * T[1] * T[1] * end.a_NB);
  m0[1].row(6) = row(end.p_NB - kV * T[1] * end.v_NB);
  m0[1].row(7) = row(end.p_NB);

  H.setZero();
  g.setZero();
  k = 0;
  for (std::size_t s = 0; s < kSegments; ++s) {
    const double r = s == 0 ? r1 : r2;
    const double weight = 1 / (r * r * r * r * r);
    const Eigen::Matrix<double, 5, kReduced> B = jerk_map() * M[s].transpose();
    const Eigen::Matrix<double, 5, 3> b = jerk_map() * m0[s];
    const Eigen::Matrix<double, 5, kReduced> GB = weight * (jerk_gram() * B);
    H.noalias() += B.transpose() * GB;
    g.noalias() += GB.transpose() * b;
    k += weight * (jerk_gram() * b).cwiseProduct(b).sum();
  }
  if (keep_jerk) H(0, 0) = 1;
}

Whitened::Whitened(const Reduction& reduction) {
  L = reduction.H.llt().matrixL();
  const auto lower = L.triangularView<Eigen::Lower>();
  shift = reduction.g;
  lower.solveInPlace(shift);
  for (std::size_t s = 0; s < kSegments; ++s) {
    W[s] = reduction.M[s];
    lower.solveInPlace(W[s]);
    c0[s] = reduction.m0[s] - W[s].transpose() * shift;
  }
}

Matrix73 Whitened::variables(const Matrix73& u) const {
  Matrix73 x = u - shift;
  L.transpose().triangularView<Eigen::Upper>().solveInPlace(x);
  return x;
}

}  // namespace alight
