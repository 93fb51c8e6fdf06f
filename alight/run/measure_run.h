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

/// Shares, errors, NEES, times, and every frame with a wrong pose told with confidence.
std::string measure_json(const MeasureOptions& options, const MeasureResult& result);

/// A row a frame: `seed,frame,range_m,speed_m_s,tracked,found,position_m,rotation_deg,
/// velocity_m_s,nees_pose,nees_state,nis_sum,observations,cpu_us`.
std::string measure_rows(const MeasureResult& result);

}  // namespace alight
