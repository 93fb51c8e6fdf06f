#include "alight/run/track_run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "alight/eval/statistics.h"
#include "alight/io/files.h"
#include "alight/io/image_source.h"
#include "alight/io/json_text.h"
#include "alight/io/plot.h"
#include "alight/io/pose_log.h"
#include "alight/io/rig_yaml.h"
#include "alight/run/json_lines.h"
#include "alight/run/made_in_bulk.h"

namespace alight {
namespace {

using Clock = std::chrono::steady_clock;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

nlohmann::ordered_json number_or_null(double value) {
  if (std::isfinite(value)) return value;
  return nullptr;
}

/// Longest time without a tracked picture, the ends included.
Seconds longest_gap(const std::vector<TrackedPicture>& pictures) {
  Time last = pictures.empty() ? 0 : pictures.front().t;
  Time gap = 0;
  for (const TrackedPicture& picture : pictures) {
    gap = std::max(gap, picture.t - last);
    if (picture.tracked) last = picture.t;
  }
  return to_seconds(gap);
}

std::vector<Panel> figures(const TrackRunResult& result) {
  const Time start = result.pictures.empty() ? 0 : result.pictures.front().t;
  Series axes[3] = {{.label = "x", .color = palette::blue},
                    {.label = "y", .color = palette::orange},
                    {.label = "z", .color = palette::green}};
  Series fit{.color = palette::purple};
  Series leds{.color = palette::black, .mark = Mark::dots, .width_px = 3};
  auto pose = result.estimate.begin();
  for (const TrackedPicture& picture : result.pictures) {
    const double t = to_seconds(picture.t - start);
    for (int i = 0; i < 3; ++i) {
      axes[i].x.push_back(t);
      axes[i].y.push_back(picture.tracked ? pose->second.translation()[i] : kNaN);
    }
    if (picture.tracked) ++pose;
    fit.x.push_back(t);
    fit.y.push_back(picture.tracked ? picture.reprojection_px : kNaN);
    leds.x.push_back(t);
    leds.y.push_back(picture.leds);
  }
  return {Panel{.title = "Drone, seen from the platform (N)",
                .x_label = "t, s",
                .y_label = "m",
                .series = {axes[0], axes[1], axes[2]}},
          Panel{.title = "How well the LEDs fit, rms",
                .x_label = "t, s",
                .y_label = "px",
                .series = {fit},
                .y_from_zero = true},
          Panel{.title = "LEDs used",
                .x_label = "t, s",
                .series = {leds},
                .y_from_zero = true}};
}

}  // namespace

Result<TrackRunResult> run_track(const TrackRunOptions& options) {
  auto tracker = FrameTracker::create(options.tracker, options.rig);
  if (!tracker) return fail(tracker.error());
  auto source = ImageSource::open(options.source, options.rig);
  if (!source) return fail(source.error());

  TrackRunResult result;
  const Intrinsics& lens = options.rig.camera.intrinsics;
  MadeInBulk<SourceFrame> pictures(
      [&](SourceFrame& one) {
        auto more = source->next(one);
        if (!options.depth) one.depth = {};
        return more;
      },
      (options.depth ? 5u : 3u) * static_cast<unsigned>(lens.width * lens.height));
  SourceFrame picture;
  FrameReport report;
  std::vector<double> us, reprojection;
  bool any_depth = false;
  while (true) {
    const auto more = pictures.next(picture);
    if (!more) return fail(more.error());
    if (!*more) break;
    any_depth = any_depth || !picture.depth.empty();
    CameraFrame frame;
    frame.captured = picture.t;
    frame.received = picture.t;
    frame.color = picture.color.view();
    if (options.depth) frame.depth = picture.depth.view();

    const auto begin = Clock::now();
    tracker->fuse(frame, report);
    const std::chrono::duration<double, std::micro> took = Clock::now() - begin;

    us.push_back(took.count());
    result.frames += frame_line(report, picture.t, took.count());
    int leds = 0;
    for (const LedUse& use : report.leds) {
      for (unsigned bits = use.observation.leds; bits != 0; bits &= bits - 1) ++leds;
    }
    result.pictures.push_back({report.t, report.tracked, leds, report.reprojection_px});
    if (report.initialized) ++result.searches;
    if (!report.tracked) continue;
    ++result.tracked;
    result.estimate.emplace_back(report.t, report.x.X_NB());
    reprojection.push_back(report.reprojection_px);
  }
  if (options.depth && !any_depth) {
    return fail(Fault::invalid_input,
                options.source +
                    ": has no depth pictures; name them in the column depth_file of "
                    "frames.csv or leave out --depth");
  }
  result.measured_rig = tracker->measured_rig();
  result.gamma = tracker->gamma();
  result.us_median = percentile(us, 0.5);
  result.us_p99 = percentile(us, 0.99);
  result.reprojection_px = reprojection.empty() ? kNaN : percentile(reprojection, 0.5);
  result.longest_gap = longest_gap(result.pictures);
  return result;
}

std::string track_json(const TrackRunOptions& options, const TrackRunResult& result) {
  const nlohmann::ordered_json json{
      {"source", options.source},
      {"method", to_string(options.tracker.method)},
      {"profile", options.tracker.profile == Profile::paper ? "paper" : "default"},
      {"depth", options.depth},
      {"frames", result.pictures.size()},
      {"tracked", result.tracked},
      {"tracked_fraction", result.tracked_share()},
      {"searches", result.searches},
      {"measured_rig", result.measured_rig},
      {"gamma", result.gamma},
      {"longest_gap_s", result.longest_gap},
      {"reprojection_px", number_or_null(result.reprojection_px)},
      {"us", {{"p50", result.us_median}, {"p99", result.us_p99}}}};
  return json_text(json, 2) + "\n";
}

Result<void> save_track(const std::string& folder, const TrackRunOptions& options,
                        const TrackRunResult& result) {
  const std::pair<const char*, std::string> files[] = {
      {"rig.yaml", rig_text(options.rig)},
      {"estimate.tum", tum_text(result.estimate)},
      {"frames.jsonl", result.frames},
  };
  // That of an earlier run would make a folder written in part look whole.
  std::error_code none_there;
  std::filesystem::remove(folder + "/result.json", none_there);
  for (const auto& [name, text] : files) {
    if (auto good = write_file(folder + "/" + name, text); !good) return good;
  }
  FigureOptions figure;
  figure.panel_height_px = 280;
  if (auto good = save_figure(folder + "/track.png", figures(result), figure); !good) {
    return good;
  }
  // Last: a folder with a result is complete.
  return write_file(folder + "/result.json", track_json(options, result));
}

}  // namespace alight
