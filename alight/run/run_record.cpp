#include "alight/run/run_record.h"

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "alight/io/files.h"
#include "alight/io/pose_log.h"
#include "alight/io/rig_yaml.h"
#include "alight/run/json_lines.h"
#include "alight/run/run_pictures.h"
#include "alight/run/scenario_yaml.h"

namespace alight {
namespace {

using Json = nlohmann::ordered_json;

Json number(double v) { return std::isfinite(v) ? Json(v) : Json(nullptr); }

// The picture shown is one of the approach, where all LEDs are apart.
constexpr double kShownAbove = 0.3;

}  // namespace

std::string result_json(const LandingResult& r) {
  Json j;
  j["outcome"] = to_string(r.outcome);
  j["reason"] = r.reason;
  j["attempts"] = r.attempts;
  j["touchdown"] = nullptr;
  if (r.touchdown) {
    j["touchdown"] = {{"t_s", number(r.touchdown->t_s)},
                      {"error_m", number(r.touchdown->error_m)},
                      {"relative_speed_m_s", number(r.touchdown->relative_speed_m_s)},
                      {"tilt_deg", number(r.touchdown->tilt_deg)},
                      {"yaw_error_deg", number(r.touchdown->yaw_error_deg)}};
  }
  j["lost_link"] = nullptr;
  if (r.lost_link) {
    j["lost_link"] = {{"drift_m", number(r.lost_link->drift_m)},
                      {"sink_m_s", number(r.lost_link->sink_m_s)},
                      {"helpless", r.lost_link->helpless}};
  }
  j["tracking_rmse_m"] = number(r.tracking_rmse_m);
  j["follow_rmse_m"] = number(r.follow_rmse_m);
  j["estimate"] = {{"position_rmse_m", number(r.estimate.position_rmse_m)},
                   {"rotation_rmse_deg", number(r.estimate.rotation_rmse_deg)},
                   {"velocity_rmse_m_s", number(r.estimate.velocity_rmse_m_s)},
                   {"tracked_fraction", number(r.estimate.tracked_fraction)},
                   {"nees_mean", number(r.estimate.nees_mean)}};
  j["platform_speed_max_m_s"] = number(r.platform_speed_max_m_s);
  j["drone_speed_max_m_s"] = number(r.drone_speed_max_m_s);
  j["simulated_s"] = number(r.simulated_s);
  j["events_refused"] = r.events_refused;
  j["realtime_factor"] = number(r.realtime_factor);
  Json timing = Json::object();
  for (const auto& [stage, us] : r.timing_us) {
    timing[stage] = {
        {"p50", number(us.p50)}, {"p99", number(us.p99)}, {"max", number(us.max)}};
  }
  j["timing_us"] = std::move(timing);
  return j.dump(2) + "\n";
}

struct RunRecord::Parts {
  LandingRunOptions options;
  Rig rig_true;
  PoseLog truth, estimate, predicted, reference;
  std::string frames, events, trace;
  RunTracks tracks;
  Image last_picture;
  ShownFrame shown;
  Time now = 0;
  MissionState state = MissionState::idle;
  double reference_z = 0;

  /// The best picture is of the approach; until then, and if there never is one, the
  /// first in which the LEDs were found, or else the first.
  bool picture_wanted() const {
    return !shown.report.tracked ||
           (state == MissionState::land && reference_z > kShownAbove);
  }
};

RunRecord::RunRecord(const LandingRunOptions& options)
    : parts_(std::make_unique<Parts>()) {
  parts_->options = options;
}
RunRecord::~RunRecord() = default;

void RunRecord::on_world(const World& world) {
  parts_->rig_true = world.true_rig().rig;
}

void RunRecord::on_picture(const CameraFrame& frame) {
  if (parts_->picture_wanted()) parts_->last_picture = copy_of(frame.color);
}

void RunRecord::on_frame(const FrameReport& frame, const TruthState& truth, double us) {
  Parts& p = *parts_;
  p.truth.emplace_back(truth.t, truth.X_NB);
  if (frame.tracked) p.estimate.emplace_back(frame.t, frame.x.X_NB());
  p.frames += frame_line(frame, p.now, us);
  if (p.picture_wanted() && (frame.tracked || p.shown.image.empty()) &&
      !p.last_picture.empty()) {
    p.shown.image = p.last_picture;
    p.shown.report = frame;
  }
}

void RunRecord::on_plan(const PlanRequest&, const PlanResult& result) {
  parts_->events += plan_line(parts_->now, result);
}

void RunRecord::on_step(const Output& out, const TruthState& truth, double) {
  Parts& p = *parts_;
  p.now = out.trace.t;
  p.state = out.mission.state;
  p.reference_z = out.trace.reference.p_NB.z();
  for (const MissionTransition& change : out.transitions) {
    p.events += transition_line(change, out.mission.attempts);
  }
  const auto& trace = out.trace;
  if (trace.estimate_valid) p.predicted.emplace_back(trace.t, trace.predicted.X_NB());
  if (trace.reference_valid) {
    p.reference.emplace_back(
        trace.t, make_pose(from_rpy(0, 0, trace.reference.yaw), trace.reference.p_NB));
  }
  p.trace += trace_line(out);
  p.tracks.t.push_back(to_seconds(trace.t));
  p.tracks.X_IN.push_back(truth.platform.X_IN);
  p.tracks.X_NB_true.push_back(truth.X_NB);
  p.tracks.X_NB_predicted.push_back(trace.predicted.X_NB());
  p.tracks.predicted_valid.push_back(trace.estimate_valid);
  p.tracks.reference.push_back(trace.reference);
  p.tracks.reference_valid.push_back(trace.reference_valid);
  p.tracks.state.push_back(out.mission.state);
}

Result<std::vector<std::string>> RunRecord::save(const std::string& folder,
                                                 const LandingResult& result) const {
  const Parts& p = *parts_;
  // The folder is whole without the file that the drive came from.
  Scenario scenario = p.options.scenario;
  const std::string drive_text = std::move(scenario.platform.file_text);
  if (!scenario.platform.file.empty()) {
    scenario.platform.file =
        "drive" + std::filesystem::path(scenario.platform.file).extension().string();
  }
  if (auto good = make_folder(folder); !good) return fail(good.error());
  // That of an earlier run would make a folder written in part look whole.
  std::error_code none_there;
  std::filesystem::remove(folder + "/result.json", none_there);
  const std::pair<const char*, std::string> files[] = {
      {"scenario.yaml", scenario_text(scenario)},
      {"rig.yaml", rig_text(p.options.rig) + safety_text(p.options.safety)},
      {"rig_true.yaml", rig_text(p.rig_true)},
      {"truth.tum", tum_text(p.truth)},
      {"estimate.tum", tum_text(p.estimate)},
      {"predicted.tum", tum_text(p.predicted)},
      {"reference.tum", tum_text(p.reference)},
      {"frames.jsonl", p.frames},
      {"events.jsonl", p.events},
      {"trace.csv", trace_header() + p.trace},
  };
  for (const auto& [name, text] : files) {
    if (auto good = write_file(folder + "/" + name, text); !good) {
      return fail(good.error());
    }
  }
  if (!drive_text.empty()) {
    const std::string name = folder + "/" + scenario.platform.file;
    if (auto good = write_file(name, drive_text); !good) return fail(good.error());
  }
  auto pictures = save_run_pictures(folder, p.tracks, p.shown, p.options.rig);
  if (!pictures) return pictures;
  // Last: a folder with a result is complete.
  if (auto good = write_file(folder + "/result.json", result_json(result)); !good) {
    return fail(good.error());
  }
  return pictures;
}

}  // namespace alight
