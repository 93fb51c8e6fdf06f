#pragma once
#include <array>

#include "alight/geometry/trajectory.h"
#include "alight/planning/bezier_basis.h"

namespace alight::test {

/// The motion on a segment of `T` seconds at share `u` of it.
inline FlatState bezier_state(const ControlPoints& c, double u, Seconds T) {
  std::array<Vector3, kControlPoints> points;
  for (int k = 0; k < kControlPoints; ++k) {
    points[static_cast<std::size_t>(k)] = c.row(k).transpose();
  }
  FlatState state;
  evaluate_bezier(points, u, T, state);
  return state;
}

}  // namespace alight::test
