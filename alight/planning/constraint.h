#pragma once
#include <cstdint>

namespace alight {

/// Everything that bounds a landing trajectory, by what it means.
enum class Constraint : std::uint8_t {
  free_space,         ///< The cubic free space S.
  floor,              ///< Above the floor the platform stands on.
  touch_down_height,  ///< Split of S at h_T.
  pad,                ///< Above the pad's surface.
  funnel,             ///< The last decimetres come from above the pad.
  obstacle,           ///< A plane between the drone and a box on the platform.
  view_left,
  view_right,
  view_upper,
  view_lower,
  view_depth,    ///< In front of the lens.
  pad_shadow,    ///< Above the ray from the lens over the pad's far edge.
  speed,         ///< Of v_IB.
  acceleration,  ///< Of a_IB.
  tilt,          ///< Of the thrust against z of N.
  thrust,        ///< Least and most that the rotors give.
  body_rate,     ///< About the body's x and y, through flatness.
  yaw_rate,      ///< About its z.
};
inline constexpr int kConstraints = 18;

/// Static texts: "view_upper", "the start lies outside: view_upper", ...
const char* to_string(Constraint constraint);
const char* start_outside(Constraint constraint);
const char* end_outside(Constraint constraint);
const char* cannot_be_met(Constraint constraint);

}  // namespace alight
