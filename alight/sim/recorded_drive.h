#pragma once
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/platform_state.h"
#include "alight/geometry/pose_log.h"
#include "alight/sim/cubic_spline.h"

namespace alight {

/// A drive that was measured, as a smooth motion: cubic splines through its positions
/// and its roll, pitch and yaw. It begins at its first pose and stays at its last.
///
/// Where the recording is at rest at its ends, it is replayed to the instant. One that
/// was cut out of a longer drive is run up, and down, along its own track at 0.6 m/s^2.
class RecordedDrive {
 public:
  /// invalid_config, naming the time in the log: fewer than two poses, time that does
  /// not grow, a pad below the floor (z = 0) or tilted beyond 45 deg, more than 20 m/s
  /// or 20 m/s^2 (noise, or units that are not m and s).
  static Result<RecordedDrive> create(const PoseLog& log);

  /// `t` s into the drive.
  PlatformState at(Seconds t) const;
  Seconds duration() const;

 private:
  explicit RecordedDrive(const PoseLog& log);
  /// How far into the recording, and how fast it is played.
  struct Progress {
    double s, rate, acceleration;
  };
  Progress progress(Seconds t) const;
  PlatformState state(const Progress& at) const;

  Seconds length_ = 0;  ///< Of the recording.
  Seconds run_up_ = 0, run_down_ = 0;
  std::vector<CubicSpline> tracks_;  ///< x y z roll pitch yaw
};

}  // namespace alight
