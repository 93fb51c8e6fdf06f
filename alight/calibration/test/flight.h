#pragma once
#include <cmath>
#include <vector>

#include "alight/base/rng.h"
#include "alight/calibration/observed_frame.h"
#include "alight/geometry/rig.h"

namespace alight {

/// A drone that weaves in front of the camera, 0.5 to 1.4 m from it, and yaws.
inline Pose weaving(double t, double phase) {
  const double r = 0.95 + 0.45 * std::sin(0.9 * t + phase);
  const Vector3 p(0.54 - 0.95 * r, 0.3 * r * std::sin(1.7 * t + phase),
                  0.05 + 0.38 * r + 0.15 * r * std::cos(2.1 * t + phase));
  return make_pose(from_rpy(0.15 * std::sin(2.3 * t), 0.15 * std::cos(1.9 * t + phase),
                            0.45 * std::sin(1.1 * t + 2 * phase)),
                   p);
}

/// The rig with each LED's coordinates off by a normal error.
inline Rig drawn_rig(double sd_m, Rng& rng) {
  Rig rig = alan_rig();
  for (Led& led : rig.leds.leds) {
    for (int k = 0; k < 3; ++k) led.p_BL[k] += rng.normal(0, sd_m);
  }
  return rig;
}

/// What a camera says of such a flight, with noise of `sd_px`, each LED by itself.
inline std::vector<ObservedFrame> flown(const Rig& truth, int frames, double sd_px,
                                        Rng& rng, double phase = 0) {
  std::vector<ObservedFrame> out;
  for (int f = 0; f < frames; ++f) {
    ObservedFrame frame;
    const Pose X_NB = weaving(0.1 * f, phase);
    frame.X_NB = X_NB;
    frame.X_NB.translation().x() += 0.02;  // what the rig as written would have said
    frame.X_NB.linear() = X_NB.linear() * from_rpy(0.02, -0.03, 0.01);
    for (int i = 0; i < truth.leds.size(); ++i) {
      const auto uv = project_led(truth.camera, X_NB, truth.leds.p_BL(i));
      if (!uv) continue;
      LedObservation o;
      o.leds = static_cast<std::uint16_t>(1u << i);
      o.uv = *uv + Vector2(rng.normal(0, sd_px), rng.normal(0, sd_px));
      o.cov = 0.01 * Matrix2::Identity();
      const Vector3 p_CL = truth.camera.X_NC.inverse() * (X_NB * truth.leds.p_BL(i));
      o.depth_m = p_CL.z();
      frame.seen.push_back(o);
    }
    out.push_back(frame);
  }
  return out;
}

}  // namespace alight
