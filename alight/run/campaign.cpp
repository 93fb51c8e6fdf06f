#include "alight/run/campaign.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

#include "alight/io/rig_yaml.h"
#include "alight/io/text.h"
#include "alight/run/campaign_store.h"
#include "alight/run/on_threads.h"
#include "alight/run/scenario_yaml.h"

namespace alight {
namespace {

constexpr int kMaxSeeds = 1'000'000;
constexpr int kMaxJobs = 1024;

Result<void> out_of_bounds(const char* field, double value, const char* bounds) {
  return fail(Fault::invalid_config, std::string(field) + ": is " + number_text(value) +
                                         ", must be " + bounds);
}

/// What the threads share: which landing is next, and where results go.
class Work {
 public:
  Work(const CampaignOptions& options, CampaignStore* store,
       const std::function<void(const CampaignProgress&)>& progress)
      : options_(options), store_(store), progress_(progress) {}

  Result<CampaignResult> run();

 private:
  Result<void> take_over();
  void compute();
  Result<LandingResult> land(const CampaignRun& run) const;
  void keep(CampaignRun& run, Result<LandingResult> landing);
  CampaignKey key(const CampaignRun& run) const;
  void tell();

  const CampaignOptions& options_;
  CampaignStore* store_;
  const std::function<void(const CampaignProgress&)>& progress_;
  std::vector<std::string> scenario_hashes_;
  std::string rig_hash_;

  CampaignResult all_;
  std::vector<std::size_t> missing_;  // of all_.runs
  std::atomic<std::size_t> next_{0};
  std::mutex mutex_;
  CampaignProgress so_far_;  // guarded by mutex_, as are those below
  std::optional<Error> wrong_;
};

CampaignKey Work::key(const CampaignRun& run) const {
  return {options_.scenarios[run.scenario].name,
          scenario_hashes_[run.scenario],
          rig_hash_,
          configuration_name(options_.profile, options_.without),
          run.seed,
          options_.timeout_s,
          options_.depth,
          options_.version};
}

void Work::tell() {
  if (progress_) progress_(so_far_);
}

Result<void> Work::take_over() {
  for (std::size_t i = 0; i < all_.runs.size(); ++i) {
    CampaignRun& run = all_.runs[i];
    if (store_ != nullptr) {
      auto known = store_->find(key(run));
      if (!known) return fail(known.error());
      if (known->has_value()) {
        run.result = std::move(**known);
        so_far_.landed += run.result.outcome == Outcome::landed;
        ++so_far_.done;
        ++all_.from_store;
        continue;
      }
    }
    missing_.push_back(i);
  }
  return {};
}

Result<LandingResult> Work::land(const CampaignRun& run) const {
  LandingRunOptions one;
  one.scenario = options_.scenarios[run.scenario].scenario;
  one.rig = options_.rig;
  one.safety = options_.safety;
  one.profile = options_.profile;
  one.without = options_.without;
  one.seed = run.seed;
  one.timeout_s = options_.timeout_s;
  one.depth = options_.depth;
  // No exceptions of ours, but a library's must not end the program from a thread.
  try {
    return run_landing(one);
  } catch (const std::exception& wrong) {
    return fail(Fault::invalid_input, wrong.what());
  }
}

void Work::keep(CampaignRun& run, Result<LandingResult> landing) {
  const std::lock_guard lock(mutex_);
  if (!landing) {
    if (!wrong_) {
      wrong_ = Error{landing.error().fault, options_.scenarios[run.scenario].name +
                                                ", seed " + std::to_string(run.seed) +
                                                ": " + landing.error().detail};
    }
    return;
  }
  run.result = std::move(*landing);
  if (store_ != nullptr) {
    if (auto kept = store_->insert(key(run), run.result); !kept && !wrong_) {
      wrong_ = kept.error();
    }
  }
  so_far_.landed += run.result.outcome == Outcome::landed;
  ++so_far_.done;
  tell();
}

void Work::compute() {
  for (;;) {
    const std::size_t i = next_++;
    if (i >= missing_.size()) return;
    CampaignRun& run = all_.runs[missing_[i]];
    keep(run, land(run));
    const std::lock_guard lock(mutex_);
    if (wrong_) return;
  }
}

Result<CampaignResult> Work::run() {
  rig_hash_ = content_hash(rig_text(options_.rig) + safety_text(options_.safety));
  for (std::size_t s = 0; s < options_.scenarios.size(); ++s) {
    const Scenario& scenario = options_.scenarios[s].scenario;
    scenario_hashes_.push_back(
        content_hash(scenario_text(scenario) + scenario.platform.file_text));
    for (int k = 0; k < options_.seeds; ++k) {
      CampaignRun run;
      run.scenario = s;
      run.seed = options_.first_seed + static_cast<std::uint64_t>(k);
      all_.runs.push_back(std::move(run));
    }
  }
  so_far_.total = static_cast<int>(all_.runs.size());
  if (auto good = take_over(); !good) return fail(good.error());
  tell();

  const std::size_t wished = options_.jobs > 0
                                 ? static_cast<std::size_t>(options_.jobs)
                                 : std::max(1u, std::thread::hardware_concurrency());
  on_threads(std::min(wished, missing_.size()), [this] { compute(); });
  if (wrong_) return fail(*wrong_);
  return std::move(all_);
}

}  // namespace

Result<void> CampaignOptions::validate() const {
  if (scenarios.empty()) {
    return fail(Fault::invalid_config, "scenarios: none given, must be at least one");
  }
  if (seeds < 1 || seeds > kMaxSeeds) {
    return out_of_bounds("seeds", seeds, "within 1 to 1000000");
  }
  if (jobs < 0 || jobs > kMaxJobs) {
    return out_of_bounds("jobs", jobs, "within 0 (one a core) to 1024");
  }
  if (!(timeout_s >= 1 && timeout_s <= 3600)) {
    return out_of_bounds("timeout_s", timeout_s, "within 1 to 3600");
  }
  for (const CampaignScenario& s : scenarios) {
    if (auto good = s.scenario.validate(); !good) {
      return fail(good.error().fault, s.name + ": " + good.error().detail);
    }
  }
  if (auto good = rig.validate(); !good) return good;
  return safety.validate(rig);
}

Result<CampaignResult> run_campaign(
    const CampaignOptions& options,
    const std::function<void(const CampaignProgress&)>& progress) {
  if (auto good = options.validate(); !good) return fail(good.error());
  std::optional<CampaignStore> store;
  if (!options.store.empty()) {
    auto opened = CampaignStore::open(options.store);
    if (!opened) return fail(opened.error());
    store.emplace(std::move(*opened));
  }
  return Work(options, store ? &*store : nullptr, progress).run();
}

}  // namespace alight
