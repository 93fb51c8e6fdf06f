#pragma once
#include <string>

#include "alight/base/result.h"
#include "alight/sim/scenario.h"

namespace alight {

/// Reads a scenario file (CONTRACT: Scenario); what it leaves out keeps its default.
Result<Scenario> load_scenario(const std::string& path);
Result<Scenario> parse_scenario(const std::string& text, const std::string& name);

/// The scenario as the text of a file, every default written out.
std::string scenario_text(const Scenario& scenario);

}  // namespace alight
