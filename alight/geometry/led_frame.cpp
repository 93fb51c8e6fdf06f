#include "alight/geometry/led_frame.h"

#include <bit>

#include "alight/geometry/rig.h"

namespace alight {

const char* to_string(LedColor color) {
  switch (color) {
    case LedColor::none:
      return "none";
    case LedColor::red:
      return "red";
    case LedColor::green:
      return "green";
    case LedColor::blue:
      return "blue";
    case LedColor::white:
      return "white";
  }
  return "none";
}

const char* to_string(Refusal refusal) {
  switch (refusal) {
    case Refusal::no_led_near:
      return "no_led_near";
    case Refusal::wrong_color:
      return "wrong_color";
    case Refusal::too_small:
      return "too_small";
    case Refusal::too_large:
      return "too_large";
    case Refusal::other_is_nearer:
      return "other_is_nearer";
    case Refusal::cut_by_edge:
      return "cut_by_edge";
    case Refusal::off_constellation:
      return "off_constellation";
    case Refusal::gated:
      return "gated";
    case Refusal::stray:
      return "stray";
  }
  return "no_led_near";
}

int LedFrame::led_count() const {
  int count = 0;
  for (const LedObservation& o : seen) count += std::popcount(o.leds);
  return count;
}

std::optional<Vector2> project_observation(const Camera& camera, const Pose& X_NB,
                                           const Constellation& leds,
                                           std::uint16_t which, Matrix26* J) {
  Vector2 uv = Vector2::Zero();
  if (J != nullptr) J->setZero();
  int count = 0;
  for (int i = 0; i < leds.size(); ++i) {
    if (((which >> i) & 1) == 0) continue;
    Matrix26 J_i;
    const auto uv_i = project_led(camera, X_NB, leds.p_BL(i), J ? &J_i : nullptr);
    if (!uv_i) return std::nullopt;
    uv += *uv_i;
    if (J != nullptr) *J += J_i;
    ++count;
  }
  if (count == 0) return std::nullopt;
  if (J != nullptr) *J /= count;
  return uv / count;
}

}  // namespace alight
