#include "alight/planning/landing_qp.h"

namespace alight {
namespace {

const LimitRow& limit_row(const RowId& row, const DynamicLimitRows& limits) {
  return row.kind == RowKind::speed ? limits.speed[row.face]
                                    : limits.acceleration[row.face];
}

}  // namespace

Matrix73 row_gradient(const RowId& row, const Corridor& corridor,
                      const DynamicLimitRows& limits,
                      const std::array<PointBasis, kSegments>& basis,
                      const std::array<Seconds, kSegments>& T) {
  const PointBasis& W = basis[row.segment];
  if (row.kind == RowKind::position) {
    return W.col(row.point) * corridor.planes[row.face].a.transpose();
  }
  const double t = T[row.segment];
  const Vector3& n = limit_row(row, limits).n;
  const Vector7 w_v =
      W * velocity_map(limits.raised).map.row(row.point).transpose() / t;
  if (row.kind == RowKind::speed) {
    Matrix73 gradient = w_v * n.transpose();
    if (limits.turning) gradient += W.col(row.point) * (n.transpose() * limits.v_p);
    return gradient;
  }
  const Vector7 w_a =
      W * acceleration_map(limits.raised).map.row(row.point).transpose() / (t * t);
  Matrix73 gradient = w_a * n.transpose();
  if (limits.turning) {
    gradient += w_v * (n.transpose() * limits.a_v) +
                W.col(row.point) * (n.transpose() * limits.a_p);
  }
  return gradient;
}

double row_violation(const RowId& row, const Corridor& corridor,
                     const DynamicLimitRows& limits,
                     const std::array<ControlPoints, kSegments>& c,
                     const std::array<Seconds, kSegments>& T) {
  if (row.kind == RowKind::position) {
    const HalfSpace& plane = corridor.planes[row.face];
    return c[row.segment].row(row.point).dot(plane.a) - plane.b;
  }
  const MotionCurves curves = motion_curves(limits, c[row.segment], T[row.segment]);
  const LimitRow& face = limit_row(row, limits);
  const ControlPoints& curve = row.kind == RowKind::speed ? curves.v : curves.a;
  return curve.row(row.point).dot(face.n) - face.b;
}

Constraint row_meaning(const RowId& row, const Corridor& corridor,
                       const DynamicLimitRows& limits) {
  return row.kind == RowKind::position ? corridor.planes[row.face].meaning
                                       : limit_row(row, limits).meaning;
}

}  // namespace alight
