#include "alight/planning/landing_qp.h"

namespace alight {
namespace {

const LimitRow& limit_row(const RowId& row, const DynamicLimitRows& limits) {
  switch (row.kind) {
    case RowKind::speed:
      return limits.speed[row.face];
    case RowKind::acceleration:
      return limits.acceleration[row.face];
    case RowKind::force:
      return limits.force[row.face];
    default:
      return limits.body_rate[row.face];
  }
}

/// Gradients of n'(matrix polynomial) times a derivative of the position.
class Gradient {
 public:
  Gradient(const PointBasis& basis, const SegmentFrame& frame, int point)
      : basis_(basis), frame_(frame), point_(point) {}

  /// The derivative by `map / unit`, turned by part(frame).
  template <class Part>
  void add(const Matrix8& map, double unit, const Vector3& n, Part part) {
    for (int j = 0; j <= frame_.degree; ++j) {
      const int k = point_ - j;
      if (k < 0 || k >= kControlPoints) continue;
      const double weight = product_weight(frame_.degree, j, k) / unit;
      const Vector3 side = part(frame_.at[static_cast<std::size_t>(j)]).transpose() * n;
      sum += (weight * (basis_ * map.row(k).transpose())) * side.transpose();
    }
  }

  Matrix73 sum = Matrix73::Zero();

 private:
  const PointBasis& basis_;
  const SegmentFrame& frame_;
  int point_;
};

}  // namespace

Matrix73 row_gradient(const RowId& row, const Corridor& corridor,
                      const DynamicLimitRows& limits, const SegmentFrames& frames,
                      const std::array<PointBasis, kSegments>& basis,
                      const std::array<Seconds, kSegments>& T) {
  const PointBasis& W = basis[row.segment];
  if (row.kind == RowKind::position) {
    return W.col(row.point) * corridor.planes[row.face].a.transpose();
  }
  const SegmentFrame& frame = frames[row.segment];
  const double t = T[row.segment];
  const LimitRow& limit = limit_row(row, limits);
  static const Matrix8 place = Matrix8::Identity();
  const Matrix8& rate = velocity_map(limits.raised).map;
  const Matrix8& bend = acceleration_map(limits.raised).map;
  const auto whole = [](const FrameMotion&) { return Matrix3(Matrix3::Identity()); };
  const auto w = [](const FrameMotion& f) { return f.w; };

  Gradient gradient(W, frame, row.point);
  const auto accelerated = [&](const Vector3& n) {
    gradient.add(bend, t * t, n, whole);
    if (!limits.turning) return;
    gradient.add(rate, t, 2 * n, w);
    gradient.add(place, 1, n, [](const FrameMotion& f) { return f.a_p; });
  };
  switch (row.kind) {
    case RowKind::speed:
      gradient.add(rate, t, limit.n, whole);
      if (limits.turning) gradient.add(place, 1, limit.n, w);
      break;
    case RowKind::acceleration:
    case RowKind::force:
      accelerated(limit.n);
      break;
    default:
      gradient.add(raised_jerk_map(), t * t * t, limit.n, whole);
      if (limits.turning) {
        gradient.add(bend, t * t, 3 * limit.n, w);
        gradient.add(rate, t, limit.n, [](const FrameMotion& f) { return f.j_v; });
        gradient.add(place, 1, limit.n, [](const FrameMotion& f) { return f.j_p; });
      }
      accelerated(-limit.b * Vector3::UnitZ());
  }
  return gradient.sum;
}

double row_violation(const RowId& row, const Corridor& corridor,
                     const DynamicLimitRows& limits, const SegmentFrames& frames,
                     const std::array<ControlPoints, kSegments>& c,
                     const std::array<Seconds, kSegments>& T) {
  if (row.kind == RowKind::position) {
    const HalfSpace& plane = corridor.planes[row.face];
    return c[row.segment].row(row.point).dot(plane.a) - plane.b;
  }
  const SegmentFrame& frame = frames[row.segment];
  const MotionCurves curves =
      motion_curves(limits, frame, c[row.segment], T[row.segment]);
  const LimitRow& face = limit_row(row, limits);
  switch (row.kind) {
    case RowKind::speed:
      return curves.v.row(row.point).dot(face.n) - face.b + frame.slack_v;
    case RowKind::acceleration:
      return curves.a.row(row.point).dot(face.n) - face.b + frame.slack_a;
    case RowKind::force:
      return curves.f.row(row.point).dot(face.n) - face.b +
             frame.slack_f * face.n.norm();
    default:
      return curves.j.row(row.point).dot(face.n) - face.b * curves.f(row.point, 2) +
             frame.slack_j + face.b * frame.slack_f;
  }
}

Constraint row_meaning(const RowId& row, const Corridor& corridor,
                       const DynamicLimitRows& limits) {
  return row.kind == RowKind::position ? corridor.planes[row.face].meaning
                                       : limit_row(row, limits).meaning;
}

}  // namespace alight
