#pragma once
#include <optional>
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/calibration/observed_frame.h"
#include "alight/geometry/rig.h"
#include "alight/vision/pose_from_leds.h"

namespace alight {

/// Something that stands where its pose in N is about known, K, as the camera sees it:
/// the drone parked on its pad, a tag at the pad's centre.
struct StandingView {
  Pose X_CK = Pose::Identity();
  Matrix6 cov = Matrix6::Identity();  ///< Of (dp_CK in C, dR in K).
  Pose X_NK = Pose::Identity();       ///< As it was placed.
};

/// How well it was placed, standard deviations.
struct MountConfig {
  // Anew each time it is placed:
  double place_sd_m = 0.005;  ///< x and y
  double heading_sd_deg = 2;
  // The same each time, for they belong to the drone: LED frame against its feet.
  double height_sd_m = 0.002;
  double tilt_sd_deg = 1.5;  ///< Roll and pitch.
  double own_place_sd_m = 0.002;
  double own_heading_sd_deg = 1;
  // What is too weak to be used.
  double position_sd_max_m = 0.04;
  double rotation_sd_max_deg = 4;

  static MountConfig parked() { return {}; }
  /// A tag has no feet.
  static MountConfig tag();
};

struct MountFit {
  Pose X_NC = Pose::Identity();
  Vector3 position_sd_m = Vector3::Zero();  ///< x, y, z of N.
  Vector3 rpy_sd_deg = Vector3::Zero();     ///< Of the housing, as in the rig file.
  // Where it stands against where it was placed, rms over the views.
  double off_before_m = 0, off_before_deg = 0;      ///< Mount as written,
  double off_m = 0, off_deg = 0;                    ///< as found,
  double off_held_out_m = 0, off_held_out_deg = 0;  ///< as found from the other views;
                                                    ///< NaN with one view alone.
};

/// Roll, pitch and yaw, deg, of the camera's housing in N: the rig file's mount.
Vector3 mount_rpy_deg(const Pose& X_NC);

/// What the camera says of a body at rest, from its pictures: LEDs averaged by LED.
/// @param led_sd_m  How well their places in B are known.
/// @returns too_few_points (fewer than four LEDs seen apart), degenerate (it moves).
Result<StandingView> parked_view(const Rig& rig, std::span<const ObservedFrame> frames,
                                 double led_sd_m, double heading_deg);

/// The camera's place in N from what stands in known places, most probable (maximum a
/// posteriori): the places, what the body's own frame hides (the same at every
/// heading) and the mount together.
///
/// One view tells height, roll and pitch as well as the body stands upright; forward,
/// left and heading only as well as it was placed. Views at several headings, turned
/// about the pad's centre, tell the body's own errors from the mount's.
///
/// @returns too_few_points (no view), degenerate (sd beyond what is of use, or views
///          that contradict each other), no_convergence.
Result<MountFit> calibrate_mount(const MountConfig& config, const Pose& X_NC_written,
                                 const std::vector<StandingView>& views);

}  // namespace alight
