#pragma once
#include <Eigen/Cholesky>

#include "alight/geometry/so3.h"

namespace alight {

/// What a filter's corrections of three components of its state add up to, against what
/// it expects of them. Those of a true model are white (Kailath 1968): their sum grows
/// as its variance does, whatever a single picture tells. Corrections that go on in one
/// direction show a process noise that is too small, those that take each other back
/// one that is too large.
class CorrectionTrend {
 public:
  /// @param gained  Covariance before the correction, less that after it.
  void add(const Vector3& correction, const Matrix3& gained) {
    sum_ = kKept * sum_ + correction;
    cov_ = kKept * kKept * cov_ + gained;
  }

  /// Mean square of the sum in units of its variance; 1 by the model, and when nothing
  /// can be told.
  double ratio() const {
    if (!(cov_.trace() > 0)) return 1;
    Matrix3 cov = cov_;
    cov.diagonal().array() += kRounding * cov_.trace();
    const double ratio = sum_.dot(Eigen::LLT<Matrix3>(cov).solve(sum_)) / 3;
    return ratio >= 0 ? ratio : 1;
  }

  void forget() { *this = CorrectionTrend(); }

 private:
  static constexpr double kKept = 0.8;  // of the sum, from picture to picture
  static constexpr double kRounding = 1e-3;

  Vector3 sum_ = Vector3::Zero();
  Matrix3 cov_ = Matrix3::Zero();
};

}  // namespace alight
