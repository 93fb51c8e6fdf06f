#include "alight/geometry/rig.h"

#include <cmath>

#include "alight/base/bounds.h"

namespace alight {
namespace {

void finite(FirstComplaint& check, const std::string& name, const Vector3& v) {
  check.that(v.allFinite(), name + " holds a number that is not finite");
}

const Matrix3& R_HC() {
  // Optical x is the housing's -y, optical y its -z, optical z its x.
  static const Matrix3 R = (Matrix3() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished();
  return R;
}

}  // namespace

Result<void> Rig::validate() const {
  FirstComplaint check;
  const Intrinsics& k = camera.intrinsics;
  check.range("camera.width", k.width, 16, 10000);
  check.range("camera.height", k.height, 16, 10000);
  check.range("camera.fx", k.fx, 10, 1e5);
  check.range("camera.fy", k.fy, 10, 1e5);
  check.range("camera.cx", k.cx, 0, k.width);
  check.range("camera.cy", k.cy, 0, k.height);
  for (const double d : k.distortion) check.range("camera.distortion", d, -10, 10);
  for (const Vector2& uv : {Vector2(0, k.cy), Vector2(k.width - 1, k.cy),
                            Vector2(k.cx, 0), Vector2(k.cx, k.height - 1)}) {
    check.that(k.sees(uv),
               "camera.distortion folds the picture back before its edge, " +
                   std::to_string(std::lround((uv - Vector2(k.cx, k.cy)).norm())) +
                   " px from (cx, cy): the order is k1 k2 p1 p2 k3");
  }
  check.range("camera.rate_hz", timing.rate_hz, 1, 1000);
  check.range("camera.exposure_ms", timing.exposure_ms, 0.001, 1000 / timing.rate_hz);
  check.range("camera.readout_ms", timing.readout_ms, 0, 1000 / timing.rate_hz);
  if (gamma != 0) check.range("camera.gamma", gamma, kGammaLeast, kGammaMost);
  check.range("camera.frame_to_use_ms", timing.frame_to_use_ms, 0, 400);
  finite(check, "mount.xyz_m", camera.X_NC.translation());
  check.that(camera.X_NC.linear().allFinite(), "mount.rpy_deg is not finite");
  check.that(leds.size() >= 4, "leds: at least 4 are needed for a pose, found " +
                                   std::to_string(leds.size()));
  for (int i = 0; i < leds.size(); ++i) {
    const std::string name = "leds[" + std::to_string(i) + "].xyz_m";
    finite(check, name, leds.p_BL(i));
    check.range(name, leds.p_BL(i).norm(), 0, 5);
    for (int j = 0; j < i; ++j) {
      check.that((leds.p_BL(i) - leds.p_BL(j)).norm() > 1e-3,
                 "leds[" + std::to_string(j) + "] and leds[" + std::to_string(i) +
                     "] stand in the same place");
    }
  }
  for (int i = 0; i < 3; ++i) {
    check.range("led_frame.xyz_sd_mm", 1e3 * led_frame.shift_sd_m[i], 0, 100);
    check.range("led_frame.turn_sd_deg", led_frame.turn_sd_rad[i] / kDegree, 0, 90);
  }
  check.range("led_frame.size_sd_percent", 1e2 * led_frame.size_sd, 0, 50);
  check.range("drone.size_m", drone.size_m, 0.02, 5);
  check.range("drone.mass_kg", drone.mass_kg, 0.01, 100);
  for (int i = 0; i < 3; ++i) {
    check.range("drone.inertia_kg_m2", drone.inertia_kg_m2[i], 1e-7, 100);
  }
  const double most = drone.inertia_kg_m2.maxCoeff();
  check.that(2 * most <= drone.inertia_kg_m2.sum() * (1 + 1e-9),
             "drone.inertia_kg_m2: one is larger than the other two together, which no "
             "body's is");
  check.range("drone.arm_m", drone.arm_m, 0.01, 5);
  check.range("drone.propeller_radius_m", drone.propeller_radius_m, 0.005, 2);
  check.range("drone.motor_ms", drone.motor_ms, 1, 500);
  check.range("drone.thrust_to_weight", drone.thrust_to_weight, 1.2, 20);
  check.range("drone.tilt_max_deg", drone.tilt_max_deg, 5, 60);
  check.range("drone.gear_height_m", drone.gear_height_m, 0, 2);
  check.range("pad.size_m", pad.size_m, 0.05, 50);
  check.range("pad.above_floor_m", pad.above_floor_m, 0, 50);
  for (const Obstacle& box : pad.obstacles) {
    finite(check, "pad.obstacles", box.min_m);
    finite(check, "pad.obstacles", box.max_m);
    check.that((box.max_m - box.min_m).minCoeff() > 0,
               "pad.obstacles: max_m must exceed min_m on every axis");
  }
  check.range("limits.speed_m_s", limits.speed_m_s, 0.1, 100);
  check.range("limits.acceleration_m_s2", limits.acceleration_m_s2, 0.1, 100);
  if (tag) {
    check.range("tag.id", tag->id, 0, tag->family == TagFamily::tag36h11 ? 586 : 49);
    check.range("tag.size_m", tag->size_m, 0.005, 5);
    finite(check, "tag.xyz_m", tag->X_BT.translation());
    check.that(tag->X_BT.linear().allFinite(), "tag.rpy_deg is not finite");
  }
  return check.result();
}

const char* to_string(TagFamily family) {
  return family == TagFamily::tag36h11 ? "tag36h11" : "DICT_4X4_50";
}

Pose optical_from_housing(const Pose& X_NH) {
  return X_NH * make_pose(R_HC(), Vector3::Zero());
}

Pose housing_from_optical(const Pose& X_NC) {
  return X_NC * make_pose(R_HC().transpose(), Vector3::Zero());
}

Rig alan_rig() {
  Rig rig;
  rig.camera.X_NC = optical_from_housing(make_pose(
      from_rpy(0, -20 * kDegree, 180 * kDegree), Vector3(0.54446, 0, 0.0307)));
  rig.leds.leds = {
      {{0.0910385, -0.0787805, -0.0411861}, LedColor::green},
      {{0.062243, -0.0568124, -0.049127}, LedColor::green},
      {{0.0646012, -0.0355463, -0.048906}, LedColor::green},
      {{0.0631477, 0.0237785, -0.0121531}, LedColor::red},
      {{0.062466, 0.0437234, -0.0491548}, LedColor::red},
      {{0.0877848, 0.0719687, -0.0440807}, LedColor::red},
  };
  return rig;
}

}  // namespace alight
