#include <cstdio>
#include <iostream>

#include "alight/io/files.h"
#include "alight/io/text.h"
#include "alight/run/frame_recorder.h"
#include "alight/run/landing_run.h"
#include "alight/run/run_record.h"
#include "alight/run/scenario_yaml.h"
#include "checks.h"
#include "command.h"
#include "landing_rig_option.h"
#include "without_option.h"

namespace {

using namespace alight;

struct LandSettings {
  std::string scenario, rig, out, frames, profile = "default";
  std::vector<Part> without;
  std::uint64_t seed = 1;
  double timeout_s = 60;
  bool json = false;
  bool no_depth = false;
};

void print(const LandingResult& r) {
  std::printf("%s: %s\n", to_string(r.outcome), r.reason.c_str());
  if (r.touchdown) {
    std::printf(
        "touch-down    after %.2f s, %.1f cm from the centre, %.2f m/s, tilt %.1f deg, "
        "heading %+.1f deg\n",
        r.touchdown->t_s, 100 * r.touchdown->error_m, r.touchdown->relative_speed_m_s,
        r.touchdown->tilt_deg, r.touchdown->yaw_error_deg);
  }
  std::printf("tracking      RMSE %s m in the landing, %s m while following\n",
              fixed_text(r.tracking_rmse_m, 3).c_str(),
              fixed_text(r.follow_rmse_m, 3).c_str());
  std::printf("estimate      RMSE %s m, %s deg, %s m/s; tracked in %s %% of frames\n",
              fixed_text(r.estimate.position_rmse_m, 4).c_str(),
              fixed_text(r.estimate.rotation_rmse_deg, 2).c_str(),
              fixed_text(r.estimate.velocity_rmse_m_s, 3).c_str(),
              fixed_text(100 * r.estimate.tracked_fraction, 2).c_str());
  std::printf("speed         platform up to %.2f m/s, drone up to %.2f m/s\n",
              r.platform_speed_max_m_s, r.drone_speed_max_m_s);
  std::printf("simulation    %.1f s at %.1f times real time\n", r.simulated_s,
              r.realtime_factor);
}

Result<void> land(const LandSettings& settings) {
  LandingRunOptions options;
  options.rig = alan_rig();
  if (!settings.rig.empty()) {
    auto rig = load_landing_rig(settings.rig, settings.profile, "land");
    if (!rig) return fail(rig.error());
    options.rig = *rig;
    auto safety = load_safety(settings.rig, *rig);
    if (!safety) return fail(safety.error());
    options.safety = *safety;
  }
  if (!settings.scenario.empty()) {
    auto scenario = load_scenario(settings.scenario);
    if (!scenario) return fail(scenario.error());
    options.scenario = *scenario;
  }
  options.profile = settings.profile == "paper" ? Profile::paper : Profile::standard;
  options.without = settings.without;
  options.seed = settings.seed;
  options.timeout_s = settings.timeout_s;
  options.depth = !settings.no_depth;

  if (!settings.out.empty()) {
    if (auto good = check_folder(settings.out); !good) return good;
  }
  if (!settings.frames.empty()) {
    if (auto good = check_folder(settings.frames); !good) return good;
  }
  RunRecord record(options);
  FrameRecorder frames(settings.frames, options);
  Observers observers;
  if (!settings.out.empty()) observers.add(record);
  if (!settings.frames.empty()) observers.add(frames);
  const auto result = run_landing(options, observers.empty() ? nullptr : &observers);
  if (!result) return fail(result.error());
  int frame_count = 0;
  if (!settings.frames.empty()) {
    const auto count = frames.finish();
    if (!count) return fail(count.error());
    frame_count = *count;
  }
  std::vector<std::string> pictures;
  if (!settings.out.empty()) {
    auto saved = record.save(settings.out, *result);
    if (!saved) return fail(saved.error());
    pictures = *saved;
  }
  if (settings.json) {
    std::cout << result_json(*result);
    return {};
  }
  print(*result);
  if (!settings.frames.empty()) {
    std::printf("pictures      %d in %s, for alight track\n", frame_count,
                settings.frames.c_str());
  }
  if (!settings.out.empty()) {
    std::printf("recorded in   %s\n", settings.out.c_str());
    for (const std::string& name : pictures) {
      std::printf("  %s/%s\n", settings.out.c_str(), name.c_str());
    }
  }
  return {};
}

}  // namespace

void add_land(CLI::App& app, Job& job) {
  auto settings = std::make_shared<LandSettings>();
  CLI::App* command = app.add_subcommand("land", "One simulated landing, start to end");
  command
      ->add_option("--scenario", settings->scenario,
                   "Scenario file; without one, a calm circle")
      ->check(named());
  command->add_option("--rig", settings->rig, "Rig file; without one, the authors' rig")
      ->check(named());
  command->add_option("--seed", settings->seed, "Every seed is another world")
      ->check(seed_number())
      ->capture_default_str();
  command->add_option("--profile", settings->profile, "default or paper")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  add_without(*command, settings->without);
  command->add_option("--out", settings->out, "Folder for the record and its pictures")
      ->check(named());
  command
      ->add_option("--frames", settings->frames,
                   "Folder for the camera's pictures, a SOURCE of alight track")
      ->check(named());
  command->add_option("--timeout", settings->timeout_s, "Simulated seconds at most")
      ->check(within(1, 3600))
      ->capture_default_str();
  command->add_flag("--json", settings->json,
                    "Print the result as JSON and nothing else");
  command->add_flag("--no-depth", settings->no_depth, "Do not render depth pictures");
  command->callback([settings, &job] { job = [settings] { return land(*settings); }; });
}
