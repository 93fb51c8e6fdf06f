#pragma once
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/pose_log.h"
#include "alight/geometry/rig.h"
#include "alight/run/frame_tracker.h"

namespace alight {

/// Recorded pictures through a method, with nothing known but the pictures.
struct TrackRunOptions {
  std::string source;  ///< Folder or video (io/image_source.h).
  Rig rig;
  FrameTrackerOptions tracker;
  bool depth = false;  ///< Use the depth pictures; refused when there are none.
};

/// One picture of the run, for plots.
struct TrackedPicture {
  Time t = 0;
  bool tracked = false;
  int leds = 0;
  double reprojection_px = 0;
};

struct TrackRunResult {
  PoseLog estimate;    ///< X_NB of the tracked pictures.
  std::string frames;  ///< frames.jsonl (CONTRACT).
  std::vector<TrackedPicture> pictures;
  int tracked = 0;
  int searches = 0;           ///< Times the drone was found without a prior.
  bool measured_rig = false;  ///< By the parked drone.
  double gamma = 1;           ///< As Rig::gamma, told or found out.
  Seconds longest_gap = 0;
  double us_median = 0;  ///< Of a picture in memory, by the machine's clock: many are
                         ///< read first (made_in_bulk.h), then tracked one by one.
  double us_p99 = 0;
  double reprojection_px = 0;  ///< Median over the tracked pictures, NaN if none.

  double tracked_share() const {
    return pictures.empty() ? 0 : tracked / static_cast<double>(pictures.size());
  }
};

/// @returns io or invalid_input, naming file and line, for a source that cannot be read
///          to its end; invalid_config for a rig that does not hold and as
///          FrameTracker::create. That the drone is
///          never found is no failure: `tracked` tells.
Result<TrackRunResult> run_track(const TrackRunOptions& options);

/// The summary as JSON: what `alight track --json` prints and `result.json` holds.
std::string track_json(const TrackRunOptions& options, const TrackRunResult& result);

/// Leaves rig.yaml, estimate.tum, frames.jsonl, track.png and, last, result.json.
Result<void> save_track(const std::string& folder, const TrackRunOptions& options,
                        const TrackRunResult& result);

}  // namespace alight
