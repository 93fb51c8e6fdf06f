#include "alight/sim/camera_sight.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kNominalExposureMs = 2;
constexpr double kRoughnessRad = 0.003;         // of the pad's surface
constexpr double kPropellerTransmission = 0.7;  // turning blades
constexpr double kArmRadius = 0.005;            // m
constexpr double kPropellerHeight = 0.015;      // m above the origin of B
const Vector3 kHull(0.045, 0.035, 0.03);        // half sizes, m, of an 18 cm drone

/// Distance between two segments (Ericson 2005, section 5.1.9, general position).
double segment_distance(const Vector3& a0, const Vector3& a1, const Vector3& b0,
                        const Vector3& b1) {
  const Vector3 d = a1 - a0, e = b1 - b0, r = a0 - b0;
  const double dd = d.dot(d), ee = e.dot(e), de = d.dot(e);
  const double er = e.dot(r), dr = d.dot(r);
  const double det = dd * ee - de * de;
  double s = det > 1e-12 ? std::clamp((de * er - dr * ee) / det, 0.0, 1.0) : 0.0;
  double t = (de * s + er) / ee;
  if (t < 0 || t > 1) {
    t = std::clamp(t, 0.0, 1.0);
    s = std::clamp((de * t - dr) / dd, 0.0, 1.0);
  }
  return (a0 + s * d - b0 - t * e).norm();
}

bool inside(const Vector3& p, const Obstacle& box) {
  return (p.array() >= box.min_m.array()).all() &&
         (p.array() <= box.max_m.array()).all();
}

}  // namespace

bool line_meets_box(const Vector3& a, const Vector3& b, const Obstacle& box) {
  double enter = 0, leave = 1;
  for (int k = 0; k < 3; ++k) {
    const double d = b[k] - a[k];
    double near = box.min_m[k] - a[k], far = box.max_m[k] - a[k];
    if (std::abs(d) < 1e-12) {
      if (near >= 0 || far <= 0) return false;
      continue;
    }
    near /= d;
    far /= d;
    if (near > far) std::swap(near, far);
    enter = std::max(enter, near);
    leave = std::min(leave, far);
  }
  return enter < leave - 1e-9;
}

double through_own_body(const DroneSpec& drone, const Vector3& p_BL,
                        const Vector3& p_BP) {
  const double size = drone.size_m / 0.18;
  const Obstacle hull{-size * kHull, size * kHull};
  if (!inside(p_BL, hull) && line_meets_box(p_BL, p_BP, hull)) return 0;

  double passed = 1;
  const Vector3 ray = p_BP - p_BL;
  for (const double sx : {1.0, -1.0}) {
    for (const double sy : {1.0, -1.0}) {
      const Vector3 motor(sx * drone.arm_m * std::sqrt(0.5),
                          sy * drone.arm_m * std::sqrt(0.5), 0);
      // An LED that sits on the arm is not hidden by it.
      const bool on_arm = segment_distance(p_BL, p_BL + Vector3(1e-6, 0, 0),
                                           Vector3::Zero(), motor) < 2 * kArmRadius;
      if (!on_arm &&
          segment_distance(p_BL, p_BP, Vector3::Zero(), motor) < kArmRadius) {
        return 0;
      }
      const double t = (kPropellerHeight - p_BL.z()) / ray.z();
      if (t > 0 && t < 1) {  // false for a level ray, whose t is infinite or NaN
        const Vector3 crossing = p_BL + t * ray;
        if ((crossing - motor).head<2>().norm() < drone.propeller_radius_m) {
          passed *= kPropellerTransmission;
        }
      }
    }
  }
  return passed;
}

Lens::Lens(const Intrinsics& intrinsics) : intrinsics_(intrinsics), widest_(0) {
  for (const double u : {0.0, intrinsics.width - 1.0}) {
    for (const double v : {0.0, intrinsics.height - 1.0}) {
      const double tangent = intrinsics.unproject({u, v}).head<2>().norm();
      if (std::isfinite(tangent)) widest_ = std::max(widest_, tangent);
    }
  }
  widest_ *= 1.1;
}

std::optional<Vector2> Lens::image(const Vector3& p_CP) const {
  if (!(p_CP.head<2>().norm() < widest_ * p_CP.z())) return std::nullopt;
  return intrinsics_.project(p_CP);
}

LedView::LedView(const CameraSimConfig& config, const Rig& true_rig, Rng rng)
    : config_(config),
      rig_(true_rig),
      lens_(true_rig.camera.intrinsics),
      X_CN_(true_rig.camera.X_NC.inverse()),
      exposure_scale_(
          (config.exposure_ms > 0 ? config.exposure_ms : true_rig.timing.exposure_ms) /
          kNominalExposureMs),
      falloff_(std::log(0.5) /
               std::log(std::cos(config.led_half_power_deg * kDegree))) {
  const double half = 0.5 * true_rig.pad.size_m;
  opaque_.push_back(
      {Vector3(-half, -half, -true_rig.pad.above_floor_m), Vector3(half, half, 0)});
  for (const Obstacle& obstacle : true_rig.pad.obstacles) opaque_.push_back(obstacle);
  const Vector3 p_NC = true_rig.camera.X_NC.translation();
  std::erase_if(opaque_, [&](const Obstacle& o) { return inside(p_NC, o); });
  for (int i = 0; i < true_rig.leds.size(); ++i) {
    strength_.push_back(config.led_gain[static_cast<std::size_t>(i)] *
                        std::exp(config.led_brightness_spread * rng.normal()));
  }
}

bool LedView::hidden_by_platform(const Vector3& p_NA, const Vector3& p_NB) const {
  return std::any_of(opaque_.begin(), opaque_.end(),
                     [&](const Obstacle& o) { return line_meets_box(p_NA, p_NB, o); });
}

double LedView::light_towards(int i, const Pose& X_NB, const Vector3& p_NP) const {
  const Vector3& p_BL = rig_.leds.p_BL(i);
  const Vector3 p_BP = X_NB.inverse() * p_NP;
  const double cosine = (p_BP - p_BL).normalized().dot(config_.led_axis_B);
  if (cosine <= 0) return 0;
  const double body =
      config_.hidden_by_body ? through_own_body(rig_.drone, p_BL, p_BP) : 1;
  return body * std::pow(cosine, falloff_);
}

bool LedView::in_sight(int i, const Pose& X_NB) const {
  const Vector3 p_NC = rig_.camera.X_NC.translation();
  return light_towards(i, X_NB, p_NC) > 0 &&
         !hidden_by_platform(p_NC, X_NB * rig_.leds.p_BL(i));
}

void LedView::append_spots(const RowScenes& scenes, std::vector<Spot>& out,
                           std::span<const double> gain) const {
  for (int i = 0; i < rig_.leds.size(); ++i) {
    const std::size_t first = out.size();
    append_direct(i, scenes, out);
    if (config_.pad_reflectance > 0) append_mirrored(i, scenes, out);
    if (gain.empty()) continue;
    for (std::size_t k = first; k < out.size(); ++k) {
      out[k].flux *= gain[static_cast<std::size_t>(i)];
    }
  }
}

void LedView::append_direct(int i, const RowScenes& scenes,
                            std::vector<Spot>& out) const {
  const auto image = [&](const SceneAt& scene) {
    return lens_.image(X_CN_ * (scene.X_NB * rig_.leds.p_BL(i)));
  };
  RowScenes::Instants room;
  const std::span<const SceneAt> exposure = scenes.where_seen(image, room);
  const Pose& X_NB = exposure[exposure.size() / 2].X_NB;
  const Vector3 p_NC = rig_.camera.X_NC.translation();
  if (!in_sight(i, X_NB)) return;
  const Vector3 p_CL = X_CN_ * (X_NB * rig_.leds.p_BL(i));
  Spot spot = spot_of(i, light_towards(i, X_NB, p_NC), p_CL.norm(), p_CL.z(), 0);
  for (const SceneAt& scene : exposure) {
    const auto uv = image(scene);
    if (!uv) return;
    spot.path.push_back(*uv);
  }
  out.push_back(spot);
}

void LedView::append_mirrored(int i, const RowScenes& scenes,
                              std::vector<Spot>& out) const {
  const Vector3 mirror(1, 1, -1);
  const auto image = [&](const SceneAt& scene) {
    const Vector3 p_NL_k = scene.X_NB * rig_.leds.p_BL(i);
    return lens_.image(X_CN_ * p_NL_k.cwiseProduct(mirror));
  };
  RowScenes::Instants room;
  const std::span<const SceneAt> exposure = scenes.where_seen(image, room);
  const Pose& X_NB = exposure[exposure.size() / 2].X_NB;
  const Vector3 p_NC = rig_.camera.X_NC.translation();
  const Vector3 p_NL = X_NB * rig_.leds.p_BL(i);
  if (p_NC.z() <= 0 || p_NL.z() <= 0) return;
  const Vector3 p_NM = p_NL.cwiseProduct(mirror);
  const double share = p_NC.z() / (p_NC.z() + p_NL.z());
  const Vector3 p_NH = p_NC + share * (p_NM - p_NC);  // where the ray meets the pad
  const double half = 0.5 * rig_.pad.size_m;
  if (std::abs(p_NH.x()) > half || std::abs(p_NH.y()) > half) return;
  if (hidden_by_platform(p_NC, p_NH) || hidden_by_platform(p_NH, p_NL)) return;

  // Half the reflectance from above, all of it at grazing angles (after Schlick 1994).
  const double cosine = p_NC.z() / (p_NH - p_NC).norm();
  const double reflected =
      config_.pad_reflectance * (0.5 + 0.5 * std::pow(1 - cosine, 5));
  const Vector3 p_CM = X_CN_ * p_NM;
  Spot spot = spot_of(i, reflected * light_towards(i, X_NB, p_NH), p_CM.norm(),
                      p_CM.z(), 2 * kRoughnessRad * (1 - share));
  for (const SceneAt& scene : exposure) {
    const auto uv = image(scene);
    if (!uv) return;
    spot.path.push_back(*uv);
  }
  out.push_back(spot);
}

Spot LedView::spot_of(int i, double strength, double r, double z,
                      double blur_rad) const {
  const double point = config_.psf_sd_px;
  // A disc of diameter d has a standard deviation of d / 4 along each axis.
  const double disc = lens_.focal_px() * 0.25e-3 * config_.led_diameter_mm / z;
  const double blur = lens_.focal_px() * blur_rad;
  const double peak = std::min(config_.led_peak_at_1m / (r * r), config_.led_peak_max);
  Spot spot;
  spot.sd_px = std::sqrt(point * point + disc * disc + blur * blur);
  spot.flux = 2 * kPi * point * point * peak * strength * exposure_scale_ *
              strength_[static_cast<std::size_t>(i)];
  spot.halo = config_.halo;
  spot.bgr = sensor_response(rig_.leds.color(i));
  return spot;
}

}  // namespace alight
