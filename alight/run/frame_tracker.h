#pragma once
#include <memory>
#include <optional>
#include <string_view>

#include "alight/mission/landing_config.h"
#include "alight/mission/landing_io.h"

namespace alight {

/// From pictures to poses: the project's filter, or a peer.
enum class TrackMethod : std::uint8_t { iekf, kf_less, aruco, apriltag };
const char* to_string(TrackMethod method);
std::optional<TrackMethod> track_method(std::string_view name);

struct FrameTrackerOptions {
  TrackMethod method = TrackMethod::iekf;
  Profile profile = Profile::standard;  ///< Of iekf; the peers have none.
  /// For so long from the first picture on the drone stands on the pad, facing the
  /// camera: iekf measures the rig by it. 0: nothing is known of where it is.
  double parked_s = 0;
};

/// Any of the methods behind one call, with nothing known but the pictures (and where
/// the drone is parked).
class FrameTracker {
 public:
  /// @returns invalid_config: of the rig, of a peer that this build or rig lacks, or
  ///          of options that do not go together.
  static Result<FrameTracker> create(const FrameTrackerOptions& options,
                                     const Rig& rig);
  FrameTracker(FrameTracker&&) noexcept;
  FrameTracker& operator=(FrameTracker&&) noexcept;
  ~FrameTracker();

  /// Pictures in order of time. Peers tell no velocity: theirs is the change since the
  /// last picture, with a covariance to match.
  void fuse(const CameraFrame& frame, FrameReport& out);

  /// Whether the rig has been measured by the parked drone.
  bool measured_rig() const;
  /// By what power the camera is taken to store light (Rig::gamma), told or found out.
  double gamma() const;

 private:
  struct Parts;
  explicit FrameTracker(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace alight
