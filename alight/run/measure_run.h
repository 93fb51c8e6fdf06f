#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/run/sequence_score.h"

namespace alight {

/// The estimator over many rendered flights, all in memory.
struct MeasureOptions {
  static constexpr int kSeedsMost = 1'000'000, kJobsMost = 1024;
  SequenceOptions sequence;  ///< Its seed aside.
  Profile profile = Profile::standard;
  std::uint64_t first_seed = 1;
  int seeds = 20;
  bool mixed = false;  ///< Each seed draws kind, lights, strays, dead LEDs, blackout.
  int jobs = 0;        ///< Threads; 0: one a core.

  Result<void> validate() const;
};

/// The options with which `seed` is rendered.
SequenceOptions measured_sequence(const MeasureOptions& options, std::uint64_t seed);

struct MeasuredSequence {
  SequenceOptions options;
  std::vector<FrameScore> frames;
};

struct MeasureResult {
  std::vector<MeasuredSequence> sequences;  ///< By seed.
};

/// `progress` is called after each sequence, by one thread at a time. The number of
/// threads changes no figure but CPU times.
Result<MeasureResult> run_measure(const MeasureOptions& options,
                                  const std::function<void(int done)>& progress = {});

struct Times {
  int count = 0;
  double p50 = 0, p99 = 0, max = 0;  ///< us; NaN without any.
};

/// Over all frames of all flights; errors over those with a pose, NaN without any.
struct MeasureSummary {
  int flights = 0;
  int frames = 0;
  double returned = 0;  ///< Share of the frames with a pose,
  double correct = 0;   ///< with a pose that is not wrong.
  int lost = 0;         ///< Frames without a pose after the first one with.
  int never_found = 0;  ///< Flights.
  int wrong = 0;
  int surely_wrong = 0;
  double position_rmse_m = 0;
  double rotation_rmse_deg = 0;
  double velocity_rmse_m_s = 0;
  double velocity_rmse_settled_m_s = 0;  ///< From 0.5 s after the first pose.
  double nees_pose = 0, nees_state = 0;  ///< Means.
  double nis = 0;                        ///< Mean of an observation.
  double start_frames_max = 0;           ///< Until the first pose, the worst flight.
  Times tracking_us, starting_us;        ///< With the drone in track, and without.
};
MeasureSummary summarize(const MeasureResult& result);

/// The summary, and every frame with a wrong pose told with confidence.
std::string measure_json(const MeasureOptions& options, const MeasureResult& result);

/// A row a frame: `seed,frame,range_m,speed_m_s,tracked,found,position_m,rotation_deg,
/// velocity_m_s,nees_pose,nees_state,nis_sum,observations,cpu_us`.
std::string measure_rows(const MeasureResult& result);

}  // namespace alight
