#include "alight/geometry/stored_light.h"

#include <cassert>
#include <cmath>

namespace alight {

GreyTable light_of_stored(double gamma) {
  assert(gamma > 0);
  GreyTable table;
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double light = 255 * std::pow(static_cast<double>(i) / 255, gamma);
    table[i] = static_cast<std::uint8_t>(std::lround(light));
  }
  return table;
}

GreyTable stored_of_light(double gamma) { return light_of_stored(1 / gamma); }

}  // namespace alight
