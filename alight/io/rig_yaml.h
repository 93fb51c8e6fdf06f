#pragma once
#include <string>

#include "alight/base/result.h"
#include "alight/geometry/rig.h"

namespace alight {

/// Reads a rig file (CONTRACT: Rig). Fields that the file leaves out keep the defaults
/// of Rig; `camera`, `mount` and `leds` (or `marker_positions`, the field's layout
/// files:
/// `[{x, y, z}, ...]`, m, no colours) must be there. A layout file with nothing but
/// `marker_positions` gets the camera and the mount of alan_rig(). Checked by
/// Rig::validate.
Result<Rig> load_rig(const std::string& path);

/// The rig as the text of a rig file, every default written out; load_rig reads it back
/// to within rounding of the angles (1e-12 rad).
std::string rig_text(const Rig& rig);
Result<void> save_rig(const std::string& path, const Rig& rig);

}  // namespace alight
