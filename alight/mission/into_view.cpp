#include "alight/mission/into_view.h"

#include <algorithm>

namespace alight {
namespace {

constexpr double kBorderPx = 40;
// So far below where it is thought to be a drone may sink in half a second unseen, m.
constexpr double kRoom = 0.12;

}  // namespace

bool in_view(const Camera& camera, const Constellation& leds, const Vector3& p_NB) {
  for (int i = 0; i < leds.size(); ++i) {
    const auto uv =
        project_led(camera, make_pose(Matrix3::Identity(), p_NB), leds.p_BL(i));
    if (!uv || !camera.intrinsics.contains(*uv, kBorderPx)) return false;
  }
  return true;
}

IntoView::IntoView(const Rig& rig, const Vector3& end_N)
    : camera_(rig.camera), leds_(rig.leds), end_N_(end_N) {}

Vector3 IntoView::first_N(const Vector3& p_NB) const {
  if (in_view(camera_, leds_, p_NB)) return end_N_;
  Vector3 level = end_N_;
  level.z() = std::min(level.z(), p_NB.z() + kRoom);
  return in_view(camera_, leds_, level) ? level : end_N_;
}

}  // namespace alight
