#include "alight/planning/planner.h"

#include <algorithm>
#include <cmath>

#include "alight/planning/certificate.h"
#include "alight/planning/time_allocation.h"

namespace alight {
namespace {

constexpr double kViolated = -1e-6;  ///< Margins below this refuse a trajectory.
constexpr double kLargest = 1e4;  ///< m, m/s, m/s^2, s: beyond it a request is noise.

bool sensible(const Vector3& v) {
  return v.allFinite() && v.cwiseAbs().maxCoeff() < kLargest;
}

const char* complaint(const PlanRequest& request) {
  const FlatState& f = request.from;
  if (!sensible(f.p_NB) || !sensible(f.v_NB) || !sensible(f.a_NB) ||
      !std::isfinite(f.yaw) || !std::isfinite(f.yaw_rate)) {
    return "the start state holds no usable numbers";
  }
  const PlatformState& p = request.platform;
  if (!sensible(p.v_IN_N) || !sensible(p.w_IN_N) || !sensible(p.a_IN_N) ||
      !sensible(p.alpha_IN_N) || !p.X_IN.matrix().allFinite()) {
    return "the platform's state holds no usable numbers";
  }
  const auto& T = request.durations;
  if (T[0] == 0 && T[1] == 0) return nullptr;
  for (const Seconds t : T) {
    if (!(t > 1e-3 && t < kLargest)) return "a segment's duration is not positive";
  }
  return nullptr;
}

const char* reason(const QpOutcome::Kind kind, const RowId& row,
                   const Corridor& corridor, const DynamicLimitRows& limits) {
  if (kind == QpOutcome::Kind::no_convergence) return "the solver did not converge";
  const Constraint meaning = row_meaning(row, corridor, limits);
  if (kind == QpOutcome::Kind::infeasible) return cannot_be_met(meaning);
  return row.segment == 0 ? start_outside(meaning) : end_outside(meaning);
}

}  // namespace

struct Planner::Setting {
  Rig rig;
  LimitPolyhedron polyhedron;
  FlatState end;

  /// The one way to a plan; `details` also collects what it was made from.
  PlanResult run(const PlannerConfig& config, const PlanRequest& request,
                 PlanDetails* details) const;
  void collect(PlanDetails& details, const Reduction& reduction,
               const Corridor& corridor, const DynamicLimitRows& limits,
               const QpOutcome& outcome, const std::vector<ActiveRow>& active) const;
};

PlanResult Planner::Setting::run(const PlannerConfig& config,
                                 const PlanRequest& request,
                                 PlanDetails* details) const {
  PlanResult result;
  result.id = request.id;
  result.start = request.start;
  if (const char* what = complaint(request)) {
    result.status = PlanStatus::invalid_request;
    result.reason = what;
    return result;
  }

  // The corridor (eqn:MP_KINE) and the relative dynamic limits (eqn:MP_dynconstr).
  const FlatState& from = request.from;
  const Corridor corridor = build_corridor(config, rig, from, end);
  const DynamicLimitRows limits =
      make_limits(config, rig, polyhedron, request.platform, 1);
  if (details != nullptr) {
    details->halfspaces.assign(corridor.planes.begin(), corridor.planes.end());
  }
  if (corridor.full) {
    result.reason = "too many obstacles";
    return result;
  }
  for (const HalfSpace& plane : corridor.planes) {
    const bool first = plane.segment == 0;
    if (plane.a.dot(first ? from.p_NB : end.p_NB) <= plane.b + 1e-7) continue;
    result.reason = first ? start_outside(plane.meaning) : end_outside(plane.meaning);
    return result;
  }

  // Time allocation under tightened limits, unless the times are given.
  LandingQp qp;
  std::array<Seconds, kSegments> T = request.durations;
  if (T[0] == 0) {
    const DynamicLimitRows tightened =
        make_limits(config, rig, polyhedron, request.platform, config.tightening);
    const Allocation allocation =
        allocate_time(config, time_range(config, rig, request, end), from, end,
                      corridor, tightened, qp);
    result.tried = allocation.tried;
    result.feasible = allocation.feasible;
    if (allocation.feasible == 0) {
      result.reason = reason(allocation.failure, allocation.blame, corridor, tightened);
      return result;
    }
    T = allocation.best;
  }

  // The online solve.
  const Reduction reduction(from, end, T);
  const QpOutcome outcome = qp.solve(reduction, corridor, limits);
  if (request.durations[0] != 0) {
    result.tried = 1;
    result.feasible = outcome.solved() ? 1 : 0;
  }
  if (details != nullptr) {
    details->best = T;
    collect(*details, reduction, corridor, limits, outcome, qp.active());
  }
  if (!outcome.solved()) {
    result.reason = reason(outcome.kind, outcome.blame, corridor, limits);
    return result;
  }
  Trajectory& trajectory = result.trajectory;
  trajectory.durations = T;
  trajectory.yaw_start = from.yaw;
  trajectory.yaw_end = end.yaw;
  for (std::size_t s = 0; s < kSegments; ++s) {
    for (std::size_t i = 0; i < kControlPoints; ++i) {
      trajectory.c[s][i] = outcome.c[s].row(static_cast<Eigen::Index>(i)).transpose();
    }
  }
  result.jerk_cost = outcome.jerk_cost;
  result.cost = outcome.jerk_cost - reduction.k / std::pow(reduction.h, 5);

  // The solver is not believed.
  result.certificate = certify({config, rig, request, end}, trajectory);
  const CertificateEntry* least = weakest(result.certificate);
  if (least == nullptr || !(least->margin >= kViolated)) {
    result.reason = least == nullptr ? "no certificate" : least->constraint;
    return result;
  }
  result.status = PlanStatus::solved;
  return result;
}

/// eqn:MP_OPT in full, every row of it, for people and other programs.
void Planner::Setting::collect(PlanDetails& details, const Reduction& reduction,
                               const Corridor& corridor, const DynamicLimitRows& limits,
                               const QpOutcome& outcome,
                               const std::vector<ActiveRow>& active) const {
  std::vector<RowId> rows;
  const auto add = [&](RowKind kind, int segment, int points, std::size_t face) {
    for (int i = 0; i < points; ++i) {
      rows.push_back({kind, static_cast<std::uint8_t>(segment),
                      static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(face)});
    }
  };
  for (std::size_t f = 0; f < corridor.planes.size(); ++f) {
    add(RowKind::position, corridor.planes[f].segment, kControlPoints, f);
  }
  const int speeds = velocity_map(limits.raised).count;
  const int accelerations = acceleration_map(limits.raised).count;
  for (int s = 0; s < kSegments; ++s) {
    for (std::size_t f = 0; f < limits.speed.size(); ++f) {
      add(RowKind::speed, s, speeds, f);
    }
    for (std::size_t f = 0; f < limits.acceleration.size(); ++f) {
      add(RowKind::acceleration, s, accelerations, f);
    }
  }

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
  qp.A.resize(0, kVariables);
  qp.b.resize(0);
  qp.G.resize(count, kVariables);
  qp.h.resize(count);
  qp.z.setZero(count);
  for (Eigen::Index r = 0; r < count; ++r) {
    const RowId& row = rows[static_cast<std::size_t>(r)];
    const Matrix73 gradient =
        row_gradient(row, corridor, limits, reduction.M, reduction.T);
    qp.G.row(r) = gradient.reshaped().transpose();
    qp.h[r] = -row_violation(row, corridor, limits, reduction.m0, reduction.T);
    qp.meaning.push_back(row_meaning(row, corridor, limits));
    for (const ActiveRow& one : active) {
      if (one.row == row) qp.z[r] = one.multiplier;
    }
  }
  if (outcome.solved()) qp.x = Whitened(reduction).variables(outcome.u).reshaped();
  qp.constant = unit / 2 * reduction.k;
}

Planner::Planner(const PlannerConfig& config, std::shared_ptr<const Setting> setting)
    : config_(config), setting_(std::move(setting)) {}

Result<Planner> Planner::create(const PlannerConfig& config, const Rig& rig) {
  if (const auto valid = config.validate(); !valid) return fail(valid.error());
  if (const auto valid = rig.validate(); !valid) return fail(valid.error());
  auto setting = std::make_shared<Setting>();
  setting->rig = rig;
  setting->polyhedron = make_polyhedron(config.profile);
  setting->end = landing_end(config, rig);
  return Planner(config, std::move(setting));
}

PlanResult Planner::plan(const PlanRequest& request) const {
  return setting_->run(config_, request, nullptr);
}

Result<PlanDetails> Planner::explain(const PlanRequest& request) const {
  PlanDetails details;
  details.result = setting_->run(config_, request, &details);
  if (details.result.status == PlanStatus::invalid_request) {
    return fail(Fault::invalid_input, details.result.reason);
  }
  details.platform = request.platform;
  details.speed_m_s = setting_->rig.limits.speed_m_s;
  details.acceleration_m_s2 = setting_->rig.limits.acceleration_m_s2;
  for (const Vector3& n : setting_->polyhedron.normals) {
    details.polyhedron.push_back({n, setting_->polyhedron.face_distance});
  }
  return details;
}

PlanResult plan(const Planner& planner, const PlanRequest& request) {
  return planner.plan(request);
}

}  // namespace alight
