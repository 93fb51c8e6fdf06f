#pragma once
#include <array>
#include <cstddef>

#include "alight/geometry/so3.h"

namespace alight {

/// Which three of `count` points span the largest triangle, in rising order: what poses
/// are best laid upon. The first three if all lie on a line; zeros for fewer.
/// @param at  (index) -> Vector3
template <class At>
std::array<std::size_t, 3> widest_triangle(std::size_t count, At&& at) {
  if (count < 3) return {0, 0, 0};
  std::array<std::size_t, 3> corners = {0, 1, 2};
  double widest = 0;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = i + 1; j < count; ++j) {
      for (std::size_t k = j + 1; k < count; ++k) {
        const Vector3 a = at(j) - at(i), b = at(k) - at(i);
        const double area = a.cross(b).norm();
        if (area <= widest) continue;
        widest = area;
        corners = {i, j, k};
      }
    }
  }
  return corners;
}

}  // namespace alight
