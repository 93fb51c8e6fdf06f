#include "alight/geometry/small_solve.h"

#include <gtest/gtest.h>

#include <cmath>

namespace alight {
namespace {

template <int N>
Eigen::Matrix<double, N, N> positive_definite(double smallest) {
  Eigen::Matrix<double, N, N> root;
  for (int i = 0; i < N; ++i) {
    for (int k = 0; k < N; ++k) root(i, k) = std::sin(1.0 + 3 * i + 7 * k * k);
  }
  Eigen::Matrix<double, N, N> A = root * root.transpose();
  A.diagonal().array() += smallest;
  return A;
}

template <int N>
void expect_inverse(double smallest, double tolerance) {
  using Matrix = Eigen::Matrix<double, N, N>;
  const Matrix A = positive_definite<N>(smallest);
  const Matrix inverse = inverse_of(Eigen::LLT<Matrix>(A));
  EXPECT_LT((inverse * A - Matrix::Identity()).cwiseAbs().maxCoeff(), tolerance) << N;
  EXPECT_EQ(inverse, Matrix(inverse.transpose())) << N;
  // So that the pivots are not the diagonal in its order.
  Matrix uneven = A;
  for (int i = 0; i < N; ++i) {
    const double by = 1 + (3 * i + N / 2) % N;
    uneven.row(i) *= by;
    uneven.col(i) *= by;
  }
  const Matrix pivoted = inverse_of(Eigen::LDLT<Matrix>(uneven));
  EXPECT_LT((pivoted * uneven - Matrix::Identity()).cwiseAbs().maxCoeff(),
            100 * tolerance)
      << N;
}

TEST(SmallSolve, InvertsAndStaysSymmetric) {
  expect_inverse<2>(0.1, 1e-13);
  expect_inverse<6>(0.1, 1e-12);
  expect_inverse<9>(0.1, 1e-12);
}

TEST(SmallSolve, InvertsWhatIsHardlyRegular) { expect_inverse<6>(1e-8, 1e-5); }

TEST(SmallSolve, SolvesByTheLowerHalfAlone) {
  const Eigen::Matrix<double, 6, 6> A = positive_definite<6>(0.1);
  const Eigen::Matrix<double, 6, 1> b = A.col(2) - 3 * A.col(4);
  Eigen::Matrix<double, 6, 6> lower = A.triangularView<Eigen::Lower>();
  EXPECT_LT((A * solve_positive(lower, b) - b).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_FALSE(solve_positive(Eigen::Matrix<double, 6, 6>(0 * A), b).allFinite());
}

TEST(SmallSolve, SolvesColumnByColumn) {
  const Eigen::Matrix<double, 6, 6> A = positive_definite<6>(0.1);
  const Eigen::Matrix<double, 6, 3> B = A.leftCols<3>();
  const Eigen::Matrix<double, 6, 3> X =
      solve_small<6, 3>(Eigen::LLT<Eigen::Matrix<double, 6, 6>>(A), B);
  EXPECT_LT((A * X - B).cwiseAbs().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace alight
