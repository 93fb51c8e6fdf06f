#include "alight/sim/true_rig.h"

namespace alight {
namespace {

Vector3 normal3(Rng& rng, double sd) {
  const double x = rng.normal(0, sd);
  const double y = rng.normal(0, sd);
  const double z = rng.normal(0, sd);
  return {x, y, z};
}

}  // namespace

TrueRig draw_true_rig(const Rig& nominal, const RigErrorScenario& error, Rng rng) {
  TrueRig truth{nominal, {}};
  Rig& rig = truth.rig;

  Rng leds = rng.fork("leds");
  for (Led& led : rig.leds.leds) led.p_BL += normal3(leds, error.led_mm * 1e-3);

  Rng mount = rng.fork("mount");
  Pose X_NH = housing_from_optical(nominal.camera.X_NC);
  X_NH.translation() += normal3(mount, error.mount_mm * 1e-3);
  X_NH.linear() = X_NH.linear() * so3_exp(normal3(mount, error.mount_deg * kDegree));
  rig.camera.X_NC = optical_from_housing(X_NH);

  Rng lens = rng.fork("lens");
  const double zoom = 1 + lens.normal(0, error.focal);
  rig.camera.intrinsics.fx *= zoom;
  rig.camera.intrinsics.fy *= zoom;
  rig.camera.intrinsics.cx += lens.normal(0, error.principal_px);
  rig.camera.intrinsics.cy += lens.normal(0, error.principal_px);

  Rng frame = rng.fork("led frame");
  const double roll = frame.uniform(-1, 1) * error.led_frame_deg * kDegree;
  const double pitch = frame.uniform(-1, 1) * error.led_frame_deg * kDegree;
  const double yaw = frame.uniform(-1, 1) * error.led_frame_deg * kDegree;
  truth.extras.R_FB = from_rpy(roll, pitch, yaw);

  Rng body = rng.fork("body");
  const double heavier = 1 + body.uniform(-1, 1) * error.mass;
  rig.drone.mass_kg *= heavier;
  rig.drone.inertia_kg_m2 *= heavier;
  const double off_x = body.uniform(-1, 1);
  const double off_y = body.uniform(-1, 1);
  const double off_z = body.uniform(-1, 1);
  truth.extras.p_FCom = error.com_mm * 1e-3 * Vector3(off_x, off_y, off_z);
  truth.extras.thrust_scale = 1 + body.uniform(-1, 1) * error.thrust;
  // Nobody measures it; as uncertain again as the mass it is divided by.
  truth.extras.drag_per_s *= 1 + body.uniform(-1, 1) * 2 * error.mass;
  return truth;
}

}  // namespace alight
