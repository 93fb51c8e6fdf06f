#pragma once
#include "alight/base/result.h"
#include "alight/base/time.h"
#include "alight/platform/path.h"

namespace alight {

/// Limits and gains of UgvController.
struct UgvControllerConfig {
  double acceleration_m_s2 = 0.6;
  double brake_m_s2 = 2.0;  ///< when wished to be slower; for bends as it accelerates
  double yaw_acceleration_rad_s2 = 3.0;
  double yaw_rate_max_rad_s = 1.5;
  double cross_track_gain = 4.0;  ///< 1/m^2: heading rate per m of offset, per m driven
  double heading_gain = 3.0;      ///< 1/m: heading rate per rad, per m driven
  double turn_gain = 4.0;         ///< 1/s: turning in place

  Result<void> validate() const;
};

/// Where the vehicle is, on the floor.
struct UgvPose {
  Vector2 p_I = Vector2::Zero();
  double yaw = 0;  ///< rad
};

/// What a differential drive executes.
struct UgvCommand {
  double v = 0;  ///< m/s, forward
  double w = 0;  ///< rad/s, to the left
};

/// Drives a differential-drive vehicle along a path: curvature and yaw rate fed
/// forward, offset and heading fed back, speed and yaw rate ramped. Corners turned in
/// place are braked for, turned and left again.
class UgvController {
 public:
  UgvController(const UgvControllerConfig& config, const Path& path);

  /// One step of `dt` s towards `speed_wish` m/s (not below 0).
  UgvCommand step(const UgvPose& pose, double speed_wish, Seconds dt);

  double travelled() const { return s_; }  ///< Arc length along the path, m.

 private:
  double allowed_speed(double wish) const;

  UgvControllerConfig config_;
  Path path_;
  UgvCommand command_;
  double s_ = 0;
  double corner_;         ///< Arc length of the corner ahead.
  bool turning_ = false;  ///< In place, at corner_.
};

}  // namespace alight
