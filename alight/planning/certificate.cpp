#include "alight/planning/certificate.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/planning/limits.h"

namespace alight {
namespace {

constexpr double kGap = 1e-4;
constexpr double kEqual = 1e-6;  ///< Jumps and end states may differ by this.
constexpr Seconds kAttitudeStep = 0.005;
constexpr Seconds kForecastStep = 0.002;
constexpr int kDirections =
    36;  ///< Of the tilt: holds all that a cone of 12 sides does.
constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// The largest of a function's samples, and half of what a parabola through three of
/// them can rise above.
class Peak {
 public:
  void add(double x) {
    if (std::isnan(x)) x = kInfinite;
    if (count_ >= 2) bend_ = std::max(bend_, std::abs(x - 2 * last_[1] + last_[0]));
    most_ = std::max(most_, x);
    last_ = {last_[1], x};
    ++count_;
  }
  double bound() const { return most_ + bend_ / 4; }

 private:
  std::array<double, 2> last_{};
  double most_ = -kInfinite;
  double bend_ = 0;
  int count_ = 0;
};

class Checker {
 public:
  Checker(const CertificateTask& task, const Trajectory& trajectory)
      : task_(task),
        trajectory_(trajectory),
        paper_(task.config.profile == Profile::paper) {
    margin_.fill(kInfinite);
    tilt_ = std::tan(std::min(task.config.tilt_max_deg, task.rig.drone.tilt_max_deg) *
                     kDegree);
    thrust_ = thrust_range(task.config, task.rig.drone);
  }

  Certificate run() {
    corridor();
    for (std::size_t s = 0; s < kSegments; ++s) {
      if (paper_) {
        boxes(s);
      } else if (task_.request.forecast.nodes.empty()) {
        steady(s);
      } else {
        sampled(s);
      }
    }
    double picture = kInfinite;
    double over = kInfinite;
    if (!paper_) attitudes(picture, over);

    Certificate out;
    for (std::size_t i = 0; i < margin_.size(); ++i) {
      if (std::isinf(margin_[i]) && margin_[i] > 0) continue;
      out.push_back({to_string(static_cast<Constraint>(i)), margin_[i]});
    }
    joints(out);
    if (!paper_) out.push_back({"leds_in_picture_px", picture});
    if (!std::isinf(over)) out.push_back({"leds_over_pad_edge", over});
    return out;
  }

 private:
  void note(Constraint constraint, double margin) {
    double& least = margin_[static_cast<std::size_t>(constraint)];
    least = std::isnan(margin) ? -kInfinite : std::min(least, margin);
  }

  void corridor() {
    Corridor own;
    if (task_.corridor == nullptr) {
      own = build_corridor(task_.config, task_.rig, task_.request.from, task_.end);
    }
    const Corridor& corridor = task_.corridor != nullptr ? *task_.corridor : own;
    for (std::size_t i = 0; i < corridor.hard; ++i) {
      const HalfSpace& plane = corridor.planes[i];
      const Curve& c = trajectory_.c[static_cast<std::size_t>(plane.segment)];
      note(plane.meaning, plane.b - maximum_along(c, plane.a, kGap));
    }
  }

  void boxes(std::size_t s) {
    const PlatformState& platform = task_.request.platform;
    const DynamicLimits& limits = task_.rig.limits;
    const Curve v = derivative(trajectory_.c[s], trajectory_.durations[s]);
    const Curve a = derivative(v, trajectory_.durations[s]);
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {1.0, -1.0}) {
        const Vector3 n = sign * Vector3::Unit(axis);
        note(Constraint::speed,
             limits.speed_m_s - n.dot(platform.v_IN_N) - maximum_along(v, n, kGap));
        note(Constraint::acceleration, limits.acceleration_m_s2 -
                                           n.dot(platform.a_IN_N) -
                                           maximum_along(a, n, kGap));
      }
    }
  }

  /// In I over a platform whose motion stays, exactly.
  void steady(std::size_t s) {
    const PlatformState& platform = task_.request.platform;
    const Curve& p = trajectory_.c[s];
    const Seconds T = trajectory_.durations[s];
    Curve v = derivative(p, T);
    Curve a = derivative(v, T);
    for (std::size_t i = 0; i < p.size(); ++i) {
      a[i] = inertial_acceleration_N(platform, p[i], v[i], a[i]);
      v[i] = inertial_velocity_N(platform, p[i], v[i]);
    }
    // The jerk in I: what the components do, turned with N.
    Curve j = derivative(a, T);
    Curve f;
    for (std::size_t i = 0; i < p.size(); ++i) {
      j[i] += platform.w_IN_N.cross(a[i]);
      f[i] = a[i] - gravity_N(platform);
    }
    note(Constraint::speed, task_.rig.limits.speed_m_s - maximum_norm(v, kGap));
    note(Constraint::acceleration,
         task_.rig.limits.acceleration_m_s2 - maximum_norm(a, kGap));
    for (int k = 0; k < kDirections; ++k) {
      const double at = 2 * kPi * k / kDirections;
      const double outer = 1 / std::cos(kPi / kDirections);
      const Vector3 n(outer * std::cos(at), outer * std::sin(at), -tilt_);
      note(Constraint::tilt, -maximum_along(f, n, kGap));
    }
    note(Constraint::thrust, thrust_.most - maximum_norm(f, kGap));
    note(Constraint::thrust,
         -maximum_along(f, -Vector3::UnitZ(), kGap) - thrust_.least);
    note(Constraint::body_rate, body_rate_max() - maximum_ratio(j, f, kGap));
  }

  /// In I over a forecast.
  void sampled(std::size_t s) {
    const PlanRequest& request = task_.request;
    const Seconds T = trajectory_.durations[s];
    const Seconds before = s == 0 ? 0 : trajectory_.durations[0];
    const int steps = std::clamp(static_cast<int>(T / kForecastStep), 2, 20000);
    Peak speed, acceleration, tilt, most, least, rate;
    for (int i = 0; i <= steps; ++i) {
      const double u = static_cast<double>(i) / steps;
      FlatState x;
      evaluate_bezier(trajectory_.c[s], u, T, x);
      const FrameMotion m =
          frame_motion(request.platform, request.forecast, before + u * T);
      const Vector3 a = m.acceleration(x.p_NB, x.v_NB, x.a_NB);
      const Vector3 f = a - m.a0 + m.f0;
      speed.add(m.velocity(x.p_NB, x.v_NB).norm());
      acceleration.add(a.norm());
      tilt.add(f.head<2>().norm() - tilt_ * f.z());
      most.add(f.norm());
      least.add(-f.z());
      rate.add(m.jerk(x.p_NB, x.v_NB, x.a_NB, x.j_NB).norm() / f.norm());
    }
    note(Constraint::speed, task_.rig.limits.speed_m_s - speed.bound());
    note(Constraint::acceleration,
         task_.rig.limits.acceleration_m_s2 - acceleration.bound());
    note(Constraint::tilt, -tilt.bound());
    note(Constraint::thrust, thrust_.most - most.bound());
    note(Constraint::thrust, -least.bound() - thrust_.least);
    note(Constraint::body_rate, body_rate_max() - rate.bound());
  }

  double body_rate_max() const { return task_.config.body_rate_max_deg_s * kDegree; }

  /// Start, end and the joint between the segments.
  void joints(Certificate& out) const {
    const auto gap = [](const FlatState& a, const FlatState& b) {
      return (a.p_NB - b.p_NB).norm() + (a.v_NB - b.v_NB).norm() +
             (a.a_NB - b.a_NB).norm();
    };
    const auto state = [&](std::size_t s, double u) {
      FlatState x;
      evaluate_bezier(trajectory_.c[s], u, trajectory_.durations[s], x);
      return x;
    };
    const auto tell = [&](const char* name, double jump) {
      const double margin = kEqual - jump;
      out.push_back({name, std::isnan(margin) ? -kInfinite : margin});
    };
    const FlatState& from = task_.request.from;
    const FlatState start = trajectory_.at(0);
    double jump = gap(start, from) + std::abs(wrap_angle(start.yaw - from.yaw)) +
                  std::abs(start.yaw_rate - from.yaw_rate);
    // Jerk in m/s^3 comes of thousandfold differences.
    if (task_.request.keep_jerk) jump += 1e-3 * (start.j_NB - from.j_NB).norm();
    tell("start_state", jump);
    tell("continuity", gap(state(0, 1), state(1, 0)));
    tell("end_state", gap(state(1, 1), task_.end));
  }

  /// LEDs in the picture and body rates, at the attitude that flatness gives.
  void attitudes(double& picture, double& over) {
    const PlanRequest& request = task_.request;
    const Intrinsics& k = task_.rig.camera.intrinsics;
    const Vector3 p_NC = task_.rig.camera.X_NC.translation();
    const Vector3 shadow = pad_shadow_normal(task_.rig.camera, task_.rig.pad);
    const Seconds duration = trajectory_.duration();
    const int steps = std::clamp(static_cast<int>(duration / kAttitudeStep), 2, 20000);
    const Seconds dt = duration / steps;
    Matrix3 last = Matrix3::Identity();
    for (int i = 0; i <= steps; ++i) {
      const FlatState x = trajectory_.at(i * dt);
      const FrameMotion m = frame_motion(request.platform, request.forecast, i * dt);
      const Vector3 f = m.acceleration(x.p_NB, x.v_NB, x.a_NB) - m.a0 + m.f0;
      const Pose X_NB = make_pose(flat_attitude(f, x.yaw), x.p_NB);
      const Matrix3 R_NB = X_NB.linear();
      if (i > 0) {
        const Vector3 w_IN(m.w(2, 1), m.w(0, 2), m.w(1, 0));
        const Vector3 w =
            so3_log(last.transpose() * R_NB) / dt + R_NB.transpose() * w_IN;
        note(Constraint::body_rate, body_rate_max() - w.head<2>().norm());
        note(Constraint::yaw_rate,
             task_.config.yaw_rate_max_deg_s * kDegree - std::abs(w.z()));
      }
      last = R_NB;
      for (const Obstacle& box : task_.rig.pad.obstacles) {
        const Vector3 q = x.p_NB.cwiseMax(box.min_m).cwiseMin(box.max_m);
        note(Constraint::obstacle, (x.p_NB - q).norm() - radius_of(task_));
      }
      for (const Led& led : task_.rig.leds.leds) {
        const auto uv = project_led(task_.rig.camera, X_NB, led.p_BL);
        if (!uv || !uv->allFinite()) {
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
  }

  static double radius_of(const CertificateTask& task) {
    return task.config.shrink_m > 0 ? task.config.shrink_m : drone_radius(task.rig);
  }

  const CertificateTask& task_;
  const Trajectory& trajectory_;
  bool paper_;
  double tilt_ = 0;  ///< Its tangent.
  ThrustRange thrust_;
  std::array<double, kConstraints> margin_;
};

}  // namespace

Matrix3 flat_attitude(const Vector3& f_N, double yaw) {
  const Vector3 z = f_N.norm() > 1e-9 ? f_N.normalized() : Vector3::UnitZ().eval();
  const Vector3 heading(std::cos(yaw), std::sin(yaw), 0);
  Vector3 x = z.z() * heading;
  x.z() = -z.dot(heading);
  if (x.norm() < 1e-9) return Matrix3::Identity();
  x.normalize();
  Matrix3 R;
  R << x, z.cross(x), z;
  return R;
}

Matrix3 flat_attitude(const PlatformState& platform, const FlatState& state) {
  return flat_attitude(
      inertial_acceleration_N(platform, state.p_NB, state.v_NB, state.a_NB) -
          gravity_N(platform),
      state.yaw);
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
