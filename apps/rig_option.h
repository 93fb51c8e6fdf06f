#pragma once
#include <iostream>
#include <string>

#include "alight/io/rig_yaml.h"
#include "alight/vision/constellation_check.h"

/// The rig of a command that looks for its LEDs. What a person should know of where the
/// LEDs sit goes to standard error, a line each; LEDs from which no pose can be told
/// are refused.
/// @returns the complaint of load_rig; invalid_config, naming the file, for such LEDs.
inline alight::Result<alight::Rig> load_seen_rig(const std::string& path,
                                                 const char* command) {
  auto rig = alight::load_rig(path);
  if (!rig) return rig;
  const auto report = alight::check_constellation(rig->leds, rig->camera.intrinsics);
  if (!report.refusal.empty()) {
    return alight::fail(alight::Fault::invalid_config, path + ": " + report.refusal);
  }
  for (const std::string& warning : report.warnings) {
    std::cerr << "alight " << command << ": warning: " << path << ": " << warning
              << '\n';
  }
  return rig;
}
