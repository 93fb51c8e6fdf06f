#include <cstdio>
#include <iostream>
#include <memory>

#include "alight/io/rig_yaml.h"
#include "alight/planning/planner.h"
#include "checks.h"
#include "command.h"
#include "json.h"

using namespace alight;

namespace {

struct Options {
  std::string rig;
  std::vector<double> from;
  std::vector<double> velocity{0, 0, 0};
  double platform_speed = 0;             // m/s
  double platform_yaw_rate = 0;          // rad/s
  double platform_acceleration = 0;      // m/s^2
  double platform_yaw_acceleration = 0;  // rad/s^2
  double yaw_deg = 0;
  std::vector<double> durations;  // s
  std::string profile = "default";
  bool json = false;
};

constexpr Seconds kForecast = 32;  ///< An acceleration given goes on for that long.

Json matrix_json(const Eigen::MatrixXd& m) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < m.cols(); ++j) row.push_back(m(i, j));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json vector_json(const Eigen::VectorXd& v) {
  return std::vector<double>(v.data(), v.data() + v.size());
}

Json faces_json(const std::vector<LimitFace>& faces, bool meaning) {
  Json out = Json::array();
  for (const LimitFace& face : faces) {
    Json one = {{"n", as_json(face.n)}, {"b", face.b}};
    if (meaning) one["meaning"] = to_string(face.meaning);
    out.push_back(std::move(one));
  }
  return out;
}

Json state_json(const FlatState& state) {
  return {{"p", as_json(state.p_NB)},
          {"v", as_json(state.v_NB)},
          {"a", as_json(state.a_NB)},
          {"yaw_deg", state.yaw / kDegree}};
}

Json points_json(const Trajectory& trajectory) {
  Json all = Json::array();
  for (const auto& segment : trajectory.c) {
    Json points = Json::array();
    for (const Vector3& point : segment) points.push_back(as_json(point));
    all.push_back(std::move(points));
  }
  return all;
}

Json limits_json(const PlanDetails& plan, const PlannerConfig& config) {
  Json json = {{"speed_m_s", plan.speed_m_s},
               {"acceleration_m_s2", plan.acceleration_m_s2},
               {"polyhedron", faces_json(plan.polyhedron, false)}};
  if (config.profile == Profile::paper) return json;
  json["force"] = faces_json(plan.force, true);
  json["tilt_deg"] = config.tilt_max_deg;
  json["thrust_m_s2"] = {plan.thrust_least_m_s2, plan.thrust_most_m_s2};
  json["body_rate_rad_s"] = config.body_rate_max_deg_s * kDegree;
  json["heading_rate_rad_s"] = plan.heading_rate_rad_s;
  json["yaw_rate_rad_s"] = config.yaw_rate_max_deg_s * kDegree;
  return json;
}

Json escape_json(const Escape& escape) {
  if (!escape.exists) return nullptr;
  return {{"from_s", escape.from},
          {"commit_height_m", escape.height_m},
          {"durations_s", escape.trajectory.durations},
          {"control_points_m", points_json(escape.trajectory)},
          {"margin", number_or_null(escape.margin)}};
}

Json document(const PlanDetails& plan, const PlanRequest& request,
              const PlannerConfig& config) {
  const PlanResult& result = plan.result;
  Json json;
  json["feasible"] = result.ok();
  json["reason"] = result.reason;
  json["cost"] = result.ok() ? number_or_null(result.cost) : Json(nullptr);
  json["durations_s"] = plan.best;
  json["control_points_m"] = points_json(result.trajectory);
  json["start"] = state_json(plan.start);
  json["end"] = state_json(plan.end);
  json["halfspaces"] = Json::array();
  for (const HalfSpace& h : plan.halfspaces) {
    json["halfspaces"].push_back({{"segment", h.segment},
                                  {"a", as_json(h.a)},
                                  {"b", h.b},
                                  {"meaning", to_string(h.meaning)}});
  }
  json["limits"] = limits_json(plan, config);
  json["platform"] = {{"v_IN", as_json(plan.platform.v_IN_N)},
                      {"w_IN", as_json(plan.platform.w_IN_N)},
                      {"a_IN", as_json(plan.platform.a_IN_N)},
                      {"alpha_IN", as_json(plan.platform.alpha_IN_N)},
                      {"g_N", as_json(gravity_N(plan.platform))},
                      {"forecast", !request.forecast.nodes.empty()}};
  json["certificate"] = Json::array();
  for (const CertificateEntry& entry : result.certificate) {
    json["certificate"].push_back(
        {{"constraint", entry.constraint}, {"margin", number_or_null(entry.margin)}});
  }
  json["qp"] = {{"P", matrix_json(plan.qp.P)}, {"q", vector_json(plan.qp.q)},
                {"A", matrix_json(plan.qp.A)}, {"b", vector_json(plan.qp.b)},
                {"G", matrix_json(plan.qp.G)}, {"h", vector_json(plan.qp.h)}};
  json["samples"] = {{"tried", result.tried},
                     {"feasible", result.feasible},
                     {"best", plan.best},
                     {"durations_s", plan.samples},
                     {"wide_durations_s", plan.wide_samples}};
  json["escape"] = escape_json(result.escape);
  return json;
}

void print(const PlanDetails& plan) {
  const PlanResult& result = plan.result;
  std::printf("landing in %.2f + %.2f s, jerk cost %.4g m^2/s^5\n", plan.best[0],
              plan.best[1], result.jerk_cost);
  std::printf("%d of %d time samples feasible\n", result.feasible, result.tried);
  for (const CertificateEntry& entry : result.certificate) {
    std::printf("  %-20s margin %9.4f\n", entry.constraint, entry.margin);
  }
  if (result.escape.exists) {
    std::printf("a way back until %.2f s: commit height %.3f m\n", result.escape.from,
                result.escape.height_m);
  } else {
    std::printf("no way back\n");
  }
}

Result<void> run(const Options& options) {
  const auto rig = load_rig(options.rig);
  if (!rig) return fail(rig.error());
  const auto planner = Planner::create(
      options.profile == "paper" ? PlannerConfig::paper() : PlannerConfig{}, *rig);
  if (!planner) return fail(planner.error());

  PlanRequest request;
  request.from.p_NB = Vector3(options.from[0], options.from[1], options.from[2]);
  request.from.v_NB =
      Vector3(options.velocity[0], options.velocity[1], options.velocity[2]);
  request.platform.v_IN_N = Vector3(options.platform_speed, 0, 0);
  request.platform.w_IN_N = Vector3(0, 0, options.platform_yaw_rate);
  // Steady driving: what accelerates the platform is its turning alone.
  request.platform.a_IN_N = request.platform.w_IN_N.cross(request.platform.v_IN_N);
  request.from.yaw = options.yaw_deg * kDegree;
  if (options.platform_acceleration != 0 || options.platform_yaw_acceleration != 0) {
    request.platform.a_IN_N.x() += options.platform_acceleration;
    request.platform.alpha_IN_N.z() = options.platform_yaw_acceleration;
    request.forecast = constant_acceleration(request.platform, kForecast);
  }
  if (!options.durations.empty()) {
    request.durations = {options.durations[0], options.durations[1]};
  }

  const auto plan = planner->explain(request);
  if (!plan) return fail(plan.error());
  if (options.json) {
    std::cout << document(*plan, request, planner->config()).dump(2) << '\n';
  } else if (plan->result.ok()) {
    print(*plan);
  }
  if (!plan->result.ok()) {
    return fail(Fault::infeasible,
                std::string("no landing from --from: ") + plan->result.reason);
  }
  return {};
}

}  // namespace

void add_plan(CLI::App& app, Job& job) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("plan", "One landing trajectory; everything in N");
  command->add_option("--rig", options->rig, "Rig file")->required();
  command->add_option("--from", options->from, "Where the drone is: x,y,z in m")
      ->required()
      ->delimiter(',')
      ->expected(3)
      ->check(finite());
  command
      ->add_option("--velocity", options->velocity,
                   "v_NB: vx,vy,vz in m/s, 0,0,0 if absent")
      ->delimiter(',')
      ->expected(3)
      ->check(finite());
  command->add_option("--platform-speed", options->platform_speed, "m/s, along x of N")
      ->check(finite());
  command->add_option("--platform-yaw-rate", options->platform_yaw_rate, "rad/s")
      ->check(finite());
  command
      ->add_option("--platform-acceleration", options->platform_acceleration,
                   "m/s^2, along x of N, from now on (default profile)")
      ->check(finite());
  command
      ->add_option("--platform-yaw-acceleration", options->platform_yaw_acceleration,
                   "rad/s^2 (default profile)")
      ->check(finite());
  command->add_option("--yaw-deg", options->yaw_deg, "Heading of the drone in N, deg")
      ->check(finite());
  command
      ->add_option("--durations", options->durations,
                   "Of the segments, t1,t2 in s: solve once; else they are sampled")
      ->delimiter(',')
      ->expected(2)
      ->check(within(0.01, 1000));
  command->add_option("--profile", options->profile, "default or paper")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  command->add_flag("--json", options->json, "One JSON document");
  command->callback([options, &job] { job = [options] { return run(*options); }; });
}
