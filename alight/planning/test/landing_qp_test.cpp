#include "alight/planning/landing_qp.h"

#include <gtest/gtest.h>

#include "alight/base/rng.h"

extern "C" {
#include "api.h"
}

namespace alight {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct Reference {
  int flag = 0;
  Eigen::VectorXd x;
};

/// minimize x'Px/2 + q'x, Gx <= h, all rows at once through the solver's front door.
Reference reference_solve(RowMajor P, Eigen::VectorXd q, RowMajor G,
                          Eigen::VectorXd h) {
  DAQPSettings settings;
  daqp_default_settings(&settings);
  settings.primal_tol = 1e-9;
  Eigen::VectorXd lower = Eigen::VectorXd::Constant(h.size(), -1e30);
  std::vector<int> sense(static_cast<std::size_t>(h.size()), 0);
  DAQPProblem problem{};
  problem.n = static_cast<int>(q.size());
  problem.m = static_cast<int>(h.size());
  problem.H = P.data();
  problem.f = q.data();
  problem.A = G.data();
  problem.bupper = h.data();
  problem.blower = lower.data();
  problem.sense = sense.data();
  Reference out;
  out.x.setZero(q.size());
  Eigen::VectorXd lam(h.size());
  DAQPResult result{};
  result.x = out.x.data();
  result.lam = lam.data();
  daqp_quadprog(&result, &problem, &settings);
  out.flag = result.exitflag;
  return out;
}

/// Least t with Gx <= h + t (all but for a trace of regularization).
double least_violation(const PlanQp& qp) {
  const Eigen::Index n = kVariables;
  RowMajor P = 1e-7 * RowMajor::Identity(n + 1, n + 1);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(n + 1);
  q[n] = 1;
  RowMajor G(qp.G.rows(), n + 1);
  G << qp.G, -Eigen::VectorXd::Ones(qp.G.rows());
  const Reference found = reference_solve(P, q, G, qp.h);
  EXPECT_GT(found.flag, 0);
  return (qp.G * found.x.head(n) - qp.h).maxCoeff();
}

PlanRequest instance(unsigned seed) {
  Rng rng(seed);
  PlanRequest request;
  request.from.p_NB = {rng.uniform(-1.8, -0.7), rng.uniform(-0.5, 0.5),
                       rng.uniform(0.4, 1.0)};
  request.from.v_NB = {rng.uniform(-1, 1), rng.uniform(-0.5, 0.5),
                       rng.uniform(-0.5, 0.5)};
  request.from.a_NB = {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)};
  request.platform.v_IN_N = {rng.uniform(0, 2), 0, 0};
  request.platform.w_IN_N = {0, 0, rng.uniform(-0.8, 0.8)};
  request.platform.a_IN_N = request.platform.w_IN_N.cross(request.platform.v_IN_N);
  request.durations = {rng.uniform(0.4, 3), rng.uniform(0.4, 2)};
  return request;
}

class LandingQpProperty : public testing::TestWithParam<bool> {
 protected:
  Planner planner() const {
    return *Planner::create(GetParam() ? PlannerConfig::paper() : PlannerConfig{},
                            alan_rig());
  }
};

TEST_P(LandingQpProperty, AgreesWithAReferenceOnFeasibilityAndCost) {
  const Planner planner = this->planner();
  int solved = 0;
  int infeasible = 0;
  int constrained = 0;
  for (unsigned seed = 0; seed < 250; ++seed) {
    const auto details = planner.explain(instance(seed));
    ASSERT_TRUE(details);
    const PlanQp& qp = details->qp;
    if (qp.G.size() == 0) continue;  // The start is outside: nothing to solve.
    const Reference reference = reference_solve(qp.P, qp.q, qp.G, qp.h);
    if (qp.x.size() == 0) {
      ++infeasible;
      EXPECT_LE(reference.flag, 0) << seed << ' ' << details->result.reason;
      EXPECT_GT(least_violation(qp), 1e-8) << seed << ' ' << details->result.reason;
      EXPECT_STRNE(details->result.reason, "the solver did not converge") << seed;
      continue;
    }
    ++solved;
    ASSERT_GT(reference.flag, 0) << seed;
    const auto cost = [&](const Eigen::VectorXd& x) {
      return 0.5 * x.dot(qp.P * x) + qp.q.dot(x);
    };
    const double scale = 1 + details->result.jerk_cost;
    EXPECT_NEAR(cost(qp.x), cost(reference.x), 1e-6 * scale) << seed;
    if (!details->result.ok()) continue;
    EXPECT_NEAR(cost(qp.x), details->result.cost,
                1e-7 * (scale + std::abs(qp.constant)));
    EXPECT_NEAR(details->result.cost + qp.constant, details->result.jerk_cost,
                1e-7 * (scale + std::abs(qp.constant)));
    constrained += qp.z.maxCoeff() > 0;
  }
  EXPECT_GT(solved, 40);
  EXPECT_GT(infeasible, 20);
  EXPECT_GT(constrained, 20);
}

TEST_P(LandingQpProperty, SolutionsMeetTheKktConditions) {
  const Planner planner = this->planner();
  int tested = 0;
  for (unsigned seed = 1000; seed < 1300; ++seed) {
    const auto details = planner.explain(instance(seed));
    ASSERT_TRUE(details);
    const PlanQp& qp = details->qp;
    if (qp.x.size() == 0) continue;
    ++tested;
    const Eigen::VectorXd slack = qp.h - qp.G * qp.x;
    const Eigen::VectorXd push = qp.G.transpose() * qp.z;
    const double scale = 1 + (qp.P * qp.x).cwiseAbs().maxCoeff() +
                         qp.q.cwiseAbs().maxCoeff() + push.cwiseAbs().maxCoeff();
    EXPECT_LT((qp.P * qp.x + qp.q + push).cwiseAbs().maxCoeff(), 1e-8 * scale);
    EXPECT_GT(slack.minCoeff(), -2e-7) << seed;
    EXPECT_GE(qp.z.minCoeff(), -1e-9 * scale);
    EXPECT_LT(qp.z.cwiseProduct(slack).cwiseAbs().maxCoeff(), 1e-6 * scale);
  }
  EXPECT_GT(tested, 50);
}

TEST_P(LandingQpProperty, ASolveLeavesNothingBehind) {
  const PlannerConfig config = planner().config();
  const Rig rig = alan_rig();
  const FlatState end = landing_end(config, rig);
  LandingQp reused;
  for (unsigned seed = 0; seed < 60; ++seed) {
    const PlanRequest request = instance(seed);
    const Corridor corridor = build_corridor(config, rig, request.from, end);
    const auto limits =
        make_limits(config, rig, make_polyhedron(config.profile), request.platform, 1);
    const Reduction reduction(request.from, end, request.durations);
    LandingQp fresh;
    const QpOutcome a = reused.solve(reduction, corridor, limits);
    const QpOutcome b = fresh.solve(reduction, corridor, limits);
    ASSERT_EQ(a.kind, b.kind);
    if (a.solved()) {
      EXPECT_EQ(a.u, b.u);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Profiles, LandingQpProperty, testing::Bool());

}  // namespace
}  // namespace alight
