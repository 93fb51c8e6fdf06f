#pragma once
#include "alight/base/rng.h"
#include "alight/geometry/rig.h"
#include "alight/sim/scenario.h"

namespace alight {

/// What a rig file cannot say about the drone that flies.
///
/// Two body frames, both with the origin of the rig's B: the mechanical frame F
/// (airframe, rotors, feet, flight controller with its IMU) and the LED frame B, in
/// which the LEDs are listed and of which X_NB speaks. A rig file takes them for one.
struct TrueExtras {
  Matrix3 R_FB = Matrix3::Identity();  ///< LED frame in the mechanical frame.
  Vector3 p_FCom = Vector3::Zero();    ///< Centre of mass in F, m.
  double thrust_scale = 1;   ///< Of the maximum thrust that the rig file implies.
  double drag_per_s = 0.35;  ///< Linear air resistance over mass; no rig file has it.
};

struct TrueRig {
  Rig rig;  ///< LEDs in B, camera, mass as they are; all else as in the file.
  TrueExtras extras;
};

/// Draws the rig that flies around the one written down: LEDs, mount, principal point
/// and focal length normal; LED frame, mass, centre of mass and thrust uniform, for a
/// drone that is farther off is trimmed before it flies.
TrueRig draw_true_rig(const Rig& nominal, const RigErrorScenario& error, Rng rng);

}  // namespace alight
