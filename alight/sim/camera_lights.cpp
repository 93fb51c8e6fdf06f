#include "alight/sim/camera_lights.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kPitch = 0.12;  // m, from piece to piece
constexpr double kPiece = 0.085;
constexpr double kTubesApart = 0.25;
constexpr double kSingles = 0.1;  // share of lamps that belong to no fixture

std::array<float, 3> off_white(Rng& rng) {
  const double warm = rng.uniform(-0.08, 0.08);
  return {static_cast<float>(0.94 - warm), static_cast<float>(0.94),
          static_cast<float>(0.94 + 0.75 * warm)};
}

/// A place on the ceiling, even over the disc but not right above the start.
Vector2 somewhere(const CameraSimConfig& config, Rng& rng) {
  const double inner = 1.5;
  const double r = std::sqrt(
      rng.uniform(inner * inner, config.room_radius_m * config.room_radius_m));
  const double angle = rng.uniform(0, 2 * kPi);
  return {r * std::cos(angle), r * std::sin(angle)};
}

}  // namespace

std::vector<RoomLight> make_room_lights(const CameraSimConfig& config, Rng rng) {
  std::vector<RoomLight> lights;
  const auto wanted = static_cast<std::size_t>(config.lights);
  const double height = rng.uniform(2.5, 4);
  const double heading = rng.uniform(0, kPi);
  const Vector3 along(std::cos(heading), std::sin(heading), 0);
  const Vector3 across(-along.y(), along.x(), 0);

  while (lights.size() < wanted) {
    RoomLight light;
    light.bgr = off_white(rng);
    const Vector2 place = somewhere(config, rng);
    const Vector3 centre(place.x(), place.y(), height);
    const double fixture = rng.uniform(300, 1200);
    if (rng.chance(kSingles)) {
      light.p_IA = centre;
      light.p_IB = centre + rng.uniform(0.02, 0.12) * along;
      light.brightness = fixture;
      lights.push_back(light);
      continue;
    }
    const int pieces = static_cast<int>(rng.uniform(3, 9));  // along a tube
    for (const double side : {-0.5, 0.5}) {
      for (int k = 0; k < pieces && lights.size() < wanted; ++k) {
        const Vector3 start =
            centre + side * kTubesApart * across + (k - 0.5 * pieces) * kPitch * along;
        light.p_IA = start;
        light.p_IB = start + kPiece * along;
        light.brightness = fixture * rng.uniform(0.7, 1.2);
        lights.push_back(light);
      }
    }
  }
  return lights;
}

void append_light_spots(std::span<const RoomLight> lights, const Camera& camera,
                        const Lens& lens, double psf_sd_px, double exposure_scale,
                        const RowScenes& scenes, std::vector<Spot>& out) {
  const Pose X_CN = camera.X_NC.inverse();
  const Intrinsics& picture = lens.intrinsics();
  RowScenes::Instants room;
  Pose X_CI, X_CI_begin, X_CI_end;
  bool known = false;
  for (const RoomLight& light : lights) {
    if (!known || scenes.rolling()) {
      const auto image = [&](const SceneAt& scene) {
        return lens.image(X_CN * scene.X_IN.inverse() * light.p_IA);
      };
      const std::span<const SceneAt> exposure = scenes.where_seen(image, room);
      X_CI = X_CN * exposure[exposure.size() / 2].X_IN.inverse();
      X_CI_begin = X_CN * exposure.front().X_IN.inverse();
      X_CI_end = X_CN * exposure.back().X_IN.inverse();
      known = true;
    }
    const Vector3 p_CA = X_CI * light.p_IA;
    const auto a = lens.image(p_CA);
    const auto b = lens.image(X_CI * light.p_IB);
    if (!a || !b || !picture.contains(*a, -10) || !picture.contains(*b, -10)) continue;

    Spot& spot = out.emplace_back();
    const double length = (*b - *a).norm();
    const double width = lens.focal_px() * light.width_m / p_CA.z();
    double variance = psf_sd_px * psf_sd_px + width * width / 16;
    // The platform's motion smears a light as well; its extent along the tube does not
    // matter, so the smear is taken as even in all directions.
    const auto from = lens.image(X_CI_begin * light.p_IA);
    const auto to = lens.image(X_CI_end * light.p_IA);
    if (from && to) variance += (*to - *from).squaredNorm() / 12;
    spot.sd_px = std::sqrt(variance);
    // The drawn path ends half a width before the light does.
    const double inset = std::min(0.5, 0.25 * width / std::max(length, 1e-6));
    spot.path.push_back(*a + inset * (*b - *a));
    spot.path.push_back(*b - inset * (*b - *a));
    spot.flux =
        light.brightness * exposure_scale * std::max(length, 0.3 * width) * width;
    spot.halo = 0;
    spot.bgr = light.bgr;
  }
}

}  // namespace alight
