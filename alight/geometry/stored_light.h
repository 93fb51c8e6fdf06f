#pragma once
#include <array>
#include <cstdint>

namespace alight {

/// A grey level for each grey level.
using GreyTable = std::array<std::uint8_t, 256>;

/// What a camera stores that stores light by a power of it (Rig::gamma), value =
/// 255 (light / 255) ^ (1 / gamma), as nearly all do whose pictures are made for people
/// to look at (IEC 61966-2-1: about 2.2). @pre gamma > 0
GreyTable stored_of_light(double gamma);

/// The inverse: light, to the next grey level.
GreyTable light_of_stored(double gamma);

}  // namespace alight
