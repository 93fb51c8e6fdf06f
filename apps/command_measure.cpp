#include <unistd.h>

#include <cstdio>
#include <iostream>
#include <memory>

#include "alight/io/files.h"
#include "alight/run/measure_run.h"
#include "command.h"
#include "sequence_options.h"

using namespace alight;

namespace {

struct Settings {
  SequenceSettings sequence;
  MeasureOptions measure;
  std::string profile = "default", rows;
  bool json = false;
};

void print(const MeasureSummary& s) {
  std::printf("%d flights, %d frames: pose in %.2f %%, right in %.2f %%\n", s.flights,
              s.frames, 100 * s.returned, 100 * s.correct);
  std::printf("error         RMSE %.2f mm, %.3f deg, %.3f m/s (%.3f after 0.5 s)\n",
              1e3 * s.position_rmse_m, s.rotation_rmse_deg, s.velocity_rmse_m_s,
              s.velocity_rmse_settled_m_s);
  std::printf("NEES          pose %.2f (6 is true), state %.2f (9); NIS %.2f (2)\n",
              s.nees_pose, s.nees_state, s.nis);
  std::printf(
      "wrong poses   %d, told with confidence %d; lost in %d frames, never found "
      "%d drones\n",
      s.wrong, s.surely_wrong, s.lost, s.never_found);
  std::printf(
      "CPU time      %.0f us a frame (median), %.0f us p99; %.0f us to find it\n",
      s.tracking_us.p50, s.tracking_us.p99, s.starting_us.p50);
}

Result<void> measure(const Settings& settings) {
  MeasureOptions options = settings.measure;
  auto sequence = settings.sequence.resolved();
  if (!sequence) return fail(sequence.error());
  options.sequence = *sequence;
  options.profile = settings.profile == "paper" ? Profile::paper : Profile::standard;

  if (!settings.rows.empty()) {
    if (auto good = check_file(settings.rows); !good) return good;
  }

  const bool told = isatty(STDERR_FILENO) != 0;
  const auto progress = [&](int done) {
    if (told) std::fprintf(stderr, "\r%d of %d flights", done, options.seeds);
  };
  const auto result = run_measure(options, progress);
  if (told) std::fprintf(stderr, "\r\033[K");
  if (!result) return fail(result.error());
  if (!settings.rows.empty()) {
    if (auto good = write_file(settings.rows, measure_rows(*result)); !good)
      return good;
  }
  if (settings.json) {
    std::cout << measure_json(options, *result);
  } else {
    print(summarize(*result));
  }
  return {};
}

}  // namespace

void add_measure(CLI::App& app, Job& job) {
  auto settings = std::make_shared<Settings>();
  MeasureOptions& options = settings->measure;
  CLI::App* command = app.add_subcommand(
      "measure", "The estimator against the truth over many rendered flights");
  settings->sequence.add_to(*command);
  command->add_option("--seeds", options.seeds, "Number of flights")
      ->check(within(1, MeasureOptions::kSeedsMost))
      ->capture_default_str();
  command->add_option("--first-seed", options.first_seed, "Of the first flight")
      ->check(seed_number())
      ->capture_default_str();
  command->add_flag("--mixed", options.mixed,
                    "Each flight draws kind, lights, strays, dead LEDs, blackout");
  command->add_option("--profile", settings->profile, "default or paper")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  command->add_option("--jobs", options.jobs, "Threads; 0: one a core")
      ->check(within(0, MeasureOptions::kJobsMost))
      ->capture_default_str();
  command->add_option("--rows", settings->rows, "File for a row a frame (CSV)")
      ->check(named());
  command->add_flag("--json", settings->json, "One JSON document");
  command->callback(
      [settings, &job] { job = [settings] { return measure(*settings); }; });
}
