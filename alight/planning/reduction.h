#pragma once
#include <array>

#include "alight/planning/bezier_basis.h"

namespace alight {

inline constexpr int kReduced = 7;               ///< Variables per axis.
inline constexpr int kVariables = 3 * kReduced;  ///< Of the QP, axis by axis.

using Vector7 = Eigen::Matrix<double, kReduced, 1>;
using Matrix7 = Eigen::Matrix<double, kReduced, kReduced>;
using Matrix73 = Eigen::Matrix<double, kReduced, 3>;
using Vector21 = Eigen::Matrix<double, kVariables, 1>;

/// Columns are control points: c_k = M.col(k)' x + m0.row(k), x of one axis.
using PointBasis = Eigen::Matrix<double, kReduced, kControlPoints>;

/// The landing QP with its equalities solved away: start, end and continuity up to the
/// acceleration hold for every x = (c3, c4, p, v h, a h^2, d3, d4) per axis.
///
///   jerk cost = h^-5 sum over the axes of (x' H x + 2 g' x + k)
struct Reduction {
  double h = 1;                        ///< The shorter duration, s.
  std::array<Seconds, kSegments> T{};  ///< s
  std::array<PointBasis, kSegments> M;
  std::array<ControlPoints, kSegments> m0;
  Matrix7 H;   ///< Depends on the ratio of the durations alone.
  Matrix73 g;  ///< A column per axis.
  double k = 0;

  /// @param keep_jerk  The start's jerk holds too: c3 is then fixed, and the first
  ///                   variable of each axis moves nothing (it costs x^2 / h^5).
  Reduction(const FlatState& start, const FlatState& end,
            const std::array<Seconds, kSegments>& durations, bool keep_jerk = false);

  /// Control points of segment `s` for the variables x, a column per axis.
  ControlPoints points(std::size_t s, const Matrix73& x) const {
    return m0[s] + M[s].transpose() * x;
  }
};

/// The same in coordinates u = L' x + L^-1 g with H = L L': the cost becomes
/// h^-5 (|u|^2 + constant), so the QP asks for the point of the corridor nearest zero.
struct Whitened {
  std::array<PointBasis, kSegments> W;      ///< c_k = W.col(k)' u + c0.row(k)
  std::array<ControlPoints, kSegments> c0;  ///< The unconstrained optimum.
  Matrix7 L;
  Matrix73 shift;  ///< L^-1 g

  explicit Whitened(const Reduction& reduction);

  /// The variables x of a whitened solution.
  Matrix73 variables(const Matrix73& u) const;
};

}  // namespace alight
