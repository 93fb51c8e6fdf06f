#include "alight/planning/landing_qp.h"

#include <algorithm>
#include <cmath>

extern "C" {
#include "api.h"
}

namespace alight {
namespace {

constexpr int kMaxRows = 320;  ///< Handed over in one solve.
constexpr int kMaxRounds = 64;
constexpr int kMaxIterations = 400;  ///< Of the active set, in one round.
constexpr double kTolerance = 1e-9;  ///< m, m/s, m/s^2; a row is violated beyond it.
constexpr double kStalled = 1e-7;    ///< What a row handed over may still violate.
constexpr double kJerkTolerance =
    1e-6;  ///< The same two of the body rates' rows, m/s^3
constexpr double kJerkStalled = 1e-4;
constexpr double kUnbounded = 1e30;

}  // namespace

struct LandingQp::Work {
  DAQPWorkspace daqp{};
  DAQPSettings settings{};
  std::array<double, static_cast<std::size_t>(kMaxRows) * kVariables> M{};
  std::array<double, kMaxRows> upper{};
  std::array<double, kMaxRows> lower{};
  std::array<double, kMaxRows> scaling{};
  std::array<int, kMaxRows> sense{};
  std::array<RowId, kMaxRows> rows{};
  int count = 0;
  std::vector<ActiveRow> active;

  const Corridor* corridor = nullptr;
  const DynamicLimitRows* limits = nullptr;
  const Whitened* whitened = nullptr;
  const Reduction* reduction = nullptr;
  SegmentFrames frames;
  QpOutcome* outcome = nullptr;
  bool added = false;

  void start();
  void scan();
  void scan_positions(std::size_t s);
  void scan_limits(std::size_t s);
  void scan_body_rates(std::size_t s, const MotionCurves& curves);
  template <class Faces>
  bool worst(const Faces& faces, std::size_t from, std::size_t to, const Vector3& x,
             double slack, RowId row);
  bool violated(const RowId& row, double excess, double slack_fixed);
  bool optimize();
  void keep_multipliers();
};

LandingQp::LandingQp() : work_(std::make_unique<Work>()) {
  Work& w = *work_;
  daqp_default_settings(&w.settings);
  w.settings.primal_tol = 0.1 * kTolerance;
  w.settings.iter_limit = kMaxIterations;
  allocate_daqp_workspace(&w.daqp, kVariables, 0);
  w.daqp.settings = &w.settings;
  w.daqp.M = w.M.data();
  w.daqp.dupper = w.upper.data();
  w.daqp.dlower = w.lower.data();
  w.daqp.scaling = w.scaling.data();
  w.daqp.sense = w.sense.data();
  w.lower.fill(-kUnbounded);
  w.active.reserve(kVariables + 1);
}

LandingQp::~LandingQp() {
  DAQPWorkspace& d = work_->daqp;
  d.settings = nullptr;  // ours
  d.scaling = nullptr;
  free_daqp_workspace(&d);
}

void LandingQp::Work::start() {
  count = 0;
  active.clear();
  daqp.m = 0;
  daqp.ms = 0;
  daqp.state = 0;
  reset_daqp_workspace(&daqp);
  std::fill_n(daqp.u, kVariables, 0.0);
}

/// Hands a violated row over. False: it cannot be met, or never will be.
bool LandingQp::Work::violated(const RowId& row, double excess, double slack_fixed) {
  const double stalled = row.kind == RowKind::body_rate ? kJerkStalled : kStalled;
  const auto known = std::find(rows.begin(), rows.begin() + count, row);
  if (known != rows.begin() + count) {
    if (excess <= stalled) return true;
    outcome->kind = QpOutcome::Kind::no_convergence;
    outcome->blame = row;
    return false;
  }
  const Matrix73 gradient =
      row_gradient(row, *corridor, *limits, frames, whitened->W, reduction->T);
  const double length = gradient.norm();
  if (length == 0) {
    if (excess <= slack_fixed + stalled) return true;
    outcome->kind = QpOutcome::Kind::fixed_row;
    outcome->blame = row;
    return false;
  }
  if (count == kMaxRows) {
    outcome->kind = QpOutcome::Kind::no_convergence;
    outcome->blame = row;
    return false;
  }
  const auto i = static_cast<std::size_t>(count++);
  rows[i] = row;
  sense[i] = 0;
  scaling[i] = 1 / length;
  Eigen::Map<Matrix73> out(M.data() + i * kVariables);
  out = gradient * scaling[i];
  // excess = gradient' u - bound at the present u.
  const Eigen::Map<const Matrix73> u(daqp.u);
  upper[i] = out.cwiseProduct(u).sum() - excess * scaling[i];
  added = true;
  return true;
}

void LandingQp::Work::scan_positions(std::size_t s) {
  const ControlPoints& c = outcome->c[s];
  for (std::size_t f = 0; f < corridor->planes.size(); ++f) {
    const HalfSpace& plane = corridor->planes[f];
    if (plane.segment != static_cast<int>(s)) continue;
    const Eigen::Matrix<double, kControlPoints, 1> excess =
        (c * plane.a).array() - plane.b;
    if (excess.maxCoeff() <= kTolerance) continue;
    for (int i = 0; i < kControlPoints; ++i) {
      if (excess[i] <= kTolerance) continue;
      const RowId row{RowKind::position, static_cast<std::uint8_t>(s),
                      static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(f)};
      if (!violated(row, excess[i], 0)) return;
    }
  }
}

/// Hands over the worst of faces `from` .. `to` - 1 at one control point, if violated.
template <class Faces>
bool LandingQp::Work::worst(const Faces& faces, std::size_t from, std::size_t to,
                            const Vector3& x, double slack, RowId row) {
  std::size_t at = from;
  double most = -kUnbounded;
  for (std::size_t f = from; f < to; ++f) {
    const double excess = faces[f].n.dot(x) - faces[f].b;
    if (excess <= most) continue;
    most = excess;
    at = f;
  }
  if (most + slack <= kTolerance) return true;
  row.face = static_cast<std::uint8_t>(at);
  return violated(row, most + slack, faces[at].b_fixed - faces[at].b + slack);
}

void LandingQp::Work::scan_limits(std::size_t s) {
  const SegmentFrame& frame = frames[s];
  const MotionCurves curves =
      motion_curves(*limits, frame, outcome->c[s], reduction->T[s]);
  const auto row = [&](RowKind kind, int point) {
    return RowId{kind, static_cast<std::uint8_t>(s), static_cast<std::uint8_t>(point),
                 0};
  };
  const double speed = std::max(0.0, limits->speed_inside - frame.slack_v);
  for (int i = 0; i < curves.v.rows(); ++i) {
    const Vector3 v = curves.v.row(i);
    if (v.squaredNorm() <= speed * speed) continue;
    if (!worst(limits->speed, 0, limits->speed.size(), v, frame.slack_v,
               row(RowKind::speed, i))) {
      return;
    }
  }
  const double acceleration =
      std::max(0.0, limits->acceleration_inside - frame.slack_a);
  for (int i = 0; i < curves.a.rows(); ++i) {
    const Vector3 a = curves.a.row(i);
    if (a.squaredNorm() <= acceleration * acceleration) continue;
    if (!worst(limits->acceleration, 0, limits->acceleration.size(), a, frame.slack_a,
               row(RowKind::acceleration, i))) {
      return;
    }
  }
  if (!limits->raised) return;

  const auto& force = limits->force;
  const double tilt_slack =
      frame.slack_f * std::sqrt(1 + limits->tilt_slope * limits->tilt_slope);
  for (int i = 0; i < curves.f.rows(); ++i) {
    const Vector3 f = curves.f.row(i);
    const double bound = limits->tilt_slope * f.z() - limits->tilt_spare - tilt_slack;
    const bool upright = bound >= 0 && f.head<2>().squaredNorm() <= bound * bound;
    if (!upright &&
        !worst(force, 0, limits->tilt_rows, f, tilt_slack, row(RowKind::force, i))) {
      return;
    }
    for (std::size_t k = limits->tilt_rows; k < force.size(); ++k) {
      if (!worst(force, k, k + 1, f, frame.slack_f, row(RowKind::force, i))) return;
    }
  }
  scan_body_rates(s, curves);
}

void LandingQp::Work::scan_body_rates(std::size_t s, const MotionCurves& curves) {
  const auto& faces = limits->body_rate;
  if (faces.empty()) return;
  const SegmentFrame& frame = frames[s];
  const double rate = faces[0].b;
  const double slack = frame.slack_j + rate * frame.slack_f;
  for (int i = 0; i < curves.j.rows(); ++i) {
    const Vector3 j = curves.j.row(i);
    const double f_z = curves.f(i, 2);
    const double bound = rate * f_z - slack;
    if (bound > 0 && j.squaredNorm() <= bound * bound) continue;
    std::size_t at = 0;
    for (std::size_t k = 1; k < faces.size(); ++k) {
      if (faces[k].n.dot(j) > faces[at].n.dot(j)) at = k;
    }
    const double excess = faces[at].n.dot(j) - bound;
    if (excess <= kJerkTolerance) continue;
    const RowId row{RowKind::body_rate, static_cast<std::uint8_t>(s),
                    static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(at)};
    const double spare = (faces[at].b_fixed - rate) * std::max(0.0, f_z);
    if (!violated(row, excess, spare + slack)) return;
  }
}

void LandingQp::Work::scan() {
  added = false;
  const Eigen::Map<const Matrix73> u(daqp.u);
  for (std::size_t s = 0; s < kSegments; ++s) {
    outcome->c[s].noalias() = whitened->W[s].transpose() * u;
    outcome->c[s] += whitened->c0[s];
    scan_positions(s);
    if (outcome->kind == QpOutcome::Kind::solved) scan_limits(s);
    if (outcome->kind != QpOutcome::Kind::solved) return;
  }
}

/// Continues the active set over all rows handed over so far.
bool LandingQp::Work::optimize() {
  daqp.m = count;
  const int flag = daqp_ldp(&daqp);
  outcome->iterations += daqp.iterations;
  if (flag == DAQP_EXIT_OPTIMAL) return true;
  outcome->kind = flag == DAQP_EXIT_INFEASIBLE ? QpOutcome::Kind::infeasible
                                               : QpOutcome::Kind::no_convergence;
  // The row added last is the one that the others leave no room for.
  const int last = std::max(daqp.n_active - 1, 0);
  outcome->blame =
      rows[static_cast<std::size_t>(daqp.n_active > 0 ? daqp.WS[last] : 0)];
  return false;
}

void LandingQp::Work::keep_multipliers() {
  const double h2 = reduction->h * reduction->h;
  const double unit = 2 / (h2 * h2 * reduction->h);
  for (int i = 0; i < daqp.n_active; ++i) {
    const auto row = static_cast<std::size_t>(daqp.WS[i]);
    active.push_back({rows[row], unit * daqp.lam_star[i] * scaling[row]});
  }
}

QpOutcome LandingQp::solve(const Reduction& reduction, const Corridor& corridor,
                           const DynamicLimitRows& limits) {
  Work& w = *work_;
  const Whitened whitened(reduction);
  QpOutcome outcome;
  outcome.kind = QpOutcome::Kind::solved;
  w.corridor = &corridor;
  w.limits = &limits;
  w.whitened = &whitened;
  w.reduction = &reduction;
  w.frames = segment_frames(limits, reduction.T);
  w.outcome = &outcome;
  w.start();
  w.scan();
  while (outcome.solved() && w.added) {
    if (++outcome.rounds > kMaxRounds) {
      outcome.kind = QpOutcome::Kind::no_convergence;
      break;
    }
    if (w.optimize()) w.scan();
  }
  outcome.u = Eigen::Map<const Matrix73>(w.daqp.u);
  if (!outcome.solved()) return outcome;
  w.keep_multipliers();
  for (std::size_t s = 0; s < kSegments; ++s) {
    outcome.jerk_cost += jerk_cost(outcome.c[s], reduction.T[s]);
  }
  return outcome;
}

const std::vector<ActiveRow>& LandingQp::active() const { return work_->active; }

}  // namespace alight
