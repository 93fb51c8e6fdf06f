#pragma once
#include <string>

#include "alight/base/result.h"
#include "alight/geometry/rig.h"
#include "alight/geometry/safety.h"

namespace alight {

/// Reads a rig file (CONTRACT: Rig). Fields that the file leaves out keep the defaults
/// of Rig; `camera`, `mount` and `leds` (or `marker_positions`, the field's layout
/// files:
/// `[{x, y, z}, ...]`, m, no colours) must be there. A layout file with nothing but
/// `marker_positions` gets the camera and the mount of alan_rig(). Checked by
/// Rig::validate.
Result<Rig> load_rig(const std::string& path);

/// What the same file says under `safety` (CONTRACT: Rig); defaults where it says
/// nothing. Checked by Safety::validate. What else the file holds is load_rig's to
/// judge.
Result<Safety> load_safety(const std::string& path, const Rig& rig);

/// The rig as the text of a rig file, every default written out; load_rig reads it back
/// to within rounding of the angles (1e-12 rad).
std::string rig_text(const Rig& rig);
/// The file's `safety`, to follow rig_text.
std::string safety_text(const Safety& safety);
Result<void> save_rig(const std::string& path, const Rig& rig,
                      const Safety& safety = {});

}  // namespace alight
