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

template <int N>
Eigen::Matrix<double, N, N> inverse_of(
    const Eigen::LLT<Eigen::Matrix<double, N, N>>& A) {
  return solve_small<N, N>(A, Eigen::Matrix<double, N, N>::Identity());
}

}  // namespace alight
