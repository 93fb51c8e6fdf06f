#include "alight/sim/platform_motion.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace alight {
namespace {

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
  for (double& phase : phase_) phase = rng.uniform(0, 2 * kPi);
  state_.X_IN.translation().z() = height;
  if (config_.kind == PlatformKind::boat) step_boat(0);
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

void PlatformMotion::step(Seconds dt) {
  if (drive_) return step_recorded(dt);
  const UgvCommand before = command_;
  command_ = controller_.step(pose_, moving_ ? wish_ : 0.0, dt);
  const double v = (before.v + command_.v) / 2;
  const double w = (before.w + command_.w) / 2;
  const double mid = pose_.yaw + w * dt / 2;
  const double half = w * dt / 2;
  const double chord = std::abs(half) < 1e-9 ? v * dt : v * dt * std::sin(half) / half;
  pose_.p_I += chord * Vector2(std::cos(mid), std::sin(mid));
  pose_.yaw += w * dt;
  if (config_.kind == PlatformKind::boat) return step_boat(dt);

  state_.t += from_seconds(dt);
  state_.X_IN.translation() = Vector3(pose_.p_I.x(), pose_.p_I.y(), height_);
  state_.X_IN.linear() = from_rpy(0, 0, pose_.yaw);
  state_.v_IN_N = Vector3(command_.v, 0, 0);
  state_.w_IN_N = Vector3(0, 0, command_.w);
  state_.a_IN_N = Vector3((command_.v - before.v) / dt, command_.v * command_.w, 0);
  state_.alpha_IN_N = Vector3(0, 0, (command_.w - before.w) / dt);
}

PlatformMotion::Deck PlatformMotion::deck(double t_s) const {
  const SeaScenario& sea = config_.sea;
  const double w = 2 * kPi / sea.period_s;
  // Roll and pitch answer at periods of their own, so that the deck does not repeat.
  return {sea.heave_m * std::sin(w * t_s + phase_[0]),
          sea.roll_deg * kDegree * std::sin(1.13 * w * t_s + phase_[1]),
          sea.pitch_deg * kDegree * std::sin(0.91 * w * t_s + phase_[2])};
}

void PlatformMotion::step_recorded(Seconds dt) {
  const Time t = state_.t + from_seconds(dt);
  if (moving_) driven_ += dt;
  state_ = drive_->at(driven_);
  state_.t = t;
}

void PlatformMotion::step_boat(Seconds dt) {
  state_.t += from_seconds(dt);
  const double t = to_seconds(state_.t);
  const auto R_at = [this](double at) {
    const Deck d = deck(at);
    return from_rpy(d.roll, d.pitch, 0);
  };
  const double h = 1e-3;  // differences of smooth functions; error of order h^2
  const Matrix3 R = R_at(t);
  const auto turn = [&](double at) {
    return Vector3(so3_log(R_at(at - h).transpose() * R_at(at + h)) / (2 * h));
  };
  const double rise = (deck(t + h).heave - deck(t - h).heave) / (2 * h);
  const double lift =
      (deck(t + h).heave - 2 * deck(t).heave + deck(t - h).heave) / (h * h);
  state_.X_IN.linear() = R;
  state_.X_IN.translation() =
      Vector3(pose_.p_I.x(), pose_.p_I.y(), height_ + deck(t).heave);
  state_.v_IN_N = R.transpose() * Vector3(command_.v, 0, rise);
  state_.a_IN_N = R.transpose() * Vector3(0, 0, lift);
  state_.w_IN_N = turn(t);
  state_.alpha_IN_N = (turn(t + h) - turn(t - h)) / (2 * h);
}

}  // namespace alight
