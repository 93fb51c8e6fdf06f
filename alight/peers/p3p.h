#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/geometry/pose.h"

namespace alight {

/// Poses from three points and the directions they are seen in: Grunert's equations
/// (1841) as in Haralick et al. 1994, up to four answers.
///
/// Where noise leaves a pair of answers just complex, the real part stands in for both:
/// the pose nearest to seeing the points as they are seen.
///
/// @param p_B   Three points, m.
/// @param rays  Directions to them from the lens; z > 0, of any length.
/// @returns X_CB with all three points in front of the lens; none for points or rays in
///          a line.
FixedVector<Pose, 4> solve_p3p(const Vector3 p_B[3], const Vector3 rays[3]);

}  // namespace alight
