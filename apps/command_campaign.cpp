#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <memory>
#include <set>

#include "alight/io/files.h"
#include "alight/io/json_text.h"
#include "alight/io/text.h"
#include "alight/run/campaign.h"
#include "alight/run/campaign_compare.h"
#include "alight/run/campaign_pictures.h"
#include "alight/run/campaign_store.h"
#include "alight/run/campaign_summary.h"
#include "alight/run/fault_grid.h"
#include "alight/run/scenario_yaml.h"
#include "checks.h"
#include "command.h"
#include "json.h"
#include "landing_rig_option.h"
#include "without_option.h"

using namespace alight;

namespace {

struct Settings {
  std::vector<std::string> scenarios;
  std::string rig, out, profile = "default";
  std::string faults, plots;
  std::vector<std::string> only_faults;
  std::vector<Part> without;
  std::vector<double> at_s = {0.5, 1.2, 1.8, 2.5, 4, 6, 7.6, 8.6, 9.3, 9.9};
  bool pairs = false;
  int seeds = 20;
  std::int64_t first_seed = 1;
  int jobs = 0;
  double timeout_s = 60;
  bool perfect_rig = false;
  bool no_depth = false;
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

/// Every scenario with every fault that is asked for, at every instant.
Result<void> put_faults(const Settings& settings, CampaignOptions& options) {
  auto cases = load_fault_cases(settings.faults);
  if (!cases) return fail(cases.error());
  FaultGrid grid{.cases = {}, .at_s = settings.at_s, .pairs = settings.pairs};
  std::vector<std::string> known;
  for (const FaultCase& one : *cases) known.push_back(one.name);
  for (const std::string& name : settings.only_faults) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    const std::string near = nearest_key(name, known);
    return fail(
        Fault::invalid_config,
        settings.faults + ": holds no fault " + alight::quoted(name) +
            (near.empty() ? "" : "; did you mean " + alight::quoted(near) + "?"));
  }
  for (const FaultCase& one : *cases) {
    const auto& only = settings.only_faults;
    if (only.empty() || std::find(only.begin(), only.end(), one.name) != only.end()) {
      grid.cases.push_back(one);
    }
  }
  options.scenarios = apply_faults(options.scenarios, grid);
  if (options.scenarios.empty()) {
    return fail(Fault::invalid_config, "--pairs needs two faults at least");
  }
  return {};
}

Result<CampaignOptions> options_of(const Settings& settings) {
  CampaignOptions options;
  options.rig = alan_rig();
  if (!settings.rig.empty()) {
    auto rig = load_landing_rig(settings.rig, settings.profile, "campaign");
    if (!rig) return fail(rig.error());
    options.rig = *rig;
    auto safety = load_safety(settings.rig, *rig);
    if (!safety) return fail(safety.error());
    options.safety = *safety;
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
  if (!settings.faults.empty()) {
    if (auto good = put_faults(settings, options); !good) return fail(good.error());
  }
  options.profile = settings.profile == "paper" ? Profile::paper : Profile::standard;
  options.without = settings.without;
  options.first_seed = static_cast<std::uint64_t>(settings.first_seed);
  options.seeds = settings.seeds;
  options.jobs = settings.jobs;
  options.timeout_s = settings.timeout_s;
  options.depth = !settings.no_depth;
  options.store = store_file(settings.out);
  options.version = program_version();
  return options;
}

/// As a shell takes it for one word.
std::string shell_word(const std::string& text) {
  const auto plain = [](unsigned char c) {
    return std::isalnum(c) != 0 || std::strchr("_./-+=,:@%", c) != nullptr;
  };
  if (!text.empty() && std::all_of(text.begin(), text.end(), plain)) return text;
  std::string word = "'";
  for (const char c : text)
    word += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return word + "'";
}

/// A name for files: letters, digits and what does not trouble a shell.
std::string slug(const std::string& name) {
  std::string text;
  for (const char c : name) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) || c == '.';
    if (plain) {
      text += c;
    } else if (!text.empty() && text.back() != '_') {
      text += '_';
    }
  }
  return text;
}

/// Where landings that are flown again come from and go to: beside the store.
std::string replay_folder(const Settings& settings) {
  if (settings.out.empty()) return "runs";
  const std::string store = store_file(settings.out);
  const std::string folder = std::filesystem::path(store).parent_path().string();
  return folder.empty() ? "." : folder;
}

/// Whether the campaign changes what it reads, and so writes scenarios of its own.
bool makes_scenarios(const Settings& settings) {
  return settings.perfect_rig || !settings.faults.empty();
}

/// A scenario's file name, with its folders where another has the same.
std::string label_of(const Settings& settings, const std::string& file) {
  const auto alike = std::count_if(
      settings.scenarios.begin(), settings.scenarios.end(),
      [&](const std::string& other) { return stem(other) == stem(file); });
  if (alike <= 1) return stem(file);
  return slug(std::filesystem::path(file).replace_extension().string());
}

/// The scenario's name for files, and what the campaign has made of it.
std::string label_of(const Settings& settings, const CampaignScenario& scenario) {
  const std::size_t end =
      scenario.fault.empty() ? scenario.name.size() : scenario.name.find(" + ");
  std::string label = label_of(settings, scenario.name.substr(0, end));
  if (!scenario.fault.empty()) label += "_" + slug(scenario.name.substr(end));
  if (settings.perfect_rig) label += "_perfect_rig";
  return label;
}

/// What `alight land` is given for this scenario: the file it came from, or one that is
/// written for it when the campaign made it up.
std::string scenario_file(const Settings& settings, const CampaignScenario& scenario) {
  if (!makes_scenarios(settings)) return scenario.name;
  return replay_folder(settings) + "/" + (scenario.fault.empty() ? "" : "faults/") +
         label_of(settings, scenario) + ".yaml";
}

/// The line that flies this landing again and records it.
std::string land_command(const Settings& settings, const CampaignScenario& scenario,
                         std::uint64_t seed) {
  std::string line =
      "alight land --scenario " + shell_word(scenario_file(settings, scenario));
  if (!settings.rig.empty()) line += " --rig " + shell_word(settings.rig);
  if (settings.profile != "default") line += " --profile " + settings.profile;
  for (const Part part : settings.without) {
    line += std::string(" --without ") + to_string(part);
  }
  if (settings.timeout_s != Settings{}.timeout_s) {
    line += " --timeout " + number_text(settings.timeout_s);
  }
  if (settings.no_depth) line += " --no-depth";
  std::string name = label_of(settings, scenario);
  if (settings.profile != "default") name += "_" + settings.profile;
  for (const Part part : settings.without) {
    name += std::string("_without_") + to_string(part);
  }
  const std::string number = std::to_string(seed);
  return line + " --seed " + number + " --out " +
         shell_word(replay_folder(settings) + "/" + name + "-" + number);
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
  j["soft"] = s.soft;
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

Json as_json(const FaultSummary& s) {
  return {{"fault", s.fault},
          {"runs", s.runs},
          {"wrong", s.wrong},
          {"outcomes", s.outcomes},
          {"reasons", s.reasons},
          {"drift_max_m", number_or_null(s.drift_max_m)},
          {"sink_max_m_s", number_or_null(s.sink_max_m_s)}};
}

void show_progress(const CampaignProgress& p) {
  std::fprintf(stderr, "\r%d of %d landings, %d landed ", p.done, p.total, p.landed);
  if (p.done == p.total) std::fprintf(stderr, "\r\033[K");
  std::fflush(stderr);
}

Result<void> campaign(const Settings& settings) {
  const auto options = options_of(settings);
  if (!options) return fail(options.error());
  if (!settings.plots.empty()) {
    if (auto good = check_folder(settings.plots); !good) return good;
  }
  if (makes_scenarios(settings)) {
    if (auto good = check_folder(replay_folder(settings)); !good) return good;
  }
  std::function<void(const CampaignProgress&)> progress;
  if (isatty(STDERR_FILENO)) progress = show_progress;
  const auto result = run_campaign(*options, progress);
  if (!result) return fail(result.error());

  const bool of_faults = !settings.faults.empty();
  const std::vector<CampaignSummary> summaries = summarize(*options, *result);
  const std::vector<FaultSummary> faults = summarize_faults(*options, *result);
  Json scenarios = Json::array(), fault_rows = Json::array(), wrong = Json::array();
  if (!of_faults) {
    for (const CampaignSummary& s : summaries) scenarios.push_back(as_json(s));
  }
  for (const FaultSummary& s : faults) fault_rows.push_back(as_json(s));
  if (!settings.json) {
    if (of_faults) std::cout << fault_table(faults);
    for (const CampaignSummary& s : summaries) {
      if (!of_faults) std::cout << summary_text(s);
    }
  }

  // Of faults, those that ended as they should not; else all that did not land.
  for (const CampaignRun& run : result->runs) {
    const CampaignScenario& scenario = options->scenarios[run.scenario];
    const Outcome outcome = run.result.outcome;
    if (of_faults ? ended_well(scenario, run.result) : outcome == Outcome::landed) {
      continue;
    }
    const std::string file = scenario_file(settings, scenario);
    if (file != scenario.name) {
      auto good = write_file(file, scenario_text(scenario.scenario));
      if (!good) return good;
    }
    const std::string line = land_command(settings, scenario, run.seed);
    Json entry{{"seed", run.seed},
               {"outcome", to_string(outcome)},
               {"reason", run.result.reason},
               {"command", line}};
    if (of_faults) {
      entry["scenario"] = scenario.name;
      wrong.push_back(std::move(entry));
    } else {
      scenarios[run.scenario]["not_landed"].push_back(std::move(entry));
    }
    if (!settings.json) {
      std::cout << line << "   # " << to_string(outcome) << ": " << run.result.reason
                << '\n';
    }
  }
  std::vector<std::string> pictures;
  if (!settings.plots.empty()) {
    auto saved = save_campaign_pictures(settings.plots, *options, *result);
    if (!saved) return fail(saved.error());
    pictures = std::move(*saved);
  }
  if (settings.json) {
    Json without = Json::array();
    for (const Part part : settings.without) without.push_back(to_string(part));
    const Json document{{"version", options->version},
                        {"profile", settings.profile},
                        {"without", without},
                        {"perfect_rig", settings.perfect_rig},
                        {"first_seed", settings.first_seed},
                        {"seeds", settings.seeds},
                        {"timeout_s", settings.timeout_s},
                        {"from_store", result->from_store},
                        {"scenarios", scenarios},
                        {"faults", fault_rows},
                        {"wrong", wrong},
                        {"pictures", pictures}};
    std::cout << json_text(document, 2) << '\n';
  } else if (!options->store.empty()) {
    std::cout << "results in " << options->store << " (" << result->from_store
              << " were there already)\n";
  }
  if (!settings.json) {
    for (const std::string& picture : pictures) std::cout << picture << '\n';
  }
  return {};
}

Json as_json(const PairedShare& s) {
  return {{"both", s.both},        {"only_a", s.only_a},
          {"only_b", s.only_b},    {"neither", s.neither},
          {"mcnemar_p", s.p},      {"difference_b_less_a", s.difference},
          {"low", s.interval.low}, {"high", s.interval.high}};
}

struct CompareSettings {
  CampaignSide a, b;
  bool json = false;
};

Json as_json(const PairedFigure& f) {
  return {{"figure", f.name},
          {"pairs", f.pairs},
          {"median_a", number_or_null(f.median_a)},
          {"median_b", number_or_null(f.median_b)},
          {"median_difference", number_or_null(f.difference)},
          {"low", number_or_null(f.interval.low)},
          {"high", number_or_null(f.interval.high)}};
}

/// The store that --out was given a folder for.
CampaignSide opened(CampaignSide side) {
  if (std::filesystem::is_directory(side.store)) side.store = store_file(side.store);
  return side;
}

Result<void> compare(const CompareSettings& settings) {
  const auto result = compare_campaigns(opened(settings.a), opened(settings.b));
  if (!result) return fail(result.error());
  if (!settings.json) {
    std::cout << comparison_text(*result);
    return {};
  }
  Json scenarios = Json::array();
  for (const CampaignComparison& c : *result) {
    Json figures = Json::array();
    for (const PairedFigure& f : c.figures) figures.push_back(as_json(f));
    scenarios.push_back({{"scenario", c.scenario},
                         {"pairs", c.landed.pairs()},
                         {"landed", as_json(c.landed)},
                         {"first_try", as_json(c.first_try)},
                         {"crashed", as_json(c.crashed)},
                         {"alone_a", c.alone_a},
                         {"alone_b", c.alone_b},
                         {"figures", figures}});
  }
  std::cout << json_text(Json{{"scenarios", scenarios}}, 2) << '\n';
  return {};
}

void add_compare(CLI::App& campaign, Job& job) {
  auto settings = std::make_shared<CompareSettings>();
  CLI::App* command = campaign.add_subcommand(
      "compare", "Two stores, landing by landing: what B does better or worse than A");
  command->add_option("A", settings->a.store, "Store: FILE.sqlite, or its folder")
      ->required();
  command->add_option("B", settings->b.store, "Store; may be the same")->required();
  const auto choose = [&](const std::string& side, CampaignSide& of) {
    command->add_option("--profile-" + side, of.profile,
                        "Only landings of this profile, as \"default without "
                        "escape\"");
    command->add_option("--version-" + side, of.version,
                        "Only of the program whose version begins so");
    command->add_option("--scenario-" + side, of.scenario,
                        "Only of this scenario, whatever the other is called");
  };
  choose("a", settings->a);
  choose("b", settings->b);
  command->add_flag("--json", settings->json, "One JSON document");
  command->callback(
      [settings, &job] { job = [settings] { return compare(*settings); }; });
}

}  // namespace

void add_campaign(CLI::App& app, Job& job) {
  auto settings = std::make_shared<Settings>();
  CLI::App* command =
      app.add_subcommand("campaign", "Many simulated landings with statistics");
  command->require_subcommand(0, 1);
  add_compare(*command, job);
  command->add_option("--scenario", settings->scenarios, "Scenario files, repeatable");
  command->add_option("--seeds", settings->seeds, "Landings of each scenario")
      ->check(within(1, 1e6))
      ->capture_default_str();
  command->add_option("--first-seed", settings->first_seed, "The others follow it")
      ->check(seed_number(62))
      ->capture_default_str();
  command->add_option("--rig", settings->rig, "Rig file; without one, the authors' rig")
      ->check(named());
  command->add_option("--profile", settings->profile, "default or paper")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  add_without(*command, settings->without);
  command->add_flag("--perfect-rig", settings->perfect_rig,
                    "The rig that flies is as written down");
  command->add_option("--jobs", settings->jobs, "Threads; 0: one a core")
      ->check(within(0, 1024))
      ->capture_default_str();
  command
      ->add_option("--out", settings->out,
                   "Store that is gone on with: FILE.sqlite, or a folder for one")
      ->check(named());
  command->add_option(
      "--faults", settings->faults,
      "File of faults (config/faults/matrix.yaml): each at each instant");
  command->add_option("--fault", settings->only_faults,
                      "Of these only the one of this name, repeatable");
  command->add_option("--at", settings->at_s, "The instants, s from the start")
      ->delimiter(',')
      ->check(within(0, 3600));
  command->add_flag("--pairs", settings->pairs,
                    "Each two faults once, the instants in turn");
  command->add_option("--plots", settings->plots, "Folder for pictures of the results")
      ->check(named());
  command->add_option("--timeout", settings->timeout_s, "Simulated seconds at most")
      ->check(within(1, 3600))
      ->capture_default_str();
  command->add_flag("--no-depth", settings->no_depth, "Do not render depth pictures");
  command->add_flag("--json", settings->json, "One JSON document");
  command->callback([settings, command, &job] {
    if (!command->get_subcommands().empty()) return;
    if (settings->scenarios.empty()) throw CLI::RequiredError("--scenario");
    const bool grid =
        settings->pairs || !settings->only_faults.empty() || command->count("--at") > 0;
    if (grid && settings->faults.empty()) {
      throw CLI::ValidationError("--fault, --at and --pairs need --faults FILE");
    }
    job = [settings] { return campaign(*settings); };
  });
}
