#pragma once
#include <array>

#include "alight/peers/peer.h"

namespace alight {

/// Corners of a tag's black square in the picture, px: as one sees it upright, from the
/// top left one on, with the clock.
using TagCorners = std::array<Vector2, 4>;

/// Pose from the corners of the rig's tag: the two answers of a plane's homography
/// (Collins and Bartoli 2014, OpenCV's IPPE for squares), the one that fits better.
/// Writes X_NB, its covariance for corners known to `sd_px`, the residual and
/// `tracked`, or `why_not`.
/// @pre rig.tag
void pose_from_tag(const Rig& rig, const TagCorners& corners, double sd_px,
                   PeerReport& out);

/// The tags' own peers; null when the library was not there to build with.
std::unique_ptr<Peer> make_aruco(const Rig& rig);
std::unique_ptr<Peer> make_apriltag(const Rig& rig);

}  // namespace alight
