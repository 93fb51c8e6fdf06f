#pragma once
#include <vector>

namespace alight {

/// The twice continuously differentiable curve of cubic pieces through given points
/// (de Boor 1978, "A Practical Guide to Splines", ch. IV).
class CubicSpline {
 public:
  enum class End { free, resting };  ///< Second, or first derivative zero.

  /// @pre t grows; as many values as times, at least 2.
  CubicSpline(std::vector<double> t, std::vector<double> values, End first, End last);

  struct Sample {
    double value = 0, rate = 0, acceleration = 0;
  };
  /// Outside the points as at the nearest of them.
  Sample at(double t) const;

 private:
  std::vector<double> t_, value_, slope_;
};

}  // namespace alight
