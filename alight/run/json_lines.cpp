#include "alight/run/json_lines.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace alight {
namespace {

using Json = nlohmann::ordered_json;

Json vector3(const Vector3& v) { return Json::array({v.x(), v.y(), v.z()}); }

// A microsecond is all that a time in the log needs, and reads well.
double seconds(Time t) { return std::round(to_seconds(t) * 1e6) * 1e-6; }

}  // namespace

std::string frame_line(const FrameReport& frame, Time used_t, double us) {
  Json j;
  j["t"] = seconds(frame.t);
  j["used_t"] = seconds(used_t);
  j["tracked"] = frame.tracked;
  if (frame.tracked) {
    Eigen::Quaterniond q(frame.x.R_NB);
    if (q.w() < 0) q.coeffs() = -q.coeffs();
    j["p"] = vector3(frame.x.p_NB);
    j["q_xyzw"] = Json::array({q.x(), q.y(), q.z(), q.w()});
    j["v"] = vector3(frame.x.v_NB);
    Json cov = Json::array();
    for (int r = 0; r < 9; ++r) {
      for (int c = r; c < 9; ++c) cov.push_back(frame.cov(r, c));
    }
    j["cov"] = std::move(cov);
  }
  Json leds = Json::array();
  for (const LedUse& use : frame.leds) {
    for (int i = 0; i < kMaxLeds; ++i) {
      if (((use.observation.leds >> i) & 1) == 0) continue;
      leds.push_back({{"index", i},
                      {"u", use.observation.uv.x()},
                      {"v", use.observation.uv.y()},
                      {"nis", use.nis}});
    }
  }
  j["leds"] = std::move(leds);
  Json refused = Json::array();
  for (const RefusedBlob& blob : frame.refused) {
    refused.push_back(
        {{"u", blob.uv.x()}, {"v", blob.uv.y()}, {"reason", to_string(blob.reason)}});
  }
  j["refused"] = std::move(refused);
  j["reprojection_px"] = frame.reprojection_px;
  if (!frame.tracked) j["why_not"] = frame.why_not;
  j["us"] = us;
  return j.dump() + "\n";
}

std::string transition_line(const MissionTransition& transition, int attempts) {
  const Json j{{"t", seconds(transition.t)},
               {"state", to_string(transition.to)},
               {"reason", transition.reason},
               {"from", to_string(transition.from)},
               {"attempts", attempts}};
  return j.dump() + "\n";
}

std::string plan_line(Time t, const PlanResult& plan) {
  Json j{{"t", seconds(t)},
         {"state", "plan"},
         {"reason", plan.ok() ? "solved" : plan.reason},
         {"start", seconds(plan.start)}};
  if (plan.ok()) {
    j["durations_s"] = Json::array(
        {plan.trajectory.durations[0], plan.trajectory.durations[1]});
    j["jerk_cost"] = plan.jerk_cost;
    Json certificate = Json::array();
    for (const CertificateEntry& entry : plan.certificate) {
      certificate.push_back({{"constraint", entry.constraint}, {"margin", entry.margin}});
    }
    j["certificate"] = std::move(certificate);
  }
  j["tried"] = plan.tried;
  j["feasible"] = plan.feasible;
  return j.dump() + "\n";
}

}  // namespace alight
