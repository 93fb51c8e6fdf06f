#include "alight/sim/platform_motion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>

namespace alight {
namespace {

// Of a vehicle that brakes, starts and swerves as hard as its wheels allow.
constexpr double kHardPace = 3;   // m/s^2
constexpr double kHardTurn = 10;  // rad/s^2

double approach(double value, double target, double most) {
  return value + std::clamp(target - value, -most, most);
}

PathConfig path_config(const PlatformScenario& config) {
  PathConfig path;
  path.radius_m = config.radius_m;
  path.side_m = config.side_m;
  path.corner_radius_m = config.corner_radius_m;
  switch (config.kind) {
    case PlatformKind::straight:
    case PlatformKind::boat:
      path.kind = PathKind::straight;
      break;
    case PlatformKind::circle:
      path.kind = PathKind::circle;
      break;
    case PlatformKind::block:
      path.kind = PathKind::block;
      break;
    case PlatformKind::eight:
      path.kind = PathKind::eight;
      break;
    case PlatformKind::still:
    case PlatformKind::recorded:
      path.kind = PathKind::still;
      break;
  }
  return path;
}

UgvControllerConfig controller_config(const PlatformScenario& config) {
  UgvControllerConfig ugv;
  ugv.brake_m_s2 = config.brake_m_s2;
  ugv.yaw_rate_max_rad_s = config.yaw_rate_max_deg_s * kDegree;
  return ugv;
}

}  // namespace

PlatformMotion::PlatformMotion(const PlatformScenario& config, double height,
                               bool moving, Rng rng)
    : config_(config),
      height_(height),
      moving_(moving),
      wish_(config.speed_m_s),
      path_(path_config(config)),
      controller_(controller_config(config), path_) {
  state_.X_IN.translation().z() = height;
  if (config_.kind == PlatformKind::boat) {
    sea_.emplace(config_.sea, rng);
    step_boat({}, 0);
  }
  if (config_.kind == PlatformKind::recorded) {
    auto drive = RecordedDrive::create(config_.drive);
    assert(drive);
    drive_.emplace(std::move(*drive));
    step_recorded(0);
  }
}

void PlatformMotion::wish_speed(double m_s) {
  wish_ = std::clamp(m_s, 0.0, config_.speed_m_s);
}

UgvPose PlatformMotion::on_path() const {
  if (moved_.yaw == 0 && moved_.p_I.isZero()) return pose_;
  return {Eigen::Rotation2Dd(-moved_.yaw) * (pose_.p_I - moved_.p_I),
          pose_.yaw - moved_.yaw};
}

UgvCommand PlatformMotion::rebel(const PadMutiny& mutiny, Seconds dt) {
  if (!mutinous_) {
    mutinous_ = disturbed_ = true;
    left_ = on_path();
    was_ = command_;
  }
  // It hears what it is wished meanwhile: that it does as soon as it obeys again.
  controller_.step(left_, moving_ ? wish_ : 0.0, dt);
  const double v =
      approach(command_.v, mutiny.speed_m_s.value_or(was_.v), kHardPace * dt);
  const double curvature = was_.v > 0.05 ? was_.w / was_.v : 0;
  return {v, approach(command_.w, mutiny.turn_rad_s.value_or(curvature * v),
                      kHardTurn * dt)};
}

UgvCommand PlatformMotion::drive(Seconds dt) {
  if (mutinous_) {
    mutinous_ = false;
    moved_.yaw = pose_.yaw - left_.yaw;
    moved_.p_I = pose_.p_I - Eigen::Rotation2Dd(moved_.yaw) * left_.p_I;
  }
  const UgvCommand wanted = controller_.step(on_path(), moving_ ? wish_ : 0.0, dt);
  if (!disturbed_) return wanted;
  const UgvCommand next{approach(command_.v, wanted.v, kHardPace * dt),
                        approach(command_.w, wanted.w, kHardTurn * dt)};
  disturbed_ = next.v != wanted.v || next.w != wanted.w;
  return next;
}

void PlatformMotion::step(Seconds dt, const PadMutiny& mutiny) {
  if (drive_) return step_recorded(dt);
  const UgvCommand before = command_;
  command_ = mutiny.any() ? rebel(mutiny, dt) : drive(dt);
  const double v = (before.v + command_.v) / 2;
  const double w = (before.w + command_.w) / 2;
  const double mid = pose_.yaw + w * dt / 2;
  const double half = w * dt / 2;
  const double chord = std::abs(half) < 1e-9 ? v * dt : v * dt * std::sin(half) / half;
  pose_.p_I += chord * Vector2(std::cos(mid), std::sin(mid));
  pose_.yaw += w * dt;
  if (sea_) return step_boat(before, dt);

  state_.t += from_seconds(dt);
  state_.X_IN.translation() = Vector3(pose_.p_I.x(), pose_.p_I.y(), height_);
  state_.X_IN.linear() = from_rpy(0, 0, pose_.yaw);
  state_.v_IN_N = Vector3(command_.v, 0, 0);
  state_.w_IN_N = Vector3(0, 0, command_.w);
  state_.a_IN_N = Vector3((command_.v - before.v) / dt, command_.v * command_.w, 0);
  state_.alpha_IN_N = Vector3(0, 0, (command_.w - before.w) / dt);
}

void PlatformMotion::step_recorded(Seconds dt) {
  const Time t = state_.t + from_seconds(dt);
  if (moving_) driven_ += dt;
  state_ = drive_->at(driven_);
  state_.t = t;
}

void PlatformMotion::step_boat(const UgvCommand& before, Seconds dt) {
  state_.t += from_seconds(dt);
  const Seaway::Deck deck = sea_->at(to_seconds(state_.t));
  const auto& [heave, roll, pitch] = deck;
  const double v = command_.v, w = command_.w;
  const double dv = dt > 0 ? (v - before.v) / dt : 0;
  const double dw = dt > 0 ? (w - before.w) / dt : 0;
  const Matrix3 R = from_rpy(roll.value, pitch.value, pose_.yaw);

  // Angular velocity in N of R = Rz(yaw) Ry(pitch) Rx(roll), and its derivative.
  const double sr = std::sin(roll.value), cr = std::cos(roll.value);
  const double sp = std::sin(pitch.value), cp = std::cos(pitch.value);
  const Vector3 up(-sp, sr * cp, cr * cp);  // I's z axis in N
  const Vector3 across(0, cr, -sr);         // the axis of pitch
  const Vector3 w_N = Vector3(roll.rate, 0, 0) + pitch.rate * across + w * up;
  const Vector3 across_rate = -roll.rate * Vector3(0, sr, cr);
  const Vector3 alpha_N = Vector3(roll.acceleration, 0, 0) +
                          pitch.acceleration * across + pitch.rate * across_rate +
                          dw * up - w * w_N.cross(up);

  // The hull turns about a point that lies in the mean water surface.
  const Vector3 p_ON_N(-config_.sea.pad_aft_m, 0, config_.sea.pad_above_m);
  const double c = std::cos(pose_.yaw), s = std::sin(pose_.yaw);
  const Vector3 p_IO(pose_.p_I.x(), pose_.p_I.y(), heave.value);
  const Vector3 v_IO(v * c, v * s, heave.rate);
  const Vector3 a_IO(dv * c - v * w * s, dv * s + v * w * c, heave.acceleration);
  state_.X_IN.linear() = R;
  state_.X_IN.translation() = p_IO + R * p_ON_N;
  state_.v_IN_N = R.transpose() * v_IO + w_N.cross(p_ON_N);
  state_.w_IN_N = w_N;
  state_.a_IN_N =
      R.transpose() * a_IO + alpha_N.cross(p_ON_N) + w_N.cross(w_N.cross(p_ON_N));
  state_.alpha_IN_N = alpha_N;
}

}  // namespace alight
