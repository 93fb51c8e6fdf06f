#pragma once
#include <array>
#include <span>

#include "alight/estimation/rest_calibration.h"

namespace alight {

/// A light in a picture, and the LEDs that it may show by its colour.
struct RestLight {
  Vector2 uv = Vector2::Zero();
  std::uint16_t may_be = 0;  ///< Bit i: LED i.
};

/// Which light shows which LED; -1: none.
using RestAssociation = std::array<int, kMaxLeds>;

/// Tells the LEDs of a drone that stands on its pad from one another, and from lamps
/// and from their own twins in a glossy pad, by all that is known of how it stands and
/// of how far its rig may be off: near the lens the misfit of a rig that is off by a
/// few mm is as large as the way from an LED to its neighbour, and a pose that is
/// fitted to some of them alone moves on by one.
///
/// Lights are taken for LEDs one after the other, each where those before it leave it
/// to be expected (joint compatibility, Neira and Tardos 2001), linearized about the
/// best answers in turn; the best by likelihood, LEDs that are not seen and lights that
/// are none allowed for.
///
/// No allocation.
/// @param lights  At most kMaxRestLights are looked at.
/// @returns too_few_points (no answer has at least `leds_least` LEDs), ambiguous (one
///          that says otherwise is nearly as likely, or there are too many).
inline constexpr std::size_t kMaxRestLights = 64;
Result<RestAssociation> associate_at_rest(const RestCalibrationConfig& config,
                                          const Camera& camera,
                                          const Constellation& leds,
                                          std::span<const RestLight> lights,
                                          const Pose& X_NB_rest, int leds_least);

}  // namespace alight
