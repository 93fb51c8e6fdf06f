#pragma once
#include <memory>

#include "alight/base/result.h"
#include "alight/geometry/image.h"
#include "alight/geometry/rig.h"
#include "alight/vision/pose_from_leds.h"

namespace alight {

enum class PeerMethod : std::uint8_t { kf_less, aruco, apriltag };
const char* to_string(PeerMethod method);

/// What a peer says of one picture.
struct PeerReport {
  bool tracked = false;
  bool initialized = false;  ///< Found without help of earlier pictures.
  Pose X_NB = Pose::Identity();
  Matrix6 cov = Matrix6::Identity();  ///< Of (dp_NB, dR in B), as the method claims.
  FixedVector<LedObservation, kMaxLeds> seen;
  FixedVector<RefusedBlob, kMaxRefused> refused;
  double reprojection_px = 0;  ///< rms
  int blobs = 0;
  const char* why_not = "";  ///< When not tracked.
};

/// A method from pictures to poses.
class Peer {
 public:
  virtual ~Peer() = default;
  /// Pictures in order of time; `depth` may be empty.
  virtual PeerReport fuse(Time t, const ImageView& color, const DepthView& depth) = 0;
};

/// @returns invalid_config: a rig that does not hold or lacks the tag that the method
///          looks for, or a build without the method's library (which package to
///          install is said).
Result<std::unique_ptr<Peer>> create_peer(PeerMethod method, const Rig& rig);

}  // namespace alight
