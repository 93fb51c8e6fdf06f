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

ThrustRange thrust_range(const PlannerConfig& config, const DroneSpec& drone) {
  return {config.thrust_least_share * kGravity,
          config.thrust_most_share * drone.thrust_to_weight * kGravity};
}

double heading_rate_max(const PlannerConfig& config, const DroneSpec& drone) {
  // About its z axis the body turns by at most rate / cos(tilt) and what the tilt makes
  // of its other rates.
  const double tilt = std::min(config.tilt_max_deg, drone.tilt_max_deg) * kDegree;
  const double left = config.yaw_rate_max_deg_s * kDegree -
                      std::tan(tilt) * config.body_rate_max_deg_s * kDegree;
  return std::max(0.2 * config.yaw_rate_max_deg_s * kDegree, left * std::cos(tilt));
}

DynamicLimitRows make_limits(const PlannerConfig& config, const Rig& rig,
                             const LimitPolyhedron& polyhedron,
                             const PlatformState& platform, double factor,
                             const PlatformForecast& forecast) {
  DynamicLimitRows rows;
  rows.platform = platform;
  rows.raised = !polyhedron.box;
  if (rows.raised) rows.forecast = forecast;
  rows.turning = rows.raised && (rows.varying() || !platform.w_IN_N.isZero(0) ||
                                 !platform.alpha_IN_N.isZero(0));

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
  const double tilt = std::min(config.tilt_max_deg, rig.drone.tilt_max_deg) * kDegree;
  const double slope = std::cos(kPi / kTiltDirections) * std::tan(tilt);
  const double spare = (1 - factor) * slope * kGravity;
  for (int i = 0; i < kTiltDirections; ++i) {
    const double at = 2 * kPi * i / kTiltDirections;
    const Vector3 n(std::cos(at), std::sin(at), -slope);
    rows.force.push_back({n, -spare, 0, Constraint::tilt});
  }
  rows.tilt_rows = kTiltDirections;
  rows.tilt_slope = slope;
  rows.tilt_spare = spare;

  // Within the cone |f| <= f_z / cos(tilt), and f_z <= |f| anyway.
  const ThrustRange thrust = thrust_range(config, rig.drone);
  const double most = thrust.most * std::cos(tilt);
  const auto tightened = [&](double bound) {
    return kGravity + factor * (bound - kGravity);
  };
  rows.force.push_back({Vector3::UnitZ(), tightened(most), most, Constraint::thrust});
  rows.force.push_back(
      {-Vector3::UnitZ(), -tightened(thrust.least), -thrust.least, Constraint::thrust});

  const double rate = polyhedron.face_distance * config.body_rate_max_deg_s * kDegree;
  for (const Vector3& n : polyhedron.normals) {
    rows.body_rate.push_back({n, factor * rate, rate, Constraint::body_rate});
  }
  return rows;
}

}  // namespace alight
