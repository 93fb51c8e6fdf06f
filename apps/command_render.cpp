#include <unistd.h>

#include <cstdio>
#include <iostream>
#include <memory>

#include "alight/io/files.h"
#include "alight/io/rig_yaml.h"
#include "alight/io/text.h"
#include "alight/run/sequence.h"
#include "checks.h"
#include "command.h"

using namespace alight;

namespace {

struct Settings {
  SequenceOptions options;
  std::string rig, out, kind = "clean";
  std::vector<double> blackout;
};

Result<void> render(Settings settings) {
  SequenceOptions& options = settings.options;
  options.rig = alan_rig();
  if (!settings.rig.empty()) {
    auto rig = load_rig(settings.rig);
    if (!rig) return fail(rig.error());
    options.rig = *rig;
  }
  options.kind = *sequence_kind(settings.kind);
  if (!settings.blackout.empty()) {
    options.dark_from = settings.blackout[0];
    options.dark_to = settings.blackout[1];
  }
  if (auto good = check_folder(settings.out); !good) return good;

  const bool told = isatty(STDERR_FILENO) != 0;
  const auto progress = [&](int done) {
    if (told) std::fprintf(stderr, "\r%d of %d pictures", done, options.frames);
  };
  const auto saved = save_sequence(settings.out, options, progress);
  if (told) std::fprintf(stderr, "\r\033[K");
  if (!saved) return saved;
  std::printf("%d pictures in %s; try: alight track %s --rig %s/rig.yaml\n",
              options.frames, settings.out.c_str(), settings.out.c_str(),
              settings.out.c_str());
  return {};
}

}  // namespace

void add_render(CLI::App& app, Job& job) {
  auto settings = std::make_shared<Settings>();
  SequenceOptions& options = settings->options;
  CLI::App* command = app.add_subcommand(
      "render", "Pictures of a flight before the camera, with their truth");
  command->add_option("--kind", settings->kind, "clean or hard")
      ->check(CLI::IsMember({"clean", "hard"}))
      ->capture_default_str();
  command->add_option("--rig", settings->rig, "Rig file; the authors' by default");
  command->add_option("--seed", options.seed, "Decides path, noise, lights")
      ->check(seed_number())
      ->capture_default_str();
  command->add_option("--frames", options.frames, "Pictures, at the rig's rate")
      ->capture_default_str();
  command
      ->add_option("--lights", options.lights, "Pieces of ceiling lights in the room")
      ->capture_default_str();
  command->add_option("--stray", options.strays, "Single lamps more, in the picture")
      ->capture_default_str();
  command->add_option("--dead", options.dead, "LEDs that do not shine: i,j,..")
      ->delimiter(',');
  command
      ->add_option("--blackout", settings->blackout,
                   "No LED shines from t0 to t1, s after the begin: t0,t1")
      ->delimiter(',')
      ->expected(2)
      ->check(finite());
  command
      ->add_option("--led-error-mm", options.led_error_mm,
                   "sd of the LEDs' places about the rig file, each axis")
      ->check(finite())
      ->capture_default_str();
  command
      ->add_option("--range-m", options.path.range_max_m, "Farthest from the lens, m")
      ->check(finite())
      ->capture_default_str();
  command->add_option("--speed-m-s", options.path.speed_m_s, "Top speed, m/s")
      ->check(finite())
      ->capture_default_str();
  command->add_option("--out", settings->out, "Folder for the pictures")
      ->required()
      ->check(named());
  command->callback(
      [settings, &job] { job = [settings] { return render(*settings); }; });
}
