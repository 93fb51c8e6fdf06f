#include <cstdio>
#include <iostream>
#include <memory>

#include "alight/io/files.h"
#include "alight/io/rig_yaml.h"
#include "alight/run/track_run.h"
#include "checks.h"
#include "command.h"
#include "rig_option.h"

using namespace alight;

namespace {

struct Settings {
  std::string source, rig, out;
  std::string method = "iekf";
  std::string profile = "default";
  double parked_s = 0;
  bool depth = false;
  bool json = false;
};

void print(const Settings& settings, const Rig& rig, const TrackRunResult& result) {
  std::printf("%s: %d of %zu pictures tracked (%.2f %%) by %s\n",
              settings.source.c_str(), result.tracked, result.pictures.size(),
              100 * result.tracked_share(), settings.method.c_str());
  if (result.tracked > 0) {
    std::printf("fit           %.3f px rms (median)\n", result.reprojection_px);
  }
  std::printf("time          %.0f us a picture (median), %.0f us p99\n",
              result.us_median, result.us_p99);
  if (settings.parked_s > 0) {
    std::printf("rig           %s\n", result.measured_rig
                                          ? "measured by the parked drone"
                                          : "not measured: the parked drone was not "
                                            "seen well enough, taken as written");
  }
  if (rig.gamma == 0 && result.gamma != 1) {
    std::printf(
        "camera        stores light by the power 1 / %.2f, its pictures show: write "
        "camera: gamma: %.2f in the rig\n",
        result.gamma, result.gamma);
  }
  std::printf("longest gap   %.3f s; found without a prior %d times\n",
              result.longest_gap, result.searches);
}

Result<void> track(const Settings& settings) {
  TrackRunOptions options;
  const TrackMethod method = *track_method(settings.method);
  const bool by_tag = method == TrackMethod::aruco || method == TrackMethod::apriltag;
  auto rig = by_tag ? load_rig(settings.rig) : load_seen_rig(settings.rig, "track");
  if (!rig) return fail(rig.error());
  options.rig = *rig;
  options.source = settings.source;
  options.tracker.method = method;
  options.tracker.profile =
      settings.profile == "paper" ? Profile::paper : Profile::standard;
  options.tracker.parked_s = settings.parked_s;
  options.depth = settings.depth;

  if (!settings.out.empty()) {
    if (auto good = check_folder(settings.out); !good) return good;
  }
  const auto result = run_track(options);
  if (!result) return fail(result.error());
  if (!settings.out.empty()) {
    if (auto good = save_track(settings.out, options, *result); !good) return good;
  }
  if (settings.json) {
    std::cout << track_json(options, *result);
    return {};
  }
  print(settings, *rig, *result);
  if (!settings.out.empty()) {
    std::printf("recorded in   %s\n", settings.out.c_str());
  }
  return {};
}

std::string known_method(const std::string& method) {
  if (track_method(method)) return {};
  return "unknown method " + alight::quoted(method) +
         ", use iekf, kf-less, aruco or apriltag";
}

}  // namespace

void add_track(CLI::App& app, Job& job) {
  auto settings = std::make_shared<Settings>();
  CLI::App* command = app.add_subcommand("track", "Poses from recorded pictures");
  command
      ->add_option("SOURCE", settings->source,
                   "Folder with frames.csv, folder of pictures, or video")
      ->required();
  command->add_option("--rig", settings->rig, "Rig file")->required();
  command
      ->add_option("--method", settings->method,
                   "iekf, kf-less (LEDs without a filter), aruco or apriltag (the "
                   "rig's tag)")
      ->check(CLI::Validator(known_method, "METHOD"))
      ->capture_default_str();
  command->add_option("--profile", settings->profile, "default or paper")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  command
      ->add_option("--parked", settings->parked_s,
                   "The drone stands on the pad for the first so many s: the rig is "
                   "measured by it")
      ->check(within(0, 60));
  command->add_flag("--depth", settings->depth, "Use the depth pictures too");
  command->add_option("--out", settings->out, "Folder for estimate, frames and plots")
      ->check(named());
  command->add_flag("--json", settings->json, "One JSON document");
  command->callback(
      [settings, &job] { job = [settings] { return track(*settings); }; });
}
