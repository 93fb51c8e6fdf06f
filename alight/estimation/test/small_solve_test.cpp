#include "alight/estimation/small_solve.h"

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
}

TEST(SmallSolve, InvertsAndStaysSymmetric) {
  expect_inverse<2>(0.1, 1e-13);
  expect_inverse<6>(0.1, 1e-12);
  expect_inverse<9>(0.1, 1e-12);
}

TEST(SmallSolve, InvertsWhatIsHardlyRegular) { expect_inverse<6>(1e-8, 1e-5); }

TEST(SmallSolve, SolvesColumnByColumn) {
  const Eigen::Matrix<double, 6, 6> A = positive_definite<6>(0.1);
  const Eigen::Matrix<double, 6, 3> B = A.leftCols<3>();
  const Eigen::Matrix<double, 6, 3> X =
      solve_small<6, 3>(Eigen::LLT<Eigen::Matrix<double, 6, 6>>(A), B);
  EXPECT_LT((A * X - B).cwiseAbs().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace alight
