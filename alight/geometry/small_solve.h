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

/// A^-1 b for a positive definite A, of which the lower half is read; not finite for
/// others. No pivots, no branches: a quarter of what Eigen's LDLT takes.
template <int N>
Eigen::Matrix<double, N, 1> solve_positive(const Eigen::Matrix<double, N, N>& A,
                                           const Eigen::Matrix<double, N, 1>& b) {
  Eigen::Matrix<double, N, N> L = A;  // L D^1/2 below the diagonal
  Eigen::Matrix<double, N, 1> x = b, inverse;
  for (int c = 0; c < N; ++c) {
    inverse[c] = 1 / L(c, c);
    for (int k = c + 1; k < N; ++k) {
      const double share = L(k, c) * inverse[c];
      for (int r = k; r < N; ++r) L(r, k) -= share * L(r, c);
      x[k] -= share * x[c];
    }
  }
  for (int c = N - 1; c >= 0; --c) {
    for (int r = c + 1; r < N; ++r) x[c] -= L(r, c) * x[r];
    x[c] *= inverse[c];
  }
  return x;
}

/// L^-1 of what stands in the lower half of `L`; `kUnit`: with ones on its diagonal,
/// whatever stands there.
template <bool kUnit, int N>
Eigen::Matrix<double, N, N> inverse_of_lower(const Eigen::Matrix<double, N, N>& L) {
  const auto diagonal = [&](int i) { return kUnit ? 1 : L(i, i); };
  Eigen::Matrix<double, N, N> M = Eigen::Matrix<double, N, N>::Zero();
  for (int c = 0; c < N; ++c) {
    M(c, c) = 1 / diagonal(c);
    for (int r = c + 1; r < N; ++r) {
      double sum = 0;
      for (int k = c; k < r; ++k) sum += L(r, k) * M(k, c);
      M(r, c) = -sum / diagonal(r);
    }
  }
  return M;
}

/// A^-1 = L^-T L^-1.
template <int N>
Eigen::Matrix<double, N, N> inverse_of(
    const Eigen::LLT<Eigen::Matrix<double, N, N>>& A) {
  const auto M = inverse_of_lower<false>(A.matrixLLT());
  return M.transpose().lazyProduct(M);
}

/// A^-1 = P' L^-T D^-1 L^-1 P.
template <int N>
Eigen::Matrix<double, N, N> inverse_of(
    const Eigen::LDLT<Eigen::Matrix<double, N, N>>& A) {
  using Matrix = Eigen::Matrix<double, N, N>;
  const Matrix M = inverse_of_lower<true>(A.matrixLDLT());
  const Matrix scaled = A.vectorD().cwiseInverse().asDiagonal() * M;
  // From the left twice, and the result is symmetric: from the right Eigen takes the
  // transpositions in the same order.
  const Matrix ordered = M.transpose().lazyProduct(scaled);
  const Matrix half = (A.transpositionsP().transpose() * ordered).transpose();
  return A.transpositionsP().transpose() * half;
}

}  // namespace alight
