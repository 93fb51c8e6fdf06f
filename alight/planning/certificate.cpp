#include "alight/planning/certificate.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/planning/corridor.h"

namespace alight {
namespace {

constexpr int kMost = 15;
constexpr int kDepth = 24;
constexpr double kGap = 1e-4;
constexpr double kEqual = 1e-6;  ///< Jumps and end states may differ by this.
constexpr Seconds kLedStep = 0.005;
constexpr int kDirections = 32;

using Curve = std::array<Vector3, kControlPoints>;  ///< Degree 7 throughout.
using Scalar = std::array<double, kControlPoints>;

void refine(const std::array<double, kMost>& c, int count, double gap, int depth,
            double& known, double& bound) {
  const auto n = static_cast<std::size_t>(count);
  const double high = *std::max_element(c.begin(), c.begin() + count);
  known = std::max({known, c[0], c[n - 1]});
  if (high <= known + gap || depth == 0) {
    bound = std::max(bound, high);
    return;
  }
  std::array<double, kMost> left{};
  std::array<double, kMost> right = c;
  for (std::size_t level = 0; level < n; ++level) {
    left[level] = right[0];
    for (std::size_t i = 0; i + level + 1 < n; ++i) {
      right[i] = 0.5 * (right[i] + right[i + 1]);
    }
  }
  refine(left, count, gap, depth - 1, known, bound);
  refine(right, count, gap, depth - 1, known, bound);
}

/// Derivative by time, raised back to degree 7.
Curve derivative(const Curve& c, Seconds T) {
  constexpr int n = kControlPoints - 1;
  std::array<Vector3, n> d;
  for (std::size_t i = 0; i < n; ++i) d[i] = n / T * (c[i + 1] - c[i]);
  Curve raised;
  for (std::size_t i = 0; i <= n; ++i) {
    const double share = static_cast<double>(i) / n;
    raised[i] = Vector3::Zero();
    if (i > 0) raised[i] += share * d[i - 1];
    if (i < n) raised[i] += (1 - share) * d[i];
  }
  return raised;
}

double maximum(const Curve& curve, const Vector3& n) {
  Scalar s;
  for (std::size_t i = 0; i < s.size(); ++i) s[i] = n.dot(curve[i]);
  return bernstein_maximum(s.data(), kControlPoints, kGap);
}

double binomial(int n, int k) {
  double value = 1;
  for (int i = 1; i <= k; ++i) value = value * (n - k + i) / i;
  return value;
}

/// Largest norm along a curve, by the degree 14 polynomial of its square.
double maximum_norm(const Curve& curve) {
  constexpr int n = kControlPoints - 1;
  std::array<double, kMost> square{};
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) {
      square[static_cast<std::size_t>(i + j)] +=
          binomial(n, i) * binomial(n, j) / binomial(2 * n, i + j) *
          curve[static_cast<std::size_t>(i)].dot(curve[static_cast<std::size_t>(j)]);
    }
  }
  return std::sqrt(std::max(0.0, bernstein_maximum(square.data(), kMost, kGap)));
}

class Checker {
 public:
  Checker(const CertificateTask& task, const Trajectory& trajectory)
      : task_(task),
        trajectory_(trajectory),
        paper_(task.config.profile == Profile::paper) {
    margin_.fill(std::numeric_limits<double>::infinity());
  }

  Certificate run() {
    corridor();
    dynamics();
    Certificate out;
    for (std::size_t i = 0; i < margin_.size(); ++i) {
      if (std::isinf(margin_[i]) && margin_[i] > 0) continue;
      out.push_back({to_string(static_cast<Constraint>(i)), margin_[i]});
    }
    joints(out);
    if (!paper_) leds(out);
    return out;
  }

 private:
  void note(Constraint constraint, double margin) {
    double& least = margin_[static_cast<std::size_t>(constraint)];
    least = std::isnan(margin) ? -std::numeric_limits<double>::infinity()
                               : std::min(least, margin);
  }

  void corridor() {
    const Corridor corridor =
        build_corridor(task_.config, task_.rig, task_.request.from, task_.end);
    for (const HalfSpace& plane : corridor.planes) {
      const Curve& c = trajectory_.c[static_cast<std::size_t>(plane.segment)];
      note(plane.meaning, plane.b - maximum(c, plane.a));
    }
  }

  void dynamics() {
    const PlatformState& platform = task_.request.platform;
    const DynamicLimits& limits = task_.rig.limits;
    const Vector3 g_N = gravity_N(platform);
    const double slope = std::tan(
        std::min(task_.config.tilt_max_deg, task_.rig.drone.tilt_max_deg) * kDegree);
    for (std::size_t s = 0; s < kSegments; ++s) {
      const Curve& p = trajectory_.c[s];
      const Seconds T = trajectory_.durations[s];
      Curve v = derivative(p, T);
      Curve a = derivative(v, T);
      if (paper_) {
        for (int axis = 0; axis < 3; ++axis) {
          for (const double sign : {1.0, -1.0}) {
            const Vector3 n = sign * Vector3::Unit(axis);
            note(Constraint::speed,
                 limits.speed_m_s - n.dot(platform.v_IN_N) - maximum(v, n));
            note(Constraint::acceleration,
                 limits.acceleration_m_s2 - n.dot(platform.a_IN_N) - maximum(a, n));
          }
        }
        continue;
      }
      for (std::size_t i = 0; i < p.size(); ++i) {
        a[i] = inertial_acceleration_N(platform, p[i], v[i], a[i]);
        v[i] = inertial_velocity_N(platform, p[i], v[i]);
      }
      note(Constraint::speed, limits.speed_m_s - maximum_norm(v));
      note(Constraint::acceleration, limits.acceleration_m_s2 - maximum_norm(a));
      for (int k = 0; k < kDirections; ++k) {
        const double at = 2 * kPi * k / kDirections;
        const double outer = 1 / std::cos(kPi / kDirections);
        const Vector3 n(outer * std::cos(at), outer * std::sin(at), -slope);
        note(Constraint::tilt, n.dot(g_N) - maximum(a, n));
      }
    }
  }

  /// Start, end and the joint between the segments.
  void joints(Certificate& out) const {
    const auto gap = [](const FlatState& a, const FlatState& b) {
      return std::max({(a.p_NB - b.p_NB).norm(), (a.v_NB - b.v_NB).norm(),
                       (a.a_NB - b.a_NB).norm()});
    };
    const auto state = [&](std::size_t s, double u) {
      FlatState x;
      evaluate_bezier(trajectory_.c[s], u, trajectory_.durations[s], x);
      return x;
    };
    const auto tell = [&](const char* name, double jump) {
      const double margin = kEqual - jump;
      out.push_back({name, std::isnan(margin) ? -1e9 : margin});
    };
    tell("start_state", gap(state(0, 0), task_.request.from));
    tell("continuity", gap(state(0, 1), state(1, 0)));
    tell("end_state", gap(state(1, 1), task_.end));
  }

  void leds(Certificate& out) const {
    const Intrinsics& k = task_.rig.camera.intrinsics;
    const Vector3 p_NC = task_.rig.camera.X_NC.translation();
    const Vector3 shadow = pad_shadow_normal(task_.rig.camera, task_.rig.pad);
    double picture = 1e9;
    double over = 1e9;
    const Seconds duration = trajectory_.duration();
    const int steps = std::clamp(static_cast<int>(duration / kLedStep), 1, 20000);
    for (int i = 0; i <= steps; ++i) {
      const FlatState state = trajectory_.at(duration * i / steps);
      const Pose X_NB =
          make_pose(flat_attitude(task_.request.platform, state), state.p_NB);
      for (const Led& led : task_.rig.leds.leds) {
        const auto uv = project_led(task_.rig.camera, X_NB, led.p_BL);
        if (!uv) {
          picture = std::min(picture, -1e3);
          continue;
        }
        picture = std::min(
            {picture, uv->x(), uv->y(), k.width - 1 - uv->x(), k.height - 1 - uv->y()});
        const Vector3 p_NL = X_NB * led.p_BL;
        if (p_NL.head<2>().cwiseAbs().maxCoeff() > task_.rig.pad.size_m / 2) {
          over = std::min(over, -shadow.dot(p_NL - p_NC));
        }
      }
    }
    out.push_back({"leds_in_picture_px", picture});
    if (over < 1e8) out.push_back({"leds_over_pad_edge", over});
  }

  const CertificateTask& task_;
  const Trajectory& trajectory_;
  bool paper_;
  std::array<double, kConstraints> margin_;
};

}  // namespace

double bernstein_maximum(const double* coefficients, int count, double gap) {
  std::array<double, kMost> c{};
  double known = -std::numeric_limits<double>::infinity();
  double bound = known;
  for (int i = 0; i < count; ++i) {
    if (std::isnan(coefficients[i])) return std::numeric_limits<double>::infinity();
    c[static_cast<std::size_t>(i)] = coefficients[i];
  }
  refine(c, count, gap, kDepth, known, bound);
  return bound;
}

Matrix3 flat_attitude(const PlatformState& platform, const FlatState& state) {
  const Vector3 f =
      inertial_acceleration_N(platform, state.p_NB, state.v_NB, state.a_NB) -
      gravity_N(platform);
  const Vector3 z = f.norm() > 1e-9 ? f.normalized() : Vector3::UnitZ().eval();
  const Vector3 heading(std::cos(state.yaw), std::sin(state.yaw), 0);
  Vector3 x = z.z() * heading;
  x.z() = -z.dot(heading);
  if (x.norm() < 1e-9) return Matrix3::Identity();
  x.normalize();
  Matrix3 R;
  R << x, z.cross(x), z;
  return R;
}

Certificate certify(const CertificateTask& task, const Trajectory& trajectory) {
  return Checker(task, trajectory).run();
}

const CertificateEntry* weakest(const Certificate& certificate) {
  if (certificate.empty()) return nullptr;
  return std::min_element(certificate.begin(), certificate.end(),
                          [](const CertificateEntry& a, const CertificateEntry& b) {
                            return a.margin < b.margin;
                          });
}

}  // namespace alight
