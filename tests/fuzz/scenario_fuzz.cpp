/// Bytes as a scenario: read or refused in words; what is read is written so that it
/// reads back the same.
#include "alight/run/scenario_yaml.h"
#include "tests/fuzz/input_file.h"

using namespace alight;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // Beside it lies a drive that a scenario may name.
  static const std::string drive = [] {
    const std::string text =
        "t,x,y,z,yaw_deg\n0,0,0,0.26,0\n1,0.5,0,0.26,0\n2,1,0,0.26,9\n";
    return input_file("d.csv", text.data(), text.size());
  }();
  const std::string path = input_file("scenario.yaml", data, size);
  const auto scenario = load_scenario(path);
  if (!scenario) {
    require(!scenario.error().detail.empty(), "refused without a reason");
    return 0;
  }
  const std::string text = scenario_text(*scenario);
  const auto again = parse_scenario(text, path);
  require(again.has_value(), "what was written is not read: " + text);
  require(scenario_text(*again) == text, "it changes when read back: " + text);
  return 0;
}
