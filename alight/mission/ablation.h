#pragma once
#include <array>
#include <cstdint>

#include "alight/mission/landing_config.h"

namespace alight {

/// A part of the default profile that can be left out, to measure what it buys. For
/// simulations: a drone that is to land flies with all of them.
enum class Part : std::uint8_t {
  replanning,           ///< A landing is flown as it was planned at first.
  escape,               ///< Goes around on a straight line, commits at a fixed height.
  feed_forward,         ///< Feedback, weight and disturbance only.
  delay_compensation,   ///< The controller acts on the state of now.
  platform_prediction,  ///< The last odometry is taken for now, and for plans the
                        ///< platform goes straight on.
  calibration           ///< The rig is taken as written down.
};

const char* to_string(Part part);
inline constexpr std::array<Part, 6> kParts{
    Part::replanning,          Part::escape,
    Part::feed_forward,        Part::delay_compensation,
    Part::platform_prediction, Part::calibration};

/// `config` without `part`.
LandingConfig without(Part part, LandingConfig config);

}  // namespace alight
