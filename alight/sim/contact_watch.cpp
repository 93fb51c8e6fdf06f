#include "alight/sim/contact_watch.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr Time kNever = -1'000'000'000'000;
constexpr Time kStanding =
    50'000'000;                       // a foot that touched this long ago still stands
constexpr Time kFlown = 200'000'000;  // without a touch, motors on
constexpr double kClear = 0.05;       // m
constexpr double kTiltMax = 60 * kDegree;

const char* name_of(Part ours, Part theirs) {
  static constexpr const char* kNames[3][5] = {
      {"foot on pad", "foot on chassis", "foot on camera", "foot on obstacle",
       "foot on floor"},
      {"body on pad", "body on chassis", "body on camera", "body on obstacle",
       "body on floor"},
      {"rotor on pad", "rotor on chassis", "rotor on camera", "rotor on obstacle",
       "rotor on floor"}};
  return kNames[static_cast<int>(ours)]
               [static_cast<int>(theirs) - static_cast<int>(Part::pad)];
}

double tilt_of(const Matrix3& R) { return std::acos(std::clamp(R(2, 2), -1.0, 1.0)); }

}  // namespace

ContactWatch::ContactWatch(const DroneSpec& drone, const PadSpec& pad)
    : drone_(drone), pad_(pad) {
  foot_on_pad_.fill(kNever);
  foot_on_floor_.fill(kNever);
}

void ContactWatch::strike(const char* what, Time t) {
  if (report_.struck) return;
  report_.struck = true;
  report_.struck_at = t;
  report_.struck_what = what;
}

void ContactWatch::step(const FixedVector<Touch, 32>& touches, const TruthState& before,
                        const TruthState& now, const Matrix3& R_FB) {
  R_FB_ = R_FB;
  for (const Touch& touch : touches) {
    last_touch_ = now.t;
    if (touch.ours != Part::foot) {
      strike(name_of(touch.ours, touch.theirs), now.t);
      continue;
    }
    const auto foot = static_cast<std::size_t>(touch.foot);
    if (touch.theirs == Part::pad) {
      foot_on_pad_[foot] = now.t;
      if (report_.flown && !report_.touched_down) {
        report_.touched_down = true;
        report_.first_contact = now.t;
        report_.relative_speed_m_s = before.v_NB.norm();
        report_.tilt_deg = tilt_of(before.X_NB.linear() * R_FB.transpose()) / kDegree;
        report_.yaw_error_deg = yaw_of(before.X_NB.linear()) / kDegree;
      }
    } else if (touch.theirs == Part::floor) {
      foot_on_floor_[foot] = now.t;
      if (report_.flown) report_.landed_elsewhere = true;
    } else {
      strike(name_of(touch.ours, touch.theirs), now.t);
    }
  }
  if (tilt_of(now.X_IB.linear() * R_FB.transpose()) > kTiltMax) {
    strike("tilt over 60 deg", now.t);
  }

  const auto standing = [&](const std::array<Time, 4>& last) {
    return static_cast<int>(std::count_if(
        last.begin(), last.end(), [&](Time t) { return now.t - t < kStanding; }));
  };
  report_.feet_on_pad = standing(foot_on_pad_);
  report_.feet_on_floor = standing(foot_on_floor_);
  const double over_pad = now.X_NB.translation().z() - drone_.gear_height_m;
  const double over_floor = now.X_IB.translation().z() - drone_.gear_height_m;
  const bool clear = std::abs(over_pad) > kClear && over_floor > kClear;
  if (now.motors_running && clear && now.t - last_touch_ > kFlown) report_.flown = true;
}

bool ContactWatch::standing_on_pad(const TruthState& now) const {
  if (report_.feet_on_pad < 4) return false;
  const Pose X_NF = now.X_NB * make_pose(R_FB_.transpose(), Vector3::Zero());
  for (int i = 0; i < 4; ++i) {
    const Vector3 p_N = X_NF * Scene::foot(drone_, i);
    if (p_N.head<2>().cwiseAbs().maxCoeff() > pad_.size_m / 2) return false;
  }
  return true;
}

}  // namespace alight
