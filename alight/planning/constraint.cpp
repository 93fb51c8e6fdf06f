#include "alight/planning/constraint.h"

#include <array>
#include <cstddef>

namespace alight {
namespace {

struct Text {
  const char* name;
  const char* start;
  const char* end;
  const char* met;
};

#define ALIGHT_TEXT(name)                                          \
  {                                                                \
#name, "the start violates " #name, "the end violates " #name, \
        "cannot meet " #name                                       \
  }

constexpr std::array<Text, kConstraints> kText{{
    ALIGHT_TEXT(free_space),
    ALIGHT_TEXT(floor),
    ALIGHT_TEXT(touch_down_height),
    ALIGHT_TEXT(pad),
    ALIGHT_TEXT(funnel),
    ALIGHT_TEXT(obstacle),
    ALIGHT_TEXT(view_left),
    ALIGHT_TEXT(view_right),
    ALIGHT_TEXT(view_upper),
    ALIGHT_TEXT(view_lower),
    ALIGHT_TEXT(view_depth),
    ALIGHT_TEXT(pad_shadow),
    ALIGHT_TEXT(speed),
    ALIGHT_TEXT(acceleration),
    ALIGHT_TEXT(tilt),
    ALIGHT_TEXT(thrust),
    ALIGHT_TEXT(body_rate),
    ALIGHT_TEXT(yaw_rate),
}};

#undef ALIGHT_TEXT

const Text& text(Constraint constraint) {
  return kText[static_cast<std::size_t>(constraint)];
}

}  // namespace

const char* to_string(Constraint constraint) { return text(constraint).name; }
const char* start_outside(Constraint constraint) { return text(constraint).start; }
const char* end_outside(Constraint constraint) { return text(constraint).end; }
const char* cannot_be_met(Constraint constraint) { return text(constraint).met; }

}  // namespace alight
