#pragma once
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/pose_log.h"
#include "alight/run/frame_tracker.h"
#include "alight/run/reproduce_flight.h"

namespace alight {

/// One sequence of the paper's evaluation, from pixels: a row and a seed. Every method
/// gets the same pictures of a rig that is not quite as written; nothing is aligned.
struct ReproduceOptions {
  PaperRow row = PaperRow::circle;
  std::uint64_t seed = 1;
  Rig rig;
  bool tags = true;  ///< Run the tag's method too, on the rows of Table II.
};

/// How far one method was from the truth.
struct MethodScore {
  std::string method;
  int frames = 0;    ///< In the part that is scored.
  int returned = 0;  ///< Of these: with a pose,
  int correct = 0;   ///< within 0.15 m and 15 deg (CONTRACT: tracked).
  /// Over the poses returned, NaN if none: the paper's ATE of one run.
  double position_rmse_m = 0;
  double rotation_rmse_deg = 0;
  double velocity_rmse_m_s = 0;
  double position_correct_rmse_m = 0;  ///< Over the correct ones.
  double rotation_correct_rmse_deg = 0;
  double us_p50 = 0, us_p99 = 0;  ///< Processor time of a picture; `loop`: of the
                                  ///< whole step that used it, by the clock.
  PoseLog estimate;
};

struct ReproduceResult {
  std::string outcome;  ///< Of the landing; empty for scripted flights.
  double seconds = 0;   ///< Scored.
  double range_min_m = 0, range_max_m = 0;  ///< From the lens, scored part.
  double speed_max_m_s = 0;                 ///< |v_NB|, scored part.
  PoseLog truth;                            ///< X_NB, scored part.
  std::vector<MethodScore> methods;
};

/// The methods: `loop` (the default as it flew, with odometry, set-points and the rig
/// measured at rest; flown rows only), `parked` (the default on the pictures alone, the
/// rig measured while the drone stands on its pad), `default` (on the colour pictures
/// alone), `paper`, `kf-less`, `aruco`.
Result<ReproduceResult> reproduce(const ReproduceOptions& options);

/// A document that script/reproduce reads.
std::string reproduce_json(const ReproduceOptions& options,
                           const ReproduceResult& result);

/// Paths from above and from the side, and the errors over time, as PNG.
Result<void> save_reproduce_figure(const std::string& path,
                                   const ReproduceOptions& options,
                                   const ReproduceResult& result);

}  // namespace alight
