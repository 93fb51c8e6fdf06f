#include <cmath>

#include "alight/planning/planner_setting.h"

namespace alight {
namespace {

constexpr double kLargest = 1e4;  ///< m, m/s, m/s^2, s: beyond it a request is noise.

bool sensible(const Vector3& v) {
  return v.allFinite() && v.cwiseAbs().maxCoeff() < kLargest;
}

bool sensible(const PlatformForecast& forecast) {
  if (forecast.nodes.empty()) return true;
  if (!(forecast.step > 1e-3 && forecast.step < kLargest)) return false;
  if (!(forecast.begin >= 0 && forecast.begin < kLargest)) return false;
  for (const PlatformNode& n : forecast.nodes) {
    if (!sensible(n.v_IN_N) || !sensible(n.w_IN_N) || !sensible(n.dv_N) ||
        !sensible(n.dw_N) || !sensible(n.g_N)) {
      return false;
    }
  }
  return true;
}

}  // namespace

const char* complaint(const PlanRequest& request) {
  const FlatState& f = request.from;
  if (!sensible(f.p_NB) || !sensible(f.v_NB) || !sensible(f.a_NB) ||
      !std::isfinite(f.yaw) || !std::isfinite(f.yaw_rate) ||
      !std::isfinite(f.yaw_acceleration) || (request.keep_jerk && !sensible(f.j_NB)) ||
      (request.has_return && !sensible(request.return_to))) {
    return "the start state holds no usable numbers";
  }
  const PlatformState& p = request.platform;
  if (!sensible(p.v_IN_N) || !sensible(p.w_IN_N) || !sensible(p.a_IN_N) ||
      !sensible(p.alpha_IN_N) || !p.X_IN.matrix().allFinite() ||
      !sensible(request.forecast)) {
    return "the platform's state holds no usable numbers";
  }
  const auto& T = request.durations;
  if (T[0] == 0 && T[1] == 0) return nullptr;
  for (const Seconds t : T) {
    if (!(t > 1e-3 && t < kLargest)) return "a segment's duration is not positive";
  }
  return nullptr;
}

void Planner::Setting::collect_qp(
    const PlanRequest& request, const std::array<Seconds, kSegments>& T,
    const Corridor& corridor, const DynamicLimitRows& limits, const QpOutcome& outcome,
    const std::vector<ActiveRow>& active, PlanDetails& details) const {
  if (!(T[0] > 0 && T[1] > 0)) return;
  std::vector<RowId> rows;
  const auto add = [&](RowKind kind, std::size_t segment, int points,
                       std::size_t face) {
    for (int i = 0; i < points; ++i) {
      rows.push_back({kind, static_cast<std::uint8_t>(segment),
                      static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(face)});
    }
  };
  for (std::size_t f = 0; f < corridor.planes.size(); ++f) {
    add(RowKind::position, static_cast<std::size_t>(corridor.planes[f].segment),
        kControlPoints, f);
  }
  const int bends = acceleration_points(limits);
  for (std::size_t s = 0; s < kSegments; ++s) {
    for (std::size_t f = 0; f < limits.speed.size(); ++f) {
      add(RowKind::speed, s, velocity_points(limits), f);
    }
    for (std::size_t f = 0; f < limits.acceleration.size(); ++f) {
      add(RowKind::acceleration, s, bends, f);
    }
    for (std::size_t f = 0; f < limits.force.size(); ++f) {
      add(RowKind::force, s, bends, f);
    }
    for (std::size_t f = 0; f < limits.body_rate.size(); ++f) {
      add(RowKind::body_rate, s, bends, f);
    }
  }

  // In all variables; where the jerk is kept an equation fixes c3.
  const Reduction reduction(request.from, end, T);
  const Reduction kept(request.from, end, T, request.keep_jerk);
  const SegmentFrames frames = segment_frames(limits, T);
  PlanQp& qp = details.qp;
  const double unit = 2 / std::pow(reduction.h, 5);
  const auto count = static_cast<Eigen::Index>(rows.size());
  qp.P.setZero(kVariables, kVariables);
  qp.q.resize(kVariables);
  for (int axis = 0; axis < 3; ++axis) {
    const int at = axis * kReduced;
    qp.P.block<kReduced, kReduced>(at, at) = unit * reduction.H;
    qp.q.segment<kReduced>(at) = unit * reduction.g.col(axis);
  }
  qp.A.setZero(request.keep_jerk ? 3 : 0, kVariables);
  qp.b.resize(qp.A.rows());
  for (Eigen::Index axis = 0; axis < qp.A.rows(); ++axis) {
    qp.A(axis, axis * kReduced) = 1;
    qp.b[axis] = kept.m0[0](3, axis);
  }
  qp.G.resize(count, kVariables);
  qp.h.resize(count);
  qp.z.setZero(count);
  for (Eigen::Index r = 0; r < count; ++r) {
    const RowId& row = rows[static_cast<std::size_t>(r)];
    const Matrix73 gradient =
        row_gradient(row, corridor, limits, frames, reduction.M, reduction.T);
    qp.G.row(r) = gradient.reshaped().transpose();
    qp.h[r] = -row_violation(row, corridor, limits, frames, reduction.m0, reduction.T);
    qp.meaning.push_back(row_meaning(row, corridor, limits));
    for (const ActiveRow& one : active) {
      if (one.row == row) qp.z[r] = one.multiplier;
    }
  }
  if (outcome.solved()) {
    Matrix73 x = Whitened(kept).variables(outcome.u);
    if (request.keep_jerk) x.row(0) = kept.m0[0].row(3);
    qp.x = x.reshaped();
  }
  qp.constant = unit / 2 * reduction.k;
}

Result<PlanDetails> Planner::explain(const PlanRequest& request) const {
  PlanDetails details;
  const PlanResult result = setting_->run(request, &details);
  details.result = result;
  if (result.status == PlanStatus::invalid_request) {
    return fail(Fault::invalid_input, result.reason);
  }
  details.platform = request.platform;
  details.start = request.from;
  details.end = setting_->end;
  details.speed_m_s = setting_->rig.limits.speed_m_s;
  details.acceleration_m_s2 = setting_->rig.limits.acceleration_m_s2;
  for (const Vector3& n : setting_->polyhedron.normals) {
    details.polyhedron.push_back({n, setting_->polyhedron.face_distance});
  }
  for (const LimitRow& row : setting_->limits_of(request, 1).force) {
    details.force.push_back({row.n, row.b, row.meaning});
  }
  const ThrustRange thrust = thrust_range(config(), setting_->rig.drone);
  details.thrust_least_m_s2 = thrust.least;
  details.thrust_most_m_s2 = thrust.most;
  details.heading_rate_rad_s = heading_rate_max(config(), setting_->rig.drone);
  return details;
}

}  // namespace alight
