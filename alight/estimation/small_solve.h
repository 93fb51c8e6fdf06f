#pragma once
#include <Eigen/Cholesky>

namespace alight {

/// A^-1 B for small matrices of fixed size, column by column: Eigen takes the blocked
/// way of large ones for all columns together, which costs three times as much here.
template <int N, int M>
Eigen::Matrix<double, N, M> solve_small(
    const Eigen::LLT<Eigen::Matrix<double, N, N>>& A,
    const Eigen::Matrix<double, N, M>& B) {
  Eigen::Matrix<double, N, M> X;
  for (int c = 0; c < M; ++c) X.col(c) = A.solve(B.col(c));
  return X;
}

/// A^-1 = L^-T L^-1.
template <int N>
Eigen::Matrix<double, N, N> inverse_of(
    const Eigen::LLT<Eigen::Matrix<double, N, N>>& A) {
  using Matrix = Eigen::Matrix<double, N, N>;
  const Matrix& L = A.matrixLLT();  // in its lower half
  Matrix M = Matrix::Zero();        // L^-1
  for (int c = 0; c < N; ++c) {
    M(c, c) = 1 / L(c, c);
    for (int r = c + 1; r < N; ++r) {
      double sum = 0;
      for (int k = c; k < r; ++k) sum += L(r, k) * M(k, c);
      M(r, c) = -sum / L(r, r);
    }
  }
  return M.transpose().lazyProduct(M);
}

}  // namespace alight
