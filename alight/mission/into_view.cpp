#include "alight/mission/into_view.h"

#include <algorithm>

namespace alight {
namespace {

constexpr double kBorderPx = 40;
// So far below where it is thought to be a drone may sink in half a second unseen, m.
constexpr double kRoom = 0.12;
constexpr double kStep = 0.02;  // m

}  // namespace

bool in_view(const Camera& camera, const Constellation& leds, const Vector3& p_NB) {
  for (int i = 0; i < leds.size(); ++i) {
    const auto uv =
        project_led(camera, make_pose(Matrix3::Identity(), p_NB), leds.p_BL(i));
    if (!uv || !camera.intrinsics.contains(*uv, kBorderPx)) return false;
  }
  return true;
}

double working_distance(const Rig& rig) {
  return std::max(rig.camera.X_NC.translation().head<2>().norm(),
                  2.5 * rig.drone.size_m);
}

IntoView::IntoView(const Rig& rig, const Vector3& end_N)
    : camera_(rig.camera),
      leds_(rig.leds),
      end_N_(end_N),
      nearest_(working_distance(rig)) {}

Vector3 IntoView::first_N(const Vector3& p_NB) const {
  if (in_view(camera_, leds_, p_NB)) return end_N_;
  const Vector3 axis_N = camera_.X_NC.linear().col(2);
  const Vector3& lens_N = camera_.X_NC.translation();
  const double farthest = std::max(nearest_, axis_N.dot(end_N_ - lens_N));
  const double along = axis_N.dot(p_NB - lens_N);
  Vector3 middle = lens_N + std::clamp(along, nearest_, farthest) * axis_N;
  middle.z() = std::max(middle.z(), p_NB.z());
  if (!in_view(camera_, leds_, middle)) return end_N_;
  const double highest = std::max(middle.z(), p_NB.z() + kRoom);
  while (middle.z() < highest) {
    const Vector3 higher =
        middle + Vector3(0, 0, std::min(kStep, highest - middle.z()));
    if (!in_view(camera_, leds_, higher)) break;
    middle = higher;
  }
  return middle;
}

}  // namespace alight
