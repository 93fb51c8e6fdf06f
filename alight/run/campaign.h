#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/run/landing_run.h"

namespace alight {

/// A scenario and what to call it: the file it came from.
struct CampaignScenario {
  std::string name;
  Scenario scenario;
  std::string fault = {};          ///< Of a grid of faults: which (fault_grid.h),
  std::vector<Outcome> ends = {};  ///< and how it may end; empty: any but a crash;
  std::vector<std::string> because = {};  ///< unless it landed, for a reason that holds
                                          ///< one of these; empty: any.
};

/// Many landings: every scenario with every seed of
/// [first_seed, first_seed + seeds).
struct CampaignOptions {
  std::vector<CampaignScenario> scenarios;
  Rig rig;
  Safety safety;
  Profile profile = Profile::standard;
  std::vector<Part> without = {};  ///< Parts that are left out (standard profile).
  std::uint64_t first_seed = 1;
  int seeds = 20;
  double timeout_s = 60;  ///< Of each landing, simulated.
  bool depth = true;
  int jobs = 0;         ///< Threads; 0: one a core.
  std::string store;    ///< SQLite file that keeps results; empty: none.
  std::string version;  ///< Of the program. Results of another are not taken over.

  /// Names the first field that is out of range, its value and its bounds.
  Result<void> validate() const;
};

struct CampaignRun {
  std::size_t scenario = 0;  ///< Index into CampaignOptions::scenarios.
  std::uint64_t seed = 0;
  LandingResult result;
};

struct CampaignResult {
  std::vector<CampaignRun> runs;  ///< By scenario, then by seed.
  int from_store = 0;             ///< How many of them had been computed before.
};

struct CampaignProgress {
  int done = 0;
  int total = 0;
  int landed = 0;
};

/// Computes what the store does not hold yet and keeps each result there as soon as it
/// exists, so that a campaign that was killed goes on where it was. Neither the number
/// of threads nor an interruption changes a figure, timing and realtime ones aside.
/// `progress` is called after each landing, by one thread at a time.
///
/// invalid_config when options, scenario or rig do not hold; io for the store.
Result<CampaignResult> run_campaign(
    const CampaignOptions& options,
    const std::function<void(const CampaignProgress&)>& progress = {});

}  // namespace alight
