#include <cstdio>

#include "alight/eval/statistics.h"
#include "alight/geometry/rig.h"
#include "alight/io/rig_yaml.h"

/// Uses a header, a compiled room, a room with private dependencies and an installed
/// file.
int main() {
  const auto rig = alight::load_rig(ALIGHT_CONFIG_DIR "/rigs/alan.yaml");
  if (!rig) {
    std::fprintf(stderr, "%s\n", rig.error().detail.c_str());
    return 1;
  }
  const bool same_rig = rig->leds.size() == alight::alan_rig().leds.size();
  const bool turned = alight::so3_exp({0, 0, 1}).isApprox(alight::from_rpy(0, 0, 1));
  return same_rig && turned && alight::wilson_interval(400, 400).low > 0.99 ? 0 : 1;
}
