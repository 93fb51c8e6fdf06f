#include <cstdio>
#include <iostream>
#include <memory>

#include "alight/io/files.h"
#include "alight/io/rig_yaml.h"
#include "alight/run/reproduce.h"
#include "checks.h"
#include "command.h"

using namespace alight;

namespace {

struct Settings {
  std::string row, rig, out, figure;
  std::uint64_t seed = 1;
  bool json = false;
};

/// The authors' rig with a tag on the drone's nose, looking forward and a little down.
Rig rig_with_tag() {
  Rig rig = alan_rig();
  Tag tag;
  tag.X_BT =
      make_pose(from_rpy(110 * kDegree, 0, 90 * kDegree), Vector3(0.06, 0, 0.035));
  rig.tag = tag;
  return rig;
}

void print(const ReproduceResult& result) {
  std::printf("%-8s %8s %9s %12s %12s %12s %9s\n", "method", "poses", "correct",
              "position, m", "rotation, deg", "velocity, m/s", "us p50");
  for (const MethodScore& s : result.methods) {
    const double of = s.frames > 0 ? 100.0 / s.frames : 0;
    std::printf("%-8s %6.1f %% %7.1f %% %12.4f %12.2f %12.3f %9.0f\n", s.method.c_str(),
                of * s.returned, of * s.correct, s.position_rmse_m, s.rotation_rmse_deg,
                s.velocity_rmse_m_s, s.us_p50);
  }
}

Result<void> run(const Settings& settings) {
  ReproduceOptions options;
  options.row = *paper_row(settings.row);
  options.seed = settings.seed;
  options.rig = rig_with_tag();
  if (!settings.rig.empty()) {
    auto rig = load_rig(settings.rig);
    if (!rig) return fail(rig.error());
    options.rig = *rig;
    options.tags = rig->tag.has_value();
  }
  for (const std::string& file : {settings.out, settings.figure}) {
    if (file.empty()) continue;
    if (auto good = check_file(file); !good) return good;
  }
  const auto result = reproduce(options);
  if (!result) return fail(result.error());
  const std::string document = reproduce_json(options, *result);
  if (!settings.out.empty()) {
    if (auto good = write_file(settings.out, document); !good) return good;
  }
  if (!settings.figure.empty()) {
    if (auto good = save_reproduce_figure(settings.figure, options, *result); !good) {
      return good;
    }
  }
  if (settings.json) {
    std::cout << document;
  } else {
    print(*result);
  }
  return {};
}

std::string known_row(const std::string& name) {
  if (paper_row(name)) return {};
  std::string all;
  for (const PaperRow row : kPaperRows) {
    all += std::string(all.empty() ? "" : ", ") + to_string(row);
  }
  return "unknown row " + name + ", use one of " + all;
}

}  // namespace

void add_reproduce(CLI::App& app, Job& job) {
  auto settings = std::make_shared<Settings>();
  CLI::App* command = app.add_subcommand(
      "reproduce", "One sequence of the paper's evaluation, every method on it");
  command->add_option("ROW", settings->row, "static_block, circle, ...")
      ->required()
      ->check(CLI::Validator(known_row, "ROW"));
  command->add_option("--seed", settings->seed, "Every seed is another world")
      ->check(seed_number())
      ->capture_default_str();
  command
      ->add_option("--rig", settings->rig,
                   "Rig file; without one, the authors' rig with a tag")
      ->check(named());
  command->add_option("--out", settings->out, "File for the figures, JSON")
      ->check(named());
  command->add_option("--figure", settings->figure, "File for a plot, PNG")
      ->check(named());
  command->add_flag("--json", settings->json, "One JSON document");
  command->callback([settings, &job] { job = [settings] { return run(*settings); }; });
}
