#include "alight/run/reproduce_flight.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace alight {
namespace {

constexpr Seconds kDriveStep = 0.002;
constexpr Seconds kDifference = 0.02;  // a controller takes so long to tilt anyway
constexpr Seconds kSide = 2.4;         // of the rectangle
constexpr double kDrag = 0.35;         // 1/s, as the simulated drone's
// Before the lens, as far as the depth camera's cut of the `paper` profile lets see.
constexpr double kRangeMin = 0.5, kRangeMax = 2.3;
constexpr double kSway = 0.012;  // m

struct Named {
  PaperRow row;
  const char* name;
};
constexpr Named kNames[] = {{PaperRow::static_block, "static_block"},
                            {PaperRow::static_random, "static_random"},
                            {PaperRow::dynamic_block, "dynamic_block"},
                            {PaperRow::dynamic_random, "dynamic_random"},
                            {PaperRow::circle, "circle"},
                            {PaperRow::landing, "landing"}};

/// From 0 to 1 with as little jerk as can be (Flash and Hogan 1985).
double minimum_jerk(double s) {
  s = std::clamp(s, 0.0, 1.0);
  return s * s * s * (10 + s * (6 * s - 15));
}

}  // namespace

const char* to_string(PaperRow row) {
  for (const Named& named : kNames) {
    if (named.row == row) return named.name;
  }
  return "landing";
}

std::optional<PaperRow> paper_row(std::string_view name) {
  for (const Named& named : kNames) {
    if (name == named.name) return named.row;
  }
  return std::nullopt;
}

bool is_flown(PaperRow row) {
  return row == PaperRow::dynamic_block || row == PaperRow::circle ||
         row == PaperRow::landing;
}

ScriptedFlight::Wave::Wave(Rng rng, double slowest_hz, double fastest_hz) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    amplitude[k] = rng.uniform(0.5, 1);
    sum += amplitude[k];
    rate[k] = 2 * kPi * rng.uniform(slowest_hz, fastest_hz);
    phase[k] = rng.uniform(0, 2 * kPi);
  }
  for (double& a : amplitude) a /= sum;
}

double ScriptedFlight::Wave::operator()(Seconds t) const {
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += amplitude[k] * std::sin(rate[k] * t + phase[k]);
  return sum;
}

double ScriptedFlight::Wave::integral(Seconds t) const {
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    sum += amplitude[k] / rate[k] *
           (std::cos(phase[k]) - std::cos(rate[k] * t + phase[k]));
  }
  return sum;
}

ScriptedFlight::ScriptedFlight(PaperRow row, const Rig& rig, const Matrix3& R_FB,
                               Rng rng)
    : row_(row),
      R_FB_(R_FB),
      p_NC_(rig.camera.X_NC.translation()),
      height_m_(rig.pad.above_floor_m),
      range_(rng.fork("range"), 0.05, 0.15),
      azimuth_(rng.fork("azimuth"), 0.06, 0.2),
      elevation_(rng.fork("elevation"), 0.06, 0.2),
      yaw_(rng.fork("yaw"), 0.05, 0.2),
      sway_{Wave(rng.fork("sway x"), 0.3, 0.9), Wave(rng.fork("sway y"), 0.3, 0.9),
            Wave(rng.fork("sway z"), 0.3, 0.9)},
      speed_(rng.fork("speed"), 0.03, 0.15),
      turn_(rng.fork("turn"), 0.05, 0.2) {
  // Parked by hand.
  Rng stand = rng.fork("stand");
  const double off_x = stand.uniform(-0.03, 0.03), off_y = stand.uniform(-0.03, 0.03);
  parked_ = Vector3(off_x, off_y, rig.drone.gear_height_m);
  parked_yaw_ = stand.uniform(-5, 5) * kDegree;

  Rng block = rng.fork("block");
  const double near = -0.45 + block.uniform(-0.08, 0.08);
  const double far = -1.65 + block.uniform(-0.1, 0.1);
  const double half = 0.4 + block.uniform(-0.05, 0.05);
  const double up = 0.6 + block.uniform(-0.1, 0.1);
  const double side = block.chance(0.5) ? 1 : -1;
  const Vector3 round[4] = {{near, side * half, up},
                            {near, -side * half, up},
                            {far, -side * half, up},
                            {far, side * half, up}};
  const auto first = block.bits() % 4;
  for (std::size_t k = 0; k < 4; ++k) corners_[k] = round[(first + k) % 4];

  Vector2 p = Vector2::Zero();
  for (Seconds t = -1; t < kEnd + 1; t += kDriveStep) {
    driven_.push_back(p);
    if (row_ != PaperRow::dynamic_random) continue;
    const Seconds middle = t + 0.5 * kDriveStep;
    const double heading = 0.6 * turn_.integral(middle);
    const double speed = 0.45 * (1 + 0.9 * speed_(middle));
    p += kDriveStep * speed * Vector2(std::cos(heading), std::sin(heading));
  }
}

Pose ScriptedFlight::platform(Seconds t) const {
  if (row_ != PaperRow::dynamic_random) {
    return make_pose(Matrix3::Identity(), Vector3(0, 0, height_m_));
  }
  const double at = std::max((t + 1) / kDriveStep, 0.0);
  const auto i = std::min(static_cast<std::size_t>(at), driven_.size() - 2);
  const Vector2 p =
      driven_[i] + (at - static_cast<double>(i)) * (driven_[i + 1] - driven_[i]);
  return make_pose(from_rpy(0, 0, 0.6 * turn_.integral(t)),
                   Vector3(p.x(), p.y(), height_m_));
}

Vector3 ScriptedFlight::path(Seconds t) const {
  Vector3 p;
  if (row_ == PaperRow::static_random) {
    const double middle = 0.5 * (kRangeMin + kRangeMax);
    const double r = middle + (kRangeMax - middle) * range_(t);
    const double azimuth = 26 * kDegree * azimuth_(t);
    const double elevation = (20 + 16 * elevation_(t)) * kDegree;
    p = p_NC_ + r * Vector3(-std::cos(elevation) * std::cos(azimuth),
                            std::cos(elevation) * std::sin(azimuth),
                            std::sin(elevation));
  } else {
    const double sides = std::max(t, 0.0) / kSide;
    const auto i = static_cast<std::size_t>(sides);
    // It rests a tenth of the time at each corner.
    const double share = minimum_jerk((sides - static_cast<double>(i)) / 0.9);
    p = corners_[i % 4] + share * (corners_[(i + 1) % 4] - corners_[i % 4]);
  }
  for (int k = 0; k < 3; ++k) p[k] += kSway * sway_[k](t);
  return p;
}

Vector3 ScriptedFlight::place(Seconds t) const {
  const double share = minimum_jerk((t - kParked) / (kOnPath - kParked));
  return parked_ + share * (path(t) - parked_);
}

Vector3 ScriptedFlight::place_I(Seconds t) const { return platform(t) * place(t); }

SceneAt ScriptedFlight::at(Seconds t) const {
  const double h = kDifference;
  const Vector3 before = place_I(t - h), p = place_I(t), after = place_I(t + h);
  SceneAt scene;
  scene.X_IN = platform(t);
  const double share = minimum_jerk((t - kParked) / (kOnPath - kParked));
  const double turned = (row_ == PaperRow::static_random ? 18 : 6) * kDegree * yaw_(t);
  const double yaw =
      yaw_of(scene.X_IN.linear()) + parked_yaw_ + share * (turned - parked_yaw_);
  Vector3 up = Vector3::UnitZ();
  if (t > kParked) {  // the pad holds it up until then
    const Vector3 v = (after - before) / (2 * h);
    const Vector3 a = (after - 2 * p + before) / (h * h);
    up = (a + kDrag * v + kGravity * Vector3::UnitZ()).normalized();
  }
  const Vector3 heading(std::cos(yaw), std::sin(yaw), 0);
  const Vector3 y = up.cross(heading).normalized();
  Matrix3 R_IF;
  R_IF << y.cross(up), y, up;
  scene.X_NB = scene.X_IN.inverse() * make_pose(R_IF * R_FB_, p);
  return scene;
}

}  // namespace alight
