#include "alight/planning/limits.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr int kTiltDirections = 12;

/// Farthest vertex of { n'x <= 1 }: all triples of faces.
double farthest_vertex(const FixedVector<Vector3, 32>& normals) {
  double farthest = 0;
  const std::size_t count = normals.size();
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = i + 1; j < count; ++j) {
      for (std::size_t k = j + 1; k < count; ++k) {
        Matrix3 A;
        A << normals[i].transpose(), normals[j].transpose(), normals[k].transpose();
        if (std::abs(A.determinant()) < 1e-9) continue;
        const Vector3 x = A.inverse() * Vector3::Ones();
        const bool vertex =
            std::all_of(normals.begin(), normals.end(),
                        [&](const Vector3& n) { return n.dot(x) < 1 + 1e-9; });
        if (vertex) farthest = std::max(farthest, x.norm());
      }
    }
  }
  return farthest;
}

}  // namespace

LimitPolyhedron make_polyhedron(Profile profile) {
  LimitPolyhedron polyhedron;
  auto& normals = polyhedron.normals;
  if (profile == Profile::paper) {
    polyhedron.box = true;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {1.0, -1.0}) {
        Vector3 n = Vector3::Zero();
        n[axis] = sign;
        normals.push_back(n);
      }
    }
    return polyhedron;
  }
  // Vertices of an icosahedron (12) and of its dual (20): evenly over the sphere.
  const double phi = (1 + std::sqrt(5.0)) / 2;
  const auto add_cyclic = [&](double a, double b) {
    for (const double s : {1.0, -1.0}) {
      for (const double t : {1.0, -1.0}) {
        normals.push_back(Vector3(0, s * a, t * b).normalized());
        normals.push_back(Vector3(s * a, t * b, 0).normalized());
        normals.push_back(Vector3(t * b, 0, s * a).normalized());
      }
    }
  };
  add_cyclic(1, phi);
  add_cyclic(phi, 1 / phi);
  for (const double x : {1.0, -1.0}) {
    for (const double y : {1.0, -1.0}) {
      for (const double z : {1.0, -1.0}) {
        normals.push_back(Vector3(x, y, z).normalized());
      }
    }
  }
  polyhedron.face_distance = 1 / farthest_vertex(normals);
  return polyhedron;
}

DynamicLimitRows make_limits(const PlannerConfig& config, const Rig& rig,
                             const LimitPolyhedron& polyhedron,
                             const PlatformState& platform, double factor) {
  DynamicLimitRows rows;
  rows.v0 = platform.v_IN_N;
  rows.a0 = platform.a_IN_N;
  rows.raised = !polyhedron.box;
  if (!polyhedron.box) {
    const Matrix3 w = hat(platform.w_IN_N);
    rows.v_p = w;
    rows.a_v = 2 * w;
    rows.a_p = w * w + hat(platform.alpha_IN_N);
  }
  rows.turning = !rows.v_p.isZero(0) || !rows.a_p.isZero(0);

  const double speed = polyhedron.face_distance * rig.limits.speed_m_s;
  const double acceleration = polyhedron.face_distance * rig.limits.acceleration_m_s2;
  for (const Vector3& n : polyhedron.normals) {
    rows.speed.push_back({n, factor * speed, speed, Constraint::speed});
    rows.acceleration.push_back(
        {n, factor * acceleration, acceleration, Constraint::acceleration});
  }
  rows.speed_inside = factor * speed;
  rows.acceleration_inside = factor * acceleration;
  if (polyhedron.box) return rows;

  // |f_xy| <= tan(tilt) f_z by a cone of twelve sides inside it.
  rows.g_N = gravity_N(platform);
  const double tilt = std::min(config.tilt_max_deg, rig.drone.tilt_max_deg) * kDegree;
  const double slope = std::cos(kPi / kTiltDirections) * std::tan(tilt);
  const double spare = (1 - factor) * slope * kGravity;
  for (int i = 0; i < kTiltDirections; ++i) {
    const double at = 2 * kPi * i / kTiltDirections;
    const Vector3 n(std::cos(at), std::sin(at), -slope);
    const double b = n.dot(rows.g_N);
    rows.acceleration.push_back({n, b - spare, b, Constraint::tilt});
  }
  rows.tilt_rows = kTiltDirections;
  rows.tilt_slope = slope;
  rows.tilt_spare = spare;
  return rows;
}

MotionCurves motion_curves(const DynamicLimitRows& limits, const ControlPoints& c,
                           Seconds T) {
  const ControlPoints v = velocity_map(limits.raised).map * c / T;
  MotionCurves curves;
  curves.v = v;
  curves.a = acceleration_map(limits.raised).map * c / (T * T);
  if (limits.turning) {
    curves.v += c * limits.v_p.transpose();
    curves.a += v * limits.a_v.transpose() + c * limits.a_p.transpose();
  }
  curves.v.rowwise() += limits.v0.transpose();
  curves.a.rowwise() += limits.a0.transpose();
  return curves;
}

}  // namespace alight
