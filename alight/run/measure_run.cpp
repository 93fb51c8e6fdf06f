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
#include "alight/run/on_threads.h"

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

Result<std::vector<FrameScore>> measure_one(const SequenceOptions& one, Profile profile,
                                            std::size_t bytes_held) {
  // No exceptions of ours, but a library's must not end the program from a thread.
  try {
    auto sequence = Sequence::create(one);
    if (!sequence) return fail(sequence.error());
    return score_sequence(*sequence, one.rig, profile, bytes_held);
  } catch (const std::exception& wrong) {
    return fail(Fault::invalid_input, wrong.what());
  }
}

/// What the figures are made of, gathered over all flights.
struct Gathered {
  std::vector<double> position, rotation, velocity, settled, nees_pose, nees_state;
  std::vector<double> tracking_us, starting_us, start_frames;
  double nis = 0;
  int observations = 0;
  int tracked = 0;
};

void add(const FrameScore& frame, bool settled, Gathered& all, MeasureSummary& sums) {
  ++all.tracked;
  all.position.push_back(frame.position_m);
  all.rotation.push_back(frame.rotation_rad / kDegree);
  all.velocity.push_back(frame.velocity_m_s);
  if (settled) all.settled.push_back(frame.velocity_m_s);
  all.nees_pose.push_back(frame.nees_pose);
  all.nees_state.push_back(frame.nees_state);
  if (frame.wrong()) ++sums.wrong;
  if (frame.surely_wrong()) ++sums.surely_wrong;
}

void add(const std::vector<FrameScore>& frames, Gathered& all, MeasureSummary& sums) {
  int since_start = -1;
  bool in_track = false;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const FrameScore& frame = frames[k];
    (in_track && !frame.found ? all.tracking_us : all.starting_us)
        .push_back(frame.cpu_us);
    in_track = frame.tracked;
    all.nis += frame.nis_sum;
    all.observations += frame.observations;
    if (since_start >= 0) ++since_start;
    if (frame.tracked) {
      if (since_start < 0) {
        since_start = 0;
        all.start_frames.push_back(static_cast<double>(k + 1));
      }
      add(frame, since_start >= kSettled, all, sums);
    } else if (since_start >= 0) {
      ++sums.lost;
    }
  }
  if (since_start < 0) ++sums.never_found;
}

Times times(const std::vector<double>& us) {
  return {static_cast<int>(us.size()), percentile(us, 0.5), percentile(us, 0.99),
          percentile(us, 1)};
}

Json as_json(const Times& times) {
  return {{"count", times.count},
          {"p50", number_or_null(times.p50)},
          {"p99", number_or_null(times.p99)},
          {"max", number_or_null(times.max)}};
}

Json surely_wrong_frames(const MeasureResult& result) {
  Json list = Json::array();
  for (const MeasuredSequence& sequence : result.sequences) {
    for (std::size_t k = 0; k < sequence.frames.size(); ++k) {
      const FrameScore& frame = sequence.frames[k];
      if (!frame.surely_wrong() || list.size() >= kListed) continue;
      list.push_back({{"seed", sequence.options.seed},
                      {"frame", k},
                      {"position_m", frame.position_m},
                      {"rotation_deg", frame.rotation_rad / kDegree},
                      {"nees_pose", number_or_null(frame.nees_pose)}});
    }
  }
  return list;
}

}  // namespace

Result<void> MeasureOptions::validate() const {
  if (auto good = sequence.validate(); !good) return good;
  return check_bounds({{"seeds", static_cast<double>(seeds), 1, kSeedsMost},
                       {"jobs", static_cast<double>(jobs), 0, kJobsMost}});
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
  const unsigned cores = std::max(1u, std::thread::hardware_concurrency());
  const unsigned threads =
      options.jobs > 0 ? static_cast<unsigned>(options.jobs) : cores;
  const auto compute = [&] {
    while (true) {
      const std::size_t i = work.next.fetch_add(1);
      if (i >= result.sequences.size()) return;
      MeasuredSequence& sequence = result.sequences[i];
      auto scores =
          measure_one(sequence.options, options.profile, kBytesHeld / threads);
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
  on_threads(threads, compute);
  if (work.wrong) return fail(*work.wrong);
  return result;
}

MeasureSummary summarize(const MeasureResult& result) {
  Gathered all;
  MeasureSummary s;
  for (const MeasuredSequence& sequence : result.sequences) {
    ++s.flights;
    s.frames += static_cast<int>(sequence.frames.size());
    add(sequence.frames, all, s);
  }
  const double frames = std::max(1, s.frames);
  s.returned = all.tracked / frames;
  s.correct = (all.tracked - s.wrong) / frames;
  s.position_rmse_m = rms(all.position);
  s.rotation_rmse_deg = rms(all.rotation);
  s.velocity_rmse_m_s = rms(all.velocity);
  s.velocity_rmse_settled_m_s = rms(all.settled);
  s.nees_pose = mean(all.nees_pose);
  s.nees_state = mean(all.nees_state);
  s.nis = all.observations > 0 ? all.nis / all.observations : std::nan("");
  s.start_frames_max = percentile(all.start_frames, 1);
  s.tracking_us = times(all.tracking_us);
  s.starting_us = times(all.starting_us);
  return s;
}

std::string measure_json(const MeasureOptions& options, const MeasureResult& result) {
  const MeasureSummary s = summarize(result);
  const Json json{
      {"kind", options.mixed ? "mixed" : to_string(options.sequence.kind)},
      {"profile", options.profile == Profile::paper ? "paper" : "default"},
      {"first_seed", options.first_seed},
      {"seeds", s.flights},
      {"frames", s.frames},
      {"returned", s.returned},
      {"correct", s.correct},
      {"lost", s.lost},
      {"never_found", s.never_found},
      {"position_rmse_m", number_or_null(s.position_rmse_m)},
      {"rotation_rmse_deg", number_or_null(s.rotation_rmse_deg)},
      {"velocity_rmse_m_s", number_or_null(s.velocity_rmse_m_s)},
      {"velocity_rmse_settled_m_s", number_or_null(s.velocity_rmse_settled_m_s)},
      {"nees_pose_mean", number_or_null(s.nees_pose)},
      {"nees_state_mean", number_or_null(s.nees_state)},
      {"nis_mean", number_or_null(s.nis)},
      {"wrong", s.wrong},
      {"surely_wrong", s.surely_wrong},
      {"surely_wrong_frames", surely_wrong_frames(result)},
      {"start_frames_max", number_or_null(s.start_frames_max)},
      {"cpu_us",
       {{"tracking", as_json(s.tracking_us)}, {"starting", as_json(s.starting_us)}}}};
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
