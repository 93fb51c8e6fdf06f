#pragma once
#include <optional>
#include <string>

#include "alight/calibration/led_adjustment.h"
#include "alight/calibration/thrust_axis.h"

namespace alight {

struct ConstellationConfig {
  LedAdjustmentConfig adjustment;
  bool use_thrust = true;   ///< The thrust's way tells how the whole is turned,
  ThrustAxisConfig thrust;  ///< where the drone flies freely.
  bool use_merged = false;  ///< Blobs of several LEDs, too, as the middle of theirs.
  int hold_out = 5;         ///< Every how many-th frame is held out, at least 2.
  // What is too weak to be used.
  int frames_min = 12;
  int alone_min = 6;            ///< Frames that show an LED apart from its neighbours.
  double led_sd_max_m = 0.001;  ///< Of a coordinate, but for the size: the largest
                                ///< that is accepted.
};

/// Where the size of the constellation comes from.
enum class SizeFrom { distances, depth, prior };
const char* to_string(SizeFrom from);

struct ConstellationFit {
  Constellation leds;
  std::vector<Vector3> sd_m;  ///< Of each LED, apart from the motion of the whole.
  Vector3 shift_sd_m = Vector3::Zero();   ///< Of the whole, by the prior alone.
  Vector3 turn_sd_rad = Vector3::Zero();  ///< The same, about x, y, z of B, by the
                                          ///< prior and the thrust,
  std::optional<ThrustAxis> thrust;       ///< if that has told,
  std::string no_thrust;                  ///< else why it has not.
  double size_sd = 0;                     ///< Relative.
  LedFrameSpec whole() const { return {shift_sd_m, turn_sd_rad, size_sd}; }
  SizeFrom size_from = SizeFrom::prior;
  double depth_scale = 1;  ///< Measured depth over true.
  int frames = 0;          ///< Used,
  int frames_dropped = 0;  ///< and not: what they show contradicts the others.
  int observations = 0;
  int rejected = 0;
  std::vector<int> alone;    ///< Frames that show an LED apart from its neighbours.
  double rms_before_px = 0;  ///< With the rig as written, poses fitted.
  double rms_px = 0;
  double rms_held_out_px = 0;  ///< LEDs from the other frames, only poses fitted.
  int frames_held_out = 0;
};

/// Whether what was measured is between LEDs there are, and about as far as `written`
/// has them apart. @returns invalid_config, naming the distance
Result<void> distances_hold(const LedAdjustmentConfig& config,
                            const Constellation& written);

/// The LEDs of a rig from what a flight shows of them.
///
/// @param written  The rig file's, the prior.
/// @param start    To begin with; of an earlier pass, or `written`.
/// @returns too_few_points or degenerate for weak data, with what to record instead;
///          no_convergence; invalid_config for distances that do not hold.
Result<ConstellationFit> calibrate_constellation(const ConstellationConfig& config,
                                                 const Camera& camera,
                                                 const Constellation& written,
                                                 const Constellation& start,
                                                 std::span<const ObservedFrame> frames);

}  // namespace alight
