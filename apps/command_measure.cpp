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
};

Result<void> measure(const Settings& settings) {
  MeasureOptions options = settings.measure;
  auto sequence = settings.sequence.resolved();
  if (!sequence) return fail(sequence.error());
  options.sequence = *sequence;
  options.profile = settings.profile == "paper" ? Profile::paper : Profile::standard;

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
  std::cout << measure_json(options, *result);
  return {};
}

}  // namespace

void add_measure(CLI::App& app, Job& job) {
  auto settings = std::make_shared<Settings>();
  MeasureOptions& options = settings->measure;
  CLI::App* command = app.add_subcommand(
      "measure", "The estimator against the truth over many rendered flights (JSON)");
  settings->sequence.add_to(*command);
  command->add_option("--seeds", options.seeds, "Number of flights")
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
      ->capture_default_str();
  command->add_option("--rows", settings->rows, "File for a row a frame (CSV)")
      ->check(named());
  command->callback(
      [settings, &job] { job = [settings] { return measure(*settings); }; });
}
