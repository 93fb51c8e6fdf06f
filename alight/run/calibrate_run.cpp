#include "alight/run/calibrate_run.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "alight/calibration/flight_observer.h"
#include "alight/calibration/led_guess.h"
#include "alight/io/image_source.h"
#include "alight/io/json_text.h"
#include "alight/peers/peer.h"

namespace alight {
namespace {

using Json = nlohmann::ordered_json;

// What an earlier pass leaves of the LEDs' errors, at least.
constexpr double kLedSdLaterPass = 0.001;
// With a vaguer idea of its LEDs the search takes other lights for the drone.
constexpr double kLedSdToSearch = 0.003;
// A later pass that sees less has lost LEDs that the earlier one had.
constexpr double kSeesAsMuch = 0.9;
// Errors of a tag's corners that more pictures of it do not average out.
constexpr double kTagPicturesMost = 4;

/// Every picture of a source; the number of them.
Result<int> each_picture(const std::string& path, const Rig& rig,
                         const std::function<void(const SourceFrame&)>& look) {
  auto source = ImageSource::open(path, rig);
  if (!source) return fail(source.error());
  SourceFrame picture;
  int count = 0;
  while (true) {
    const auto more = source->next(picture);
    if (!more) return fail(more.error());
    if (!*more) return count;
    look(picture);
    ++count;
  }
}

Result<FlightObserver> observe(const std::string& source, const Rig& rig,
                               const FlightObserverConfig& config, bool depth) {
  auto observer = FlightObserver::create(config, rig);
  if (!observer) return observer;
  bool any_depth = false;
  const auto done = each_picture(source, rig, [&](const SourceFrame& picture) {
    any_depth = any_depth || !picture.depth.empty();
    CameraFrame frame;
    frame.captured = picture.t;
    frame.received = picture.t;
    frame.color = picture.color.view();
    if (depth) frame.depth = picture.depth.view();
    observer->look(frame);
  });
  if (!done) return fail(done.error());
  if (depth && !any_depth) {
    return fail(Fault::invalid_input,
                source +
                    ": has no depth pictures; name them in the column depth_file of "
                    "frames.csv or leave out --depth");
  }
  return observer;
}

Json list(const Vector3& v, double unit = 1) {
  return {v.x() * unit, v.y() * unit, v.z() * unit};
}

Json number_or_null(double value) {
  if (std::isfinite(value)) return value;
  return nullptr;
}

/// The pose of the tag as the camera sees it, over all pictures.
Result<StandingView> tag_view(const CalibrateMountOptions& options,
                              CalibrateMountResult& result) {
  Rig seen_by = options.rig;
  seen_by.camera.X_NC = Pose::Identity();
  seen_by.tag =
      Tag{options.tag->family, options.tag->id, options.tag->size_m, Pose::Identity()};
  const auto method = options.tag->family == TagFamily::tag36h11 ? PeerMethod::apriltag
                                                                 : PeerMethod::aruco;
  auto peer = create_peer(method, seen_by);
  if (!peer) return fail(peer.error());
  const std::string& source = options.sources.front();
  std::vector<PeerReport> reports;
  const auto pictures = each_picture(source, seen_by, [&](const SourceFrame& picture) {
    const auto report = (*peer)->fuse(picture.t, picture.color.view(), {});
    if (report.tracked) reports.push_back(report);
  });
  if (!pictures) return fail(pictures.error());
  result.pictures = *pictures;
  result.seen = static_cast<int>(reports.size());
  if (reports.empty()) {
    return fail(Fault::too_few_points,
                source +
                    ": the tag is in no picture; see its family, number (--tag-id) "
                    "and light, and that its white border is free");
  }
  const auto n = static_cast<double>(reports.size());
  Vector3 p = Vector3::Zero(), turn = Vector3::Zero();
  const Matrix3 R_0 = reports.front().X_NB.linear();
  Matrix6 cov = Matrix6::Zero();
  for (const PeerReport& report : reports) {
    p += report.X_NB.translation() / n;
    turn += so3_log(R_0.transpose() * report.X_NB.linear()) / n;
    cov += report.cov / n;
  }
  double apart = 0;
  for (const PeerReport& report : reports) {
    apart += (report.X_NB.translation() - p).squaredNorm() / n;
  }
  if (std::sqrt(apart) > 0.02 + 3 * std::sqrt(cov.topLeftCorner<3, 3>().trace())) {
    return fail(Fault::degenerate, source + ": the tag moves; record it at rest");
  }
  StandingView view;
  view.X_CK = make_pose(R_0 * so3_exp(turn), p);
  view.cov = cov / std::min(n, kTagPicturesMost);
  view.X_NK = options.tag->X_NT;
  return view;
}

bool same(const Constellation& a, const Constellation& b) {
  for (int i = 0; i < a.size(); ++i) {
    if (a.p_BL(i) != b.p_BL(i)) return false;
  }
  return true;
}

Result<std::vector<StandingView>> parked_views(const CalibrateMountOptions& options,
                                               CalibrateMountResult& result) {
  std::vector<StandingView> views;
  for (std::size_t k = 0; k < options.sources.size(); ++k) {
    FlightObserverConfig config;
    config.led_sd_m = std::max(options.led_sd_m, kLedSdLaterPass);
    config.still_px = 0;  // at rest, every picture counts
    const auto observer = observe(options.sources[k], options.rig, config, false);
    if (!observer) return fail(observer.error());
    result.pictures += observer->pictures();
    result.seen += observer->seen();
    const double heading = options.headings_deg.empty() ? 0 : options.headings_deg[k];
    const auto view =
        parked_view(options.rig, observer->frames(), options.led_sd_m, heading);
    if (!view) {
      return fail(view.error().fault, options.sources[k] + ": " + view.error().detail);
    }
    views.push_back(*view);
  }
  return views;
}

}  // namespace

Result<CalibrateFlightResult> calibrate_flight(const CalibrateFlightOptions& options) {
  if (auto good = options.rig.validate(); !good) return fail(good.error());
  if (auto good = distances_hold(options.config.adjustment, options.rig.leds); !good) {
    return fail(good.error());
  }
  CalibrateFlightResult result;
  result.rig = options.rig;
  Rig rig = options.rig;
  FlightObserverConfig observing;
  observing.led_sd_m = std::min(options.config.adjustment.led_sd_m, kLedSdToSearch);
  bool found = false;
  for (int pass = 0; pass < options.passes; ++pass) {
    const auto observer =
        observe(options.source, rig, observing, options.config.adjustment.use_depth);
    if (!observer) return fail(observer.error());
    if (pass == 0) {
      // Single pictures mistake LEDs for each other where the rig file is far off.
      const auto guess = guess_leds(options.config.adjustment, rig.camera, rig.leds,
                                    observer->tracks());
      if (guess) {
        rig.leds = named_nearest(guess->leds, options.rig.leds);
        if (guess->lights == rig.leds.size()) {
          observing.led_sd_m = std::min(observing.led_sd_m, kLedSdLaterPass);
        }
        continue;
      }
    }
    const auto fit_with = [&](const ConstellationConfig& config) {
      return calibrate_constellation(config, options.rig.camera, options.rig.leds,
                                     rig.leds, observer->frames());
    };
    const auto fit = fit_with(options.config);
    const bool last = pass + 1 == options.passes;
    if (!fit && last && !found) {
      return fail(fit.error().fault, fit.error().fault == Fault::invalid_config
                                         ? fit.error().detail
                                         : options.source + ": " + fit.error().detail);
    }
    const bool misnamed =
        fit && !same(named_nearest(fit->leds, options.rig.leds), fit->leds);
    if (misnamed && last && !found) {
      return fail(Fault::degenerate,
                  options.source +
                      ": LEDs were taken for each other: they are off by as much as "
                      "they stand apart; measure them once more, or give them colours");
    }
    if (fit && !misnamed &&
        (!found || fit->observations >= kSeesAsMuch * result.fit.observations)) {
      found = true;
      result.fit = *fit;
      result.rig.leds = fit->leds;
      result.rig.led_frame = fit->whole();
      result.pictures = observer->pictures();
      result.seen = observer->seen();
    }
    // What is too weak after the first pass may be good enough after the second.
    ConstellationConfig lenient = options.config;
    lenient.led_sd_max_m = 1;
    lenient.alone_min = 0;
    const auto next = fit ? fit : fit_with(lenient);
    if (next) {
      rig.leds = named_nearest(next->leds, options.rig.leds);
      observing.led_sd_m = std::min(observing.led_sd_m, kLedSdLaterPass);
    }
  }
  return result;
}

Result<CalibrateLensResult> calibrate_lens(const CalibrateLensOptions& options) {
  if (auto good = options.rig.validate(); !good) return fail(good.error());
  if (auto good = options.board.validate(); !good) return fail(good.error());
  CalibrateLensResult result;
  result.rig = options.rig;
  BoardViews views(options.config);
  const auto pictures =
      each_picture(options.source, options.rig, [&](const SourceFrame& picture) {
        const auto view = find_board(options.board, picture.color.view());
        if (!view) return;
        ++result.seen;
        views.add(*view);
      });
  if (!pictures) return fail(pictures.error());
  result.pictures = *pictures;
  auto fit =
      calibrate_lens(options.config, options.rig.camera.intrinsics, views.views());
  if (!fit) return fail(fit.error().fault, options.source + ": " + fit.error().detail);
  result.fit = *fit;
  result.rig.camera.intrinsics = fit->lens;
  if (auto good = result.rig.validate(); !good) {
    return fail(Fault::degenerate,
                options.source + ": the lens found is none: " + good.error().detail);
  }
  return result;
}

Result<CalibrateMountResult> calibrate_mount(const CalibrateMountOptions& options) {
  if (auto good = options.rig.validate(); !good) return fail(good.error());
  if (!options.headings_deg.empty() &&
      options.headings_deg.size() != options.sources.size()) {
    return fail(Fault::invalid_config,
                "--heading-deg gives " + std::to_string(options.headings_deg.size()) +
                    " headings for " + std::to_string(options.sources.size()) +
                    " SOURCEs: one for each is needed");
  }
  CalibrateMountResult result;
  result.rig = options.rig;
  std::vector<StandingView> views;
  if (options.tag) {
    const auto view = tag_view(options, result);
    if (!view) return fail(view.error());
    views.push_back(*view);
  } else {
    const auto parked = parked_views(options, result);
    if (!parked) return fail(parked.error());
    views = *parked;
  }
  const auto fit = calibrate_mount(options.config, options.rig.camera.X_NC, views);
  if (!fit) return fail(fit.error());
  result.fit = *fit;
  result.rig.camera.X_NC = fit->X_NC;
  return result;
}

std::string calibration_json(const CalibrateFlightOptions& options,
                             const CalibrateFlightResult& result) {
  const ConstellationFit& fit = result.fit;
  Json leds = Json::array();
  for (int i = 0; i < fit.leds.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    leds.push_back({{"index", i},
                    {"xyz_m", list(fit.leds.p_BL(i))},
                    {"sd_m", list(fit.sd_m[n])},
                    {"moved_m", list(fit.leds.p_BL(i) - options.rig.leds.p_BL(i))},
                    {"frames_alone", fit.alone[n]}});
  }
  Json thrust{{"told", fit.thrust.has_value()}};
  if (fit.thrust) {
    const Vector2 turn = fit.thrust->turn_rad / kDegree;
    const Vector2 sd = fit.thrust->cov.diagonal().cwiseSqrt() / kDegree;
    thrust["turned_deg"] = {turn.x(), turn.y()};
    thrust["sd_deg"] = {sd.x(), sd.y()};
    thrust["stretches"] = fit.thrust->windows;
    thrust["follows"] = fit.thrust->follows;
  } else {
    thrust["why_not"] = fit.no_thrust;
  }
  const Json json{{"source", options.source},
                  {"pictures", result.pictures},
                  {"pictures_seen", result.seen},
                  {"frames", fit.frames},
                  {"frames_dropped", fit.frames_dropped},
                  {"observations", fit.observations},
                  {"observations_rejected", fit.rejected},
                  {"rms_before_px", fit.rms_before_px},
                  {"rms_px", fit.rms_px},
                  {"rms_held_out_px", fit.rms_held_out_px},
                  {"frames_held_out", fit.frames_held_out},
                  {"size_from", to_string(fit.size_from)},
                  {"size_sd_share", fit.size_sd},
                  {"depth_scale", fit.depth_scale},
                  {"shift_sd_m", list(fit.shift_sd_m)},
                  {"turn_sd_deg", list(fit.turn_sd_rad, 1 / kDegree)},
                  {"thrust", thrust},
                  {"leds", leds}};
  return json_text(json, 2) + "\n";
}

std::string calibration_json(const CalibrateLensOptions& options,
                             const CalibrateLensResult& result) {
  const LensFit& fit = result.fit;
  const auto numbers = [](const Intrinsics& k) {
    Json out{{"fx", k.fx}, {"fy", k.fy}, {"cx", k.cx}, {"cy", k.cy}};
    out["distortion"] = k.distortion;
    return out;
  };
  Json sd{{"fx", fit.sd[0]}, {"fy", fit.sd[1]}, {"cx", fit.sd[2]}, {"cy", fit.sd[3]}};
  sd["distortion"] = std::vector<double>(fit.sd.begin() + 4, fit.sd.end());
  const Json json{{"source", options.source},
                  {"pictures", result.pictures},
                  {"pictures_seen", result.seen},
                  {"views", fit.views},
                  {"views_dropped", fit.views_dropped},
                  {"rms_before_px", fit.rms_before_px},
                  {"rms_px", fit.rms_px},
                  {"rms_held_out_px", fit.rms_held_out_px},
                  {"views_held_out", fit.views_held_out},
                  {"tilt_deg", fit.tilt_deg},
                  {"reach", {fit.reach_u, fit.reach_v}},
                  {"before", numbers(options.rig.camera.intrinsics)},
                  {"lens", numbers(fit.lens)},
                  {"sd", sd}};
  return json_text(json, 2) + "\n";
}

std::string calibration_json(const CalibrateMountOptions& options,
                             const CalibrateMountResult& result) {
  const MountFit& fit = result.fit;
  const Pose X_NH = housing_from_optical(fit.X_NC);
  const Json json{
      {"sources", options.sources},
      {"from", options.tag ? "tag" : "parked drone"},
      {"pictures", result.pictures},
      {"pictures_seen", result.seen},
      {"xyz_m", list(X_NH.translation())},
      {"rpy_deg", list(mount_rpy_deg(fit.X_NC))},
      {"xyz_sd_m", list(fit.position_sd_m)},
      {"rpy_sd_deg", list(fit.rpy_sd_deg)},
      {"off_before", {{"m", fit.off_before_m}, {"deg", fit.off_before_deg}}},
      {"off", {{"m", fit.off_m}, {"deg", fit.off_deg}}},
      {"off_held_out",
       {{"m", number_or_null(fit.off_held_out_m)},
        {"deg", number_or_null(fit.off_held_out_deg)}}}};
  return json_text(json, 2) + "\n";
}

}  // namespace alight
