#include "alight/planning/bezier_basis.h"

namespace alight {
namespace {

constexpr int kDegreeOfCurve = kControlPoints - 1;

/// n times the differences of n + 1 control points.
Eigen::MatrixXd differences(int n) {
  Eigen::MatrixXd D = Eigen::MatrixXd::Zero(n, n + 1);
  for (int i = 0; i < n; ++i) {
    D(i, i) = -n;
    D(i, i + 1) = n;
  }
  return D;
}

Hodograph hodograph(int order, bool raised) {
  Eigen::MatrixXd D = Eigen::MatrixXd::Identity(kControlPoints, kControlPoints);
  for (int i = 0; i < order; ++i) D = differences(kDegreeOfCurve - i) * D;
  if (raised) {
    for (int n = kDegreeOfCurve - order + 1; n <= kDegreeOfCurve; ++n) {
      D = degree_elevation(n) * D;
    }
  }
  Hodograph h;
  h.count = static_cast<int>(D.rows());
  h.map.topRows(D.rows()) = D;
  return h;
}

double binomial(int n, int k) {
  double value = 1;
  for (int i = 1; i <= k; ++i) value = value * (n - k + i) / i;
  return value;
}

Eigen::Matrix<double, 5, 5> gram() {
  Eigen::Matrix<double, 5, 5> G;
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < 5; ++j) {
      G(i, j) = binomial(4, i) * binomial(4, j) / binomial(8, i + j) / 9;
    }
  }
  return G;
}

}  // namespace

Eigen::MatrixXd degree_elevation(int n) {
  Eigen::MatrixXd E = Eigen::MatrixXd::Zero(n + 1, n);
  for (int i = 0; i <= n; ++i) {
    const double share = static_cast<double>(i) / n;
    if (i > 0) E(i, i - 1) = share;
    if (i < n) E(i, i) = 1 - share;
  }
  return E;
}

const Hodograph& velocity_map(bool raised) {
  static const Hodograph plain = hodograph(1, false);
  static const Hodograph up = hodograph(1, true);
  return raised ? up : plain;
}

const Hodograph& acceleration_map(bool raised) {
  static const Hodograph plain = hodograph(2, false);
  static const Hodograph up = hodograph(2, true);
  return raised ? up : plain;
}

const Eigen::Matrix<double, 5, 8>& jerk_map() {
  static const Eigen::Matrix<double, 5, 8> D = hodograph(3, false).map.topRows<5>();
  return D;
}

const Matrix8& raised_jerk_map() {
  static const Matrix8 map = hodograph(3, true).map;
  return map;
}

const Eigen::Matrix<double, 5, 5>& jerk_gram() {
  static const Eigen::Matrix<double, 5, 5> G = gram();
  return G;
}

double jerk_cost(const ControlPoints& c, Seconds T) {
  const Eigen::Matrix<double, 5, 3> j = jerk_map() * c;
  const double T2 = T * T;
  return (jerk_gram() * j).cwiseProduct(j).sum() / (T2 * T2 * T);
}

}  // namespace alight
