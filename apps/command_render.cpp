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
  std::string out;
  bool mixed = false;
  bool json = false;
};

Result<void> render(const Settings& settings) {
  auto options = settings.sequence.resolved();
  if (!options) return fail(options.error());
  if (settings.mixed) {
    MeasureOptions measured;
    measured.sequence = *options;
    measured.mixed = true;
    *options = measured_sequence(measured, options->seed);
  }
  if (auto good = check_folder(settings.out); !good) return good;

  const bool told = isatty(STDERR_FILENO) != 0;
  const auto progress = [&](int done) {
    if (told) std::fprintf(stderr, "\r%d of %d pictures", done, options->frames);
  };
  const auto saved = save_sequence(settings.out, *options, progress);
  if (told) std::fprintf(stderr, "\r\033[K");
  if (!saved) return fail(saved.error());
  if (settings.json) {
    std::cout << *saved;
    return {};
  }
  std::printf("%d pictures in %s; try: alight track %s --rig %s/rig.yaml\n",
              options->frames, settings.out.c_str(), settings.out.c_str(),
              settings.out.c_str());
  return {};
}

}  // namespace

void add_render(CLI::App& app, Job& job) {
  auto settings = std::make_shared<Settings>();
  CLI::App* command = app.add_subcommand(
      "render", "Pictures of a flight before the camera, with their truth");
  settings->sequence.add_to(*command);
  command->add_option("--seed", settings->sequence.options.seed, "Decides everything")
      ->check(seed_number())
      ->capture_default_str();
  command->add_option("--out", settings->out, "Folder for the pictures")
      ->required()
      ->check(named());
  command->add_flag("--mixed", settings->mixed,
                    "The flight of this seed of alight measure --mixed, with as many "
                    "--frames");
  command->add_flag("--json", settings->json, "One JSON document");
  command->callback(
      [settings, &job] { job = [settings] { return render(*settings); }; });
}
