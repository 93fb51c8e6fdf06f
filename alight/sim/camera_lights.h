#pragma once
#include <span>
#include <vector>

#include "alight/base/rng.h"
#include "alight/sim/camera_config.h"
#include "alight/sim/camera_sight.h"
#include "alight/sim/camera_spot.h"

namespace alight {

/// One bright piece of a ceiling light, between two louvres of its fixture.
struct RoomLight {
  Vector3 p_IA = Vector3::Zero();  ///< One end, m.
  Vector3 p_IB = Vector3::Zero();  ///< The other.
  double width_m = 0.03;
  double brightness = 800;  ///< Counts of a pixel it fills, at 2 ms.
  std::array<float, 3> bgr{1, 1, 1};
};

/// The lights of a room, fixed in I: fixtures of two tubes cut in pieces by louvres,
/// all along one direction of the room, 2.5 to 4 m up, and a few single lamps.
std::vector<RoomLight> make_room_lights(const CameraSimConfig& config, Rng rng);

/// Appends the images of the lights that the camera sees.
void append_light_spots(std::span<const RoomLight> lights, const Camera& camera,
                        const Lens& lens, double psf_sd_px, double exposure_scale,
                        const RowScenes& scenes, std::vector<Spot>& out);

}  // namespace alight
