#pragma once
#include "alight/geometry/rig.h"

namespace alight {

/// A drone at p_NB, level and turned as N, shows every LED well inside the picture.
bool in_view(const Camera& camera, const Constellation& leds, const Vector3& p_NB);

/// The way back of a drone that has left the picture. By the lens the picture is
/// narrow: on the straight way to a point that is farther off and higher, the drone
/// rises past its upper edge before it comes in from the side. So it goes off first,
/// then up.
class IntoView {
 public:
  /// @param end_N  Where the way leads, in view.
  IntoView(const Rig& rig, const Vector3& end_N);

  /// Where in N a drone believed at p_NB goes first: below the end, a little higher
  /// than it is; or at once to the end, if it is in the picture already or that place
  /// is not.
  Vector3 first_N(const Vector3& p_NB) const;

 private:
  Camera camera_;
  Constellation leds_;
  Vector3 end_N_;
};

}  // namespace alight
