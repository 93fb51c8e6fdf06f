#include "alight/platform/ugv_controller.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "alight/base/bounds.h"

namespace alight {
namespace {

constexpr double kCornerReached = 0.004;  ///< m before the corner where turning begins
constexpr double kTurned = 0.01;          ///< rad left when turning ends
constexpr double kPreview = 0.1;          ///< s that curvature is looked ahead

double approach(double value, double target, double most) {
  return value + std::clamp(target - value, -most, most);
}

Vector2 direction(double heading) { return {std::cos(heading), std::sin(heading)}; }

}  // namespace

Result<void> UgvControllerConfig::validate() const {
  constexpr double kLeast = 1e-6;
  return check_bounds(
      {{"acceleration_m_s2", acceleration_m_s2, kLeast, 100},
       {"brake_m_s2", brake_m_s2, kLeast, 100},
       {"yaw_acceleration_rad_s2", yaw_acceleration_rad_s2, kLeast, 100},
       {"yaw_rate_max_rad_s", yaw_rate_max_rad_s, kLeast, 100},
       {"cross_track_gain", cross_track_gain, kLeast, 100},
       {"heading_gain", heading_gain, kLeast, 100},
       {"turn_gain", turn_gain, kLeast, 100}});
}

UgvController::UgvController(const UgvControllerConfig& config, const Path& path)
    : config_(config), path_(path), corner_(path.next_corner(0)) {
  assert(config.validate());
}

double UgvController::allowed_speed(double wish) const {
  const double braking = 0.9 * config_.acceleration_m_s2;
  double speed = wish;
  // Bends ahead, as far as it takes to brake for them.
  const double reach = wish * wish / (2 * braking) + wish * kPreview;
  for (int k = 0; k <= 8; ++k) {
    const double ahead = reach * k / 8;
    const double bend = std::abs(path_.at(s_ + ahead).curvature);
    if (bend < 1e-9) continue;
    const double in_bend = 0.95 * config_.yaw_rate_max_rad_s / bend;
    speed = std::min(speed, std::sqrt(in_bend * in_bend + 2 * braking * ahead));
  }
  if (std::isfinite(corner_)) {
    speed = std::min(speed, std::sqrt(2 * braking * std::max(0.0, corner_ - s_)));
  }
  return speed;
}

UgvCommand UgvController::step(const UgvPose& pose, double speed_wish, Seconds dt) {
  const double dv = config_.acceleration_m_s2 * dt;
  const double dw = config_.yaw_acceleration_rad_s2 * dt;
  if (!path_.moves()) return command_ = {};

  if (turning_) {
    const double goal = path_.at(corner_ + 1e-6).heading;
    const double left = wrap_angle(goal - pose.yaw);
    const double brake =
        std::sqrt(2 * 0.8 * config_.yaw_acceleration_rad_s2 * std::abs(left));
    const double fastest = std::min(
        {config_.yaw_rate_max_rad_s, brake, config_.turn_gain * std::abs(left)});
    // Told to stand still, it does, also within a corner.
    const double rate = speed_wish > 0 ? std::copysign(fastest, left) : 0.0;
    command_.v = approach(command_.v, 0, dv);
    command_.w = approach(command_.w, rate, dw);
    if (std::abs(left) < kTurned && std::abs(command_.w) < 0.1) {
      turning_ = false;
      s_ = corner_ + 1e-6;
      corner_ = path_.next_corner(s_);
    }
    return command_;
  }

  PathPoint here = path_.at(s_);
  s_ = std::max(0.0, s_ + direction(here.heading).dot(pose.p_I - here.p_I));
  s_ = std::min(s_, corner_ - 1e-6);
  here = path_.at(s_);

  const double wish = std::max(0.0, speed_wish);
  const double braked = std::max(wish, command_.v - config_.brake_m_s2 * dt);
  command_.v = std::min(approach(command_.v, allowed_speed(wish), dv), braked);
  if (corner_ - s_ < kCornerReached) {
    turning_ = true;
    return command_;
  }
  const Vector2 t = direction(here.heading);
  const Vector2 offset = pose.p_I - here.p_I;
  const double cross = t.x() * offset.y() - t.y() * offset.x();  // positive to the left
  const double heading_error = wrap_angle(pose.yaw - here.heading);
  const double preview =
      path_.at(std::min(s_ + command_.v * kPreview, corner_ - 1e-6)).curvature;
  const double rate = command_.v * (preview - config_.cross_track_gain * cross -
                                    config_.heading_gain * std::sin(heading_error));
  command_.w = approach(
      command_.w,
      std::clamp(rate, -config_.yaw_rate_max_rad_s, config_.yaw_rate_max_rad_s), dw);
  return command_;
}

}  // namespace alight
