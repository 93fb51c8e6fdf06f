/// Bytes as a rig file: read or refused in words; a rig that is read is written so that
/// it reads back the same, judged by what judges constellations, and looked for or
/// refused.
#include "alight/io/rig_yaml.h"
#include "alight/vision/constellation_check.h"
#include "alight/vision/led_finder.h"
#include "tests/fuzz/input_file.h"

using namespace alight;

namespace {

void require_same(const Rig& a, const Rig& b) {
  require(a.leds.size() == b.leds.size(), "LEDs are lost");
  for (int i = 0; i < a.leds.size(); ++i) {
    require(a.leds.p_BL(i) == b.leds.p_BL(i), "an LED moves");
    require(a.leds.color(i) == b.leds.color(i), "an LED changes its colour");
  }
  const Pose& X = a.camera.X_NC;
  const Pose& Y = b.camera.X_NC;
  const double far = 1 + X.translation().norm();
  require((X.translation() - Y.translation()).norm() <= 1e-9 * far, "the mount moves");
  require((X.linear() - Y.linear()).norm() <= 1e-9, "the mount turns");
  require(a.camera.intrinsics.fx == b.camera.intrinsics.fx, "the lens changes");
  require(a.drone.mass_kg == b.drone.mass_kg, "the mass changes");
  require(a.pad.obstacles.size() == b.pad.obstacles.size(), "obstacles are lost");
  require(a.tag.has_value() == b.tag.has_value(), "the tag is lost");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string path = input_file("rig.yaml", data, size);
  const auto rig = load_rig(path);
  if (!rig) {
    require_told(rig.error(), path);
    return -1;  // Not kept: what is refused leads nowhere deeper.
  }
  const std::string text = rig_text(*rig);
  const std::string again_path = input_file("again.yaml", text.data(), text.size());
  const auto again = load_rig(again_path);
  require(again.has_value(), "what was written is not read: " + text);
  require_same(*rig, *again);

  const auto report = check_constellation(rig->leds, rig->camera.intrinsics);
  require(report.refusal.find("nan") == std::string::npos, report.refusal);
  for (const std::string& warning : report.warnings) {
    require(warning.find("nan") == std::string::npos, warning);
  }
  const auto finder = LedFinder::create({}, rig->camera, rig->leds, rig->pad.size_m);
  if (!finder) require(!finder.error().detail.empty(), "refused without a reason");
  return 0;
}
