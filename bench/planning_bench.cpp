#include <memory>

#include "alight/base/rng.h"
#include "alight/planning/time_allocation.h"
#include "bench/flight.h"

extern "C" {
#include "api.h"
}

namespace alight::bench {
namespace {

PlannerConfig config_of(bool paper) {
  return paper ? PlannerConfig::paper() : PlannerConfig{};
}

/// Landings begun behind a pad that drives and turns.
std::vector<PlanRequest> requests() {
  Rng rng(5);
  std::vector<PlanRequest> all;
  for (int i = 0; i < 32; ++i) {
    PlanRequest request;
    request.from.p_NB = Vector3(rng.uniform(-1.3, -0.9), rng.uniform(-0.15, 0.15),
                                rng.uniform(0.55, 0.75));
    request.from.v_NB = 0.05 * Vector3(rng.normal(), rng.normal(), rng.normal());
    request.platform.v_IN_N = Vector3(rng.uniform(0, 0.9), 0, 0);
    request.platform.w_IN_N = Vector3(0, 0, rng.uniform(-0.6, 0.6));
    all.push_back(request);
  }
  return all;
}

/// One landing problem, ready to be solved.
struct Problem {
  Problem(const PlannerConfig& c, const Rig& rig, const PlanRequest& r)
      : config(c), request(r), end(landing_end(c, rig)) {
    corridor = build_corridor(config, rig, request.from, end);
    const LimitPolyhedron faces = make_polyhedron(config.profile);
    limits = make_limits(config, rig, faces, request.platform, 1);
    tightened = make_limits(config, rig, faces, request.platform, config.tightening);
    samples = even_samples(config, time_range(config, rig, request, end));
    LandingQp qp;
    best = allocate(qp).best;
  }
  Allocation allocate(LandingQp& qp) const {
    const AllocationTask task{.config = config,
                              .start = request.from,
                              .end = end,
                              .corridor = corridor,
                              .limits = tightened};
    return allocate_time(task, samples, qp);
  }
  bool feasible() const { return best[0] > 0; }

  PlannerConfig config;
  PlanRequest request;
  FlatState end;
  Corridor corridor;
  DynamicLimitRows limits, tightened;
  TimeSamples samples;
  std::array<Seconds, kSegments> best{};
};

std::vector<std::unique_ptr<Problem>> problems(bool paper) {
  std::vector<std::unique_ptr<Problem>> all;
  for (const PlanRequest& request : requests()) {
    auto problem = std::make_unique<Problem>(config_of(paper), alan_rig(), request);
    if (problem->feasible()) all.push_back(std::move(problem));
  }
  return all;
}

/// One QP with the rows of a profile, from durations to control points.
void BM_LandingQp(benchmark::State& state) {
  const auto all = problems(state.range(0) == 1);
  if (all.empty()) return state.SkipWithError("no feasible landing");
  LandingQp qp;
  Laps laps;
  std::size_t i = 0, solved = 0;
  for (auto _ : state) {
    const Problem& p = *all[i++ % all.size()];
    laps.time([&] {
      const Reduction reduction(p.request.from, p.end, p.best);
      solved += qp.solve(reduction, p.corridor, p.limits).solved();
    });
  }
  laps.report(state);
  state.counters["problems"] = static_cast<double>(all.size());
  state.counters["solved"] = benchmark::Counter(static_cast<double>(solved),
                                                benchmark::Counter::kAvgIterations);
}
BENCHMARK(BM_LandingQp)
    ->ArgName("paper")
    ->Arg(1)
    ->Arg(0)
    ->Unit(benchmark::kMicrosecond);

/// The same QPs, all their rows, handed to DAQP by its front door: the same matrices as
/// `plan --json` prints. `setup` counts its factorization too. Budget: ours takes at
/// most 1.5 times its p99.
void BM_DaqpOnTheSameMatrices(benchmark::State& state) {
  using RowMajor =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  struct Direct {
    RowMajor P, G;
    Eigen::VectorXd q, h, lower, x, lam;
    std::vector<int> sense;
  };
  const bool paper = state.range(0) == 1;
  const bool setup = state.range(1) == 1;
  PlannerConfig config = config_of(paper);
  config.view_wish_px = 0;
  const auto planner = Planner::create(config, alan_rig());
  if (!planner) return state.SkipWithError("no planner");
  std::vector<Direct> all;
  for (const auto& problem : problems(paper)) {
    PlanRequest request = problem->request;
    request.durations = problem->best;
    const auto details = planner->explain(request);
    if (!details || !details->result.ok()) continue;
    Direct d;
    d.P = details->qp.P;
    d.G = details->qp.G;
    d.q = details->qp.q;
    d.h = details->qp.h;
    d.lower = Eigen::VectorXd::Constant(d.h.size(), -1e30);
    d.x.setZero(d.q.size());
    d.lam.setZero(d.h.size());
    d.sense.assign(static_cast<std::size_t>(d.h.size()), 0);
    all.push_back(std::move(d));
  }
  if (all.empty()) return state.SkipWithError("no feasible landing");
  DAQPSettings settings;
  daqp_default_settings(&settings);
  Laps laps;
  std::size_t i = 0, solved = 0;
  for (auto _ : state) {
    Direct& d = all[i++ % all.size()];
    std::fill(d.sense.begin(), d.sense.end(), 0);
    DAQPProblem problem{};
    problem.n = static_cast<int>(d.q.size());
    problem.m = static_cast<int>(d.h.size());
    problem.H = d.P.data();
    problem.f = d.q.data();
    problem.A = d.G.data();
    problem.bupper = d.h.data();
    problem.blower = d.lower.data();
    problem.sense = d.sense.data();
    DAQPResult result{};
    result.x = d.x.data();
    result.lam = d.lam.data();
    DAQPWorkspace work{};
    work.settings = nullptr;
    const auto prepare = [&] {
      setup_daqp(&problem, &work, nullptr);
      *work.settings = settings;
    };
    const auto solve = [&] { daqp_solve(&result, &work); };
    if (setup) {
      laps.time([&] {
        prepare();
        solve();
      });
    } else {
      prepare();
      laps.time(solve);
    }
    solved += result.exitflag > 0;
    free_daqp_workspace(&work);
    free_daqp_ldp(&work);
  }
  laps.report(state);
  state.counters["rows"] = static_cast<double>(all.front().h.size());
  state.counters["solved"] = benchmark::Counter(static_cast<double>(solved),
                                                benchmark::Counter::kAvgIterations);
}
BENCHMARK(BM_DaqpOnTheSameMatrices)
    ->ArgNames({"paper", "setup"})
    ->Args({1, 0})
    ->Args({1, 1})
    ->Args({0, 0})
    ->Args({0, 1})
    ->Unit(benchmark::kMicrosecond);

/// 31 x 31 segment times. Budget: 10 ms with the paper's rows, 25 ms with all.
void BM_TimeAllocation(benchmark::State& state) {
  const auto all = problems(state.range(0) == 1);
  if (all.empty()) return state.SkipWithError("no feasible landing");
  LandingQp qp;
  Laps laps;
  std::size_t i = 0;
  int tried = 0, feasible = 0;
  for (auto _ : state) {
    const Problem& p = *all[i++ % all.size()];
    laps.time([&] {
      const Allocation found = p.allocate(qp);
      tried += found.tried;
      feasible += found.feasible;
    });
  }
  laps.report(state);
  const auto average = benchmark::Counter::kAvgIterations;
  state.counters["tried"] = {static_cast<double>(tried), average};
  state.counters["feasible"] = {static_cast<double>(feasible), average};
}
BENCHMARK(BM_TimeAllocation)
    ->ArgName("paper")
    ->Arg(1)
    ->Arg(0)
    ->Unit(benchmark::kMillisecond);

/// A whole plan with its certificate, the segment times sampled.
void BM_Plan(benchmark::State& state) {
  const auto planner = Planner::create(config_of(state.range(0) == 1), alan_rig());
  if (!planner) return state.SkipWithError("no planner");
  const auto all = requests();
  Laps laps;
  std::size_t i = 0, solved = 0;
  for (auto _ : state) {
    laps.time([&] { solved += planner->plan(all[i++ % all.size()]).ok(); });
  }
  laps.report(state);
  state.counters["solved"] = benchmark::Counter(static_cast<double>(solved),
                                                benchmark::Counter::kAvgIterations);
}
BENCHMARK(BM_Plan)->ArgName("paper")->Arg(1)->Arg(0)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace alight::bench
