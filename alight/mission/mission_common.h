#pragma once
#include "alight/base/time.h"
#include "alight/geometry/flat_state.h"
#include "alight/geometry/pose.h"
#include "alight/geometry/relative_state.h"
#include "alight/geometry/so3.h"

// What several of the mission's files use: private to them.
namespace alight {

inline constexpr Seconds kOrderEvery = 0.1;
// m/s against its reference: more than gusts do, less than an autopilot that brakes
// does within a tenth of a second or two.
inline constexpr double kObeys = 0.25;
inline constexpr const char* kTooFast =
    "the platform is too fast for the drone's speed limit: no landing";
inline constexpr const char* kOffItsWay =
    "far off its way: it goes on from where it is";
// Stalls of the radio in which an autopilot acts alone throw a landing over the pad.
inline constexpr const char* kLinkStalls = "the radio link stalls again and again";
// Why only the autopilot acts.
inline constexpr const char* kUnheard =
    "nothing heard from the drone: its autopilot acts alone";
inline constexpr const char* kFailsafe = "the autopilot's failsafe has taken over";
inline constexpr const char* kStoodStill =
    "the computer stood still: the autopilot lands";

inline double horizontal(const Vector3& v) { return v.head<2>().norm(); }
/// Half the side of the square about the pad's middle on whose edge it is.
inline double off_middle(const Vector3& p_NB) {
  return p_NB.head<2>().cwiseAbs().maxCoeff();
}

/// A reference to begin with from where a drone is, as fast and turned as it is.
inline FlatState as_it_flies(const RelativeState& x) {
  FlatState out;
  out.p_NB = x.p_NB;
  out.v_NB = x.v_NB;
  out.yaw = yaw_of(x.R_NB);
  return out;
}

}  // namespace alight
