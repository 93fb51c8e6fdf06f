#pragma once
#include <array>

#include "alight/geometry/trajectory.h"

namespace alight {

/// The control points of a vector polynomial of degree 7, apart from the solver's own
/// matrices: what the certificate is computed with.
using Curve = std::array<Vector3, kControlPoints>;

/// Upper bound, at most `gap` above the maximum over [0, 1], of the polynomial with
/// these Bernstein coefficients (at most 15). Infinite if one is not a number.
double bernstein_maximum(const double* coefficients, int count, double gap);

/// Derivative by time of a curve that lasts T s, raised back to degree 7.
Curve derivative(const Curve& c, Seconds T);

/// Bounds, on the safe side by at most `gap` of the polynomial's unit, of n'x, of |x|,
/// and the least `rate` with |x| <= rate times the z of `by` (infinite if that is not
/// positive throughout).
double maximum_along(const Curve& c, const Vector3& n, double gap);
double maximum_norm(const Curve& c, double gap);
double maximum_ratio(const Curve& c, const Curve& by, double gap);

}  // namespace alight
