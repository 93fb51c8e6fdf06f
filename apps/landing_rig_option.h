#pragma once
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "alight/mission/mission_config.h"
#include "alight/planning/rig_fit.h"
#include "rig_option.h"

/// The rig of a command that lands on it: as load_seen_rig, and where a landing could
/// not be seen it is refused, where only one that hardly leans could, a line says so;
/// the paper's profile looks at neither.
inline alight::Result<alight::Rig> load_landing_rig(const std::string& path,
                                                    const std::string& profile,
                                                    const char* command) {
  // Platforms in tight turns ask for less.
  constexpr double kFewDegrees = 8;
  auto rig = load_seen_rig(path, command);
  if (!rig || profile == "paper") return rig;
  const auto named = [&](const alight::Error& error) {
    return alight::fail(error.fault, path + ": " + error.detail);
  };
  if (auto good = alight::check_view_of_pad({}, *rig); !good)
    return named(good.error());
  if (auto good = alight::check_places({}, *rig); !good) return named(good.error());
  if (auto good = alight::check_pictures(rig->timing); !good) {
    return named(good.error());
  }
  const double tilt = alight::fitted_to({}, *rig).tilt_max_deg;
  if (tilt < std::min(kFewDegrees, rig->drone.tilt_max_deg)) {
    std::ostringstream text;
    text << std::setprecision(2) << "camera: leaning by more than " << tilt
         << " deg the drone would leave the picture on the pad or before it: nothing "
            "that "
            "turns or brakes harder than "
         << alight::kGravity * std::tan(tilt * alight::kDegree)
         << " m/s^2 is landed on";
    std::cerr << "alight " << command << ": warning: " << path << ": " << text.str()
              << '\n';
  }
  return rig;
}
