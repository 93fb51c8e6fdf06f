#pragma once
#include "alight/planning/planner.h"

namespace alight {

/// `config` as the rig allows it. Standard profile:
///   tilt_max_deg         so little that on the pad, and somewhere to begin from, every
///                        LED stays in the picture, leaning and turned by up to 10 deg;
///                        4 at the least
///   touch_down_height_m  above the drone's radius and its landing gear
PlannerConfig fitted_to(PlannerConfig config, const Rig& rig);

/// How far inside the picture, `view_border_px` from its edge, every LED of a drone at
/// p_NB stays, leaning as far as planned and turned by up to 10 deg. m; less than 0: it
/// does not.
double room_in_view(const PlannerConfig& config, const Rig& rig, const Vector3& p_NB);

/// Whether a drone that stands on the pad can be seen to land: every LED above the pad
/// and in the picture, `view_border_px` from its edge, while it leans by the least that
/// a landing takes.
/// @returns invalid_config: which LED, or by how much they are beyond which edge, and
///          what to turn.
Result<void> check_view_of_pad(const PlannerConfig& config, const Rig& rig);

}  // namespace alight
