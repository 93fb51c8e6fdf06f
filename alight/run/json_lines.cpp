#include "alight/run/json_lines.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "alight/io/text.h"

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
  j["reprojection_px"] = frame.tracked ? Json(frame.reprojection_px) : Json(nullptr);
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
    j["durations_s"] =
        Json::array({plan.trajectory.durations[0], plan.trajectory.durations[1]});
    j["jerk_cost"] = plan.jerk_cost;
    Json certificate = Json::array();
    for (const CertificateEntry& entry : plan.certificate) {
      certificate.push_back(
          {{"constraint", entry.constraint}, {"margin", entry.margin}});
    }
    j["certificate"] = std::move(certificate);
  }
  j["tried"] = plan.tried;
  j["feasible"] = plan.feasible;
  return j.dump() + "\n";
}

std::string trace_header() {
  return "t,state,ref_x,ref_y,ref_z,ref_vx,ref_vy,ref_vz,x,y,z,vx,vy,vz,dx,dy,dz,"
         "platform_v,platform_w,sent_roll_deg,sent_pitch_deg,sent_yaw_deg,sent_thrust,"
         "heading_offset_deg,link_delay_ms\n";
}

std::string trace_line(const Output& out) {
  const Trace& t = out.trace;
  const Matrix3 R = out.setpoint.q_IB.toRotationMatrix();
  std::string line = number_text(seconds(t.t)) + "," + to_string(out.mission.state);
  const auto add = [&](double value) {
    line += "," + number_text(std::round(value * 1e6) * 1e-6);
  };
  const auto add3 = [&](const Vector3& v) {
    for (int i = 0; i < 3; ++i) add(v[i]);
  };
  add3(t.reference.p_NB);
  add3(t.reference.v_NB);
  add3(t.predicted.p_NB);
  add3(t.predicted.v_NB);
  add3(t.disturbance_N);
  add(t.platform.v_IN_N.x());
  add(t.platform.w_IN_N.z());
  add(std::atan2(R(2, 1), R(2, 2)) / kDegree);
  add(-std::asin(std::clamp(R(2, 0), -1.0, 1.0)) / kDegree);
  add(yaw_of(R) / kDegree);
  add(out.setpoint.thrust);
  add(t.heading_offset / kDegree);
  add(t.link_delay_ms);
  return line + "\n";
}

}  // namespace alight
