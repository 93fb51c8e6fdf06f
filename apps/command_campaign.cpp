#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <set>

#include "alight/io/files.h"
#include "alight/io/rig_yaml.h"
#include "alight/io/text.h"
#include "alight/run/campaign.h"
#include "alight/run/campaign_store.h"
#include "alight/run/campaign_summary.h"
#include "alight/run/scenario_yaml.h"
#include "checks.h"
#include "command.h"
#include "json.h"

using namespace alight;

namespace {

struct Settings {
  std::vector<std::string> scenarios;
  std::string rig, out, profile = "default";
  int seeds = 20;
  std::int64_t first_seed = 1;
  int jobs = 0;
  double timeout_s = 60;
  bool perfect_rig = false;
  bool depth = true;
  bool json = false;
};

/// Another build may land otherwise: results of this very program only.
std::string program_version() {
  const auto program = read_file("/proc/self/exe");
  return program ? ALIGHT_VERSION "+" + content_hash(*program) : ALIGHT_VERSION;
}

std::string store_file(const std::string& out) {
  if (out.empty()) return {};
  const std::string kind = std::filesystem::path(out).extension().string();
  return kind == ".sqlite" || kind == ".db" ? out : out + "/campaign.sqlite";
}

std::string stem(const std::string& path) {
  return std::filesystem::path(path).stem().string();
}

Result<CampaignOptions> options_of(const Settings& settings) {
  CampaignOptions options;
  options.rig = alan_rig();
  if (!settings.rig.empty()) {
    auto rig = load_rig(settings.rig);
    if (!rig) return fail(rig.error());
    options.rig = *rig;
  }
  std::set<std::string> seen;
  for (const std::string& file : settings.scenarios) {
    if (!seen.insert(file).second) {
      return fail(Fault::invalid_config,
                  file + ": given twice, name each scenario once");
    }
    auto scenario = load_scenario(file);
    if (!scenario) return fail(scenario.error());
    if (settings.perfect_rig) {
      scenario->rig_error = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    }
    options.scenarios.push_back({file, *scenario});
  }
  options.profile = settings.profile == "paper" ? Profile::paper : Profile::standard;
  options.first_seed = static_cast<std::uint64_t>(settings.first_seed);
  options.seeds = settings.seeds;
  options.jobs = settings.jobs;
  options.timeout_s = settings.timeout_s;
  options.depth = settings.depth;
  options.store = store_file(settings.out);
  options.version = program_version();
  return options;
}

/// The line that flies this landing again and records it.
std::string land_command(const Settings& settings, const CampaignScenario& scenario,
                         std::uint64_t seed) {
  std::string file = scenario.name;
  std::string name = stem(scenario.name);
  if (settings.perfect_rig) {
    name += "_perfect_rig";
    file = "runs/" + name + ".yaml";
  }
  std::string line = "alight land --scenario " + file;
  if (!settings.rig.empty()) line += " --rig " + settings.rig;
  if (settings.profile != "default") line += " --profile " + settings.profile;
  if (settings.timeout_s != Settings{}.timeout_s) {
    line += " --timeout " + number_text(settings.timeout_s);
  }
  if (!settings.depth) line += " --no-depth";
  if (settings.profile != "default") name += "_" + settings.profile;
  const std::string number = std::to_string(seed);
  return line + " --seed " + number + " --out runs/" + name + "-" + number;
}

/// `alight land` has no --perfect-rig: it gets the scenario as a file.
Result<void> save_perfect(const CampaignScenario& scenario) {
  return write_file("runs/" + stem(scenario.name) + "_perfect_rig.yaml",
                    scenario_text(scenario.scenario));
}

Json as_json(const Spread& s) {
  return {{"p50", number_or_null(s.p50)},
          {"p95", number_or_null(s.p95)},
          {"min", number_or_null(s.min)},
          {"max", number_or_null(s.max)}};
}

Json as_json(const CampaignSummary& s) {
  Json j;
  j["scenario"] = s.scenario;
  j["runs"] = s.runs;
  j["landed"] = s.landed;
  j["landed_low"] = s.landed_interval.low;
  j["landed_high"] = s.landed_interval.high;
  j["crashed"] = s.crashed;
  j["outcomes"] = s.outcomes;
  j["attempts_mean"] = number_or_null(s.attempts_mean);
  j["touchdown"] = {{"t_s", as_json(s.touchdown_t_s)},
                    {"error_m", as_json(s.touchdown_error_m)},
                    {"relative_speed_m_s", as_json(s.relative_speed_m_s)},
                    {"tilt_deg", as_json(s.tilt_deg)},
                    {"yaw_error_deg", as_json(s.yaw_error_deg)}};
  j["tracking_rmse_m"] = as_json(s.tracking_rmse_m);
  j["follow_rmse_m"] = as_json(s.follow_rmse_m);
  j["estimate"] = {{"position_rmse_m", as_json(s.position_rmse_m)},
                   {"rotation_rmse_deg", as_json(s.rotation_rmse_deg)},
                   {"velocity_rmse_m_s", as_json(s.velocity_rmse_m_s)},
                   {"tracked_fraction", as_json(s.tracked_fraction)},
                   {"nees_mean", as_json(s.nees_mean)}};
  j["realtime_factor"] = as_json(s.realtime_factor);
  j["timing_us"] = Json::object();
  for (const auto& [stage, us] : s.timing_us) {
    j["timing_us"][stage] = {{"p50", number_or_null(us.p50)},
                             {"p99", number_or_null(us.p99)},
                             {"max", number_or_null(us.max)}};
  }
  j["not_landed"] = Json::array();
  return j;
}

void show_progress(const CampaignProgress& p) {
  std::fprintf(stderr, "\r%d of %d landings, %d landed ", p.done, p.total, p.landed);
  if (p.done == p.total) std::fprintf(stderr, "\r\033[K");
  std::fflush(stderr);
}

Result<void> campaign(const Settings& settings) {
  const auto options = options_of(settings);
  if (!options) return fail(options.error());
  std::function<void(const CampaignProgress&)> progress;
  if (isatty(STDERR_FILENO)) progress = show_progress;
  const auto result = run_campaign(*options, progress);
  if (!result) return fail(result.error());

  const std::vector<CampaignSummary> summaries = summarize(*options, *result);
  Json scenarios = Json::array();
  for (const CampaignSummary& summary : summaries)
    scenarios.push_back(as_json(summary));
  if (!settings.json) {
    for (const CampaignSummary& s : summaries) std::cout << summary_text(s);
  }

  for (const CampaignRun& run : result->runs) {
    if (run.result.outcome == Outcome::landed) continue;
    const CampaignScenario& scenario = options->scenarios[run.scenario];
    if (settings.perfect_rig) {
      if (auto good = save_perfect(scenario); !good) return good;
    }
    const std::string line = land_command(settings, scenario, run.seed);
    scenarios[run.scenario]["not_landed"].push_back(
        {{"seed", run.seed},
         {"outcome", to_string(run.result.outcome)},
         {"reason", run.result.reason},
         {"command", line}});
    if (!settings.json) {
      std::cout << line << "   # " << to_string(run.result.outcome) << ": "
                << run.result.reason << '\n';
    }
  }
  if (settings.json) {
    const Json document{{"version", options->version},
                        {"profile", settings.profile},
                        {"perfect_rig", settings.perfect_rig},
                        {"first_seed", settings.first_seed},
                        {"seeds", settings.seeds},
                        {"timeout_s", settings.timeout_s},
                        {"from_store", result->from_store},
                        {"scenarios", scenarios}};
    std::cout << document.dump(2) << '\n';
  } else if (!options->store.empty()) {
    std::cout << "results in " << options->store << " (" << result->from_store
              << " were there already)\n";
  }
  return {};
}

}  // namespace

void add_campaign(CLI::App& app, Job& job) {
  auto settings = std::make_shared<Settings>();
  CLI::App* command =
      app.add_subcommand("campaign", "Many simulated landings with statistics");
  command->add_option("--scenario", settings->scenarios, "Scenario files, repeatable")
      ->required();
  command->add_option("--seeds", settings->seeds, "Landings of each scenario")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  command->add_option("--first-seed", settings->first_seed, "The others follow it")
      ->check(seed_number() &
              CLI::Range(std::int64_t{0}, std::numeric_limits<std::int64_t>::max() / 2))
      ->capture_default_str();
  command->add_option("--rig", settings->rig,
                      "Rig file; without one, the authors' rig");
  command->add_option("--profile", settings->profile, "default or paper")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  command->add_flag("--perfect-rig", settings->perfect_rig,
                    "The rig that flies is as written down");
  command->add_option("--jobs", settings->jobs, "Threads; 0: one a core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command
      ->add_option("--out", settings->out,
                   "Store that is gone on with: FILE.sqlite, or a folder for one")
      ->check(named());
  command->add_option("--timeout", settings->timeout_s, "Simulated seconds at most")
      ->check(finite() & CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  command->add_flag("!--no-depth", settings->depth, "Do not render depth pictures");
  command->add_flag("--json", settings->json, "One JSON document");
  command->callback(
      [settings, &job] { job = [settings] { return campaign(*settings); }; });
}
