#include "alight/run/measure_run.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <exception>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "alight/base/bounds.h"
#include "alight/eval/statistics.h"

namespace alight {
namespace {

using Json = nlohmann::ordered_json;
constexpr int kSettled = 30;  // frames after which the velocity is known
constexpr std::size_t kListed = 100;

Json number_or_null(double value) {
  if (std::isfinite(value)) return value;
  return nullptr;
}

/// What the threads share.
struct Work {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  int done = 0;                // guarded by mutex, as is
  std::optional<Error> wrong;  // the first one
};

Result<std::vector<FrameScore>> measure_one(const SequenceOptions& one,
                                            Profile profile) {
  // No exceptions of ours, but a library's must not end the program from a thread.
  try {
    auto sequence = Sequence::create(one);
    if (!sequence) return fail(sequence.error());
    return score_sequence(*sequence, one.rig, profile);
  } catch (const std::exception& wrong) {
    return fail(Fault::invalid_input, wrong.what());
  }
}

/// Figures over the frames, gathered over all sequences.
struct Gathered {
  std::vector<double> position, rotation, velocity, settled, nees_pose, nees_state;
  std::vector<double> cpu_us, found_us, start_frames;
  double nis = 0;
  int observations = 0, frames = 0, tracked = 0, wrong = 0, surely = 0, lost = 0;
  int never = 0;
  Json surely_wrong = Json::array();

  void add(const MeasuredSequence& sequence);
};

void Gathered::add(const MeasuredSequence& sequence) {
  int first = -1;
  for (std::size_t k = 0; k < sequence.frames.size(); ++k) {
    const FrameScore& frame = sequence.frames[k];
    ++frames;
    (frame.found || first < 0 ? found_us : cpu_us).push_back(frame.cpu_us);
    nis += frame.nis_sum;
    observations += frame.observations;
    if (!frame.tracked) {
      if (first >= 0) ++lost;
      continue;
    }
    ++tracked;
    if (first < 0) first = static_cast<int>(k);
    position.push_back(frame.position_m);
    rotation.push_back(frame.rotation_rad / kDegree);
    velocity.push_back(frame.velocity_m_s);
    if (static_cast<int>(k) >= first + kSettled) settled.push_back(frame.velocity_m_s);
    nees_pose.push_back(frame.nees_pose);
    nees_state.push_back(frame.nees_state);
    if (frame.wrong()) ++wrong;
    if (!frame.surely_wrong()) continue;
    ++surely;
    if (surely_wrong.size() < kListed) {
      surely_wrong.push_back({{"seed", sequence.options.seed},
                              {"frame", k},
                              {"position_m", frame.position_m},
                              {"rotation_deg", frame.rotation_rad / kDegree},
                              {"nees_pose", number_or_null(frame.nees_pose)}});
    }
  }
  if (first < 0) {
    ++never;
  } else {
    start_frames.push_back(first + 1);
  }
}

Json times(const std::vector<double>& us) {
  return {{"count", us.size()},
          {"p50", number_or_null(percentile(us, 0.5))},
          {"p99", number_or_null(percentile(us, 0.99))},
          {"max", number_or_null(percentile(us, 1))}};
}

}  // namespace

Result<void> MeasureOptions::validate() const {
  if (auto good = sequence.validate(); !good) return good;
  return check_bounds({{"seeds", static_cast<double>(seeds), 1, 1e6},
                       {"jobs", static_cast<double>(jobs), 0, 1024}});
}

SequenceOptions measured_sequence(const MeasureOptions& options, std::uint64_t seed) {
  SequenceOptions one = options.sequence;
  one.seed = seed;
  if (!options.mixed) return one;
  Rng rng = Rng(seed).fork("mixed");
  one.kind = rng.chance(0.5) ? SequenceKind::hard : SequenceKind::clean;
  one.lights = static_cast<int>(rng.uniform(0, 81));
  one.strays = rng.chance(0.5) ? 0 : static_cast<int>(rng.uniform(1, 101));
  // As many may fail as leaves four, of eight LEDs three, of fewer two.
  const int leds = one.rig.leds.size();
  const int most = std::min(leds - 4, leds >= 8 ? 3 : 2);
  const int dead = rng.chance(0.5) ? 0 : static_cast<int>(rng.uniform(0, most + 1));
  one.dead.clear();
  while (static_cast<int>(one.dead.size()) < dead) {
    const int i = static_cast<int>(rng.uniform(0, leds));
    if (std::find(one.dead.begin(), one.dead.end(), i) == one.dead.end()) {
      one.dead.push_back(i);
    }
  }
  const Seconds duration = one.frames / one.rig.timing.rate_hz;
  if (rng.chance(0.3)) {
    one.dark_from = rng.uniform(0, duration);
    one.dark_to = one.dark_from + rng.uniform(0.1, 1);
  }
  one.path.speed_m_s = rng.uniform(0.5, one.path.speed_m_s);
  // Slow flights cannot come from near to far in their time.
  const double reach = 0.35 * one.path.speed_m_s * std::max(duration, 10.0);
  const double room = one.path.range_max_m - one.path.range_min_m;
  if (reach < room) {
    one.path.range_min_m += rng.uniform(0, room - reach);
    one.path.range_max_m = one.path.range_min_m + reach;
    one.path.close_share = 0;
  }
  return one;
}

Result<MeasureResult> run_measure(const MeasureOptions& options,
                                  const std::function<void(int)>& progress) {
  if (auto good = options.validate(); !good) return fail(good.error());
  MeasureResult result;
  for (int i = 0; i < options.seeds; ++i) {
    const std::uint64_t seed = options.first_seed + static_cast<std::uint64_t>(i);
    result.sequences.push_back({measured_sequence(options, seed), {}});
  }
  Work work;
  const auto compute = [&] {
    while (true) {
      const std::size_t i = work.next.fetch_add(1);
      if (i >= result.sequences.size()) return;
      MeasuredSequence& sequence = result.sequences[i];
      auto scores = measure_one(sequence.options, options.profile);
      const std::lock_guard lock(work.mutex);
      if (work.wrong) return;
      if (!scores) {
        work.wrong = Error{scores.error().fault,
                           "seed " + std::to_string(sequence.options.seed) + ": " +
                               scores.error().detail};
        return;
      }
      sequence.frames = std::move(*scores);
      ++work.done;
      if (progress) progress(work.done);
    }
  };
  const unsigned cores = std::max(1u, std::thread::hardware_concurrency());
  const unsigned jobs = options.jobs > 0 ? static_cast<unsigned>(options.jobs) : cores;
  std::vector<std::thread> threads;
  for (unsigned i = 1; i < jobs; ++i) threads.emplace_back(compute);
  compute();
  for (std::thread& thread : threads) thread.join();
  if (work.wrong) return fail(*work.wrong);
  return result;
}

std::string measure_json(const MeasureOptions& options, const MeasureResult& result) {
  Gathered all;
  for (const MeasuredSequence& sequence : result.sequences) all.add(sequence);
  const double frames = std::max(1, all.frames);
  const Json json{
      {"kind", options.mixed ? "mixed" : to_string(options.sequence.kind)},
      {"profile", options.profile == Profile::paper ? "paper" : "default"},
      {"first_seed", options.first_seed},
      {"seeds", options.seeds},
      {"frames", all.frames},
      {"returned", all.tracked / frames},
      {"correct", (all.tracked - all.wrong) / frames},
      {"lost", all.lost},
      {"never_found", all.never},
      {"position_rmse_m", number_or_null(rms(all.position))},
      {"rotation_rmse_deg", number_or_null(rms(all.rotation))},
      {"velocity_rmse_m_s", number_or_null(rms(all.velocity))},
      {"velocity_rmse_settled_m_s", number_or_null(rms(all.settled))},
      {"nees_pose_mean", number_or_null(mean(all.nees_pose))},
      {"nees_state_mean", number_or_null(mean(all.nees_state))},
      {"nis_mean", number_or_null(all.observations > 0 ? all.nis / all.observations
                                                       : std::nan(""))},
      {"wrong", all.wrong},
      {"surely_wrong", all.surely},
      {"surely_wrong_frames", all.surely_wrong},
      {"frames_to_start",
       {{"p50", number_or_null(percentile(all.start_frames, 0.5))},
        {"max", number_or_null(percentile(all.start_frames, 1))}}},
      {"cpu_us", {{"tracking", times(all.cpu_us)}, {"starting", times(all.found_us)}}}};
  return json.dump(2) + "\n";
}

std::string measure_rows(const MeasureResult& result) {
  std::string rows =
      "seed,frame,range_m,speed_m_s,tracked,found,position_m,rotation_deg,velocity_m_s,"
      "nees_pose,nees_state,nis_sum,observations,cpu_us\n";
  for (const MeasuredSequence& sequence : result.sequences) {
    for (std::size_t k = 0; k < sequence.frames.size(); ++k) {
      const FrameScore& f = sequence.frames[k];
      char row[256];
      std::snprintf(row, sizeof(row),
                    "%llu,%zu,%.4f,%.4f,%d,%d,%.6f,%.5f,%.5f,%.5g,%.5g,%.5g,%d,%.1f\n",
                    static_cast<unsigned long long>(sequence.options.seed), k,
                    f.range_m, f.speed_m_s, f.tracked ? 1 : 0, f.found ? 1 : 0,
                    f.position_m, f.rotation_rad / kDegree, f.velocity_m_s, f.nees_pose,
                    f.nees_state, f.nis_sum, f.observations, f.cpu_us);
      rows += row;
    }
  }
  return rows;
}

}  // namespace alight
