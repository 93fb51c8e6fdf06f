#include "alight/sim/autopilot.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kGyroNoise = 0.01;  // rad/s
constexpr double kHoverTau = 3;      // s, of the hover thrust estimate
// Of hover: so little is needed only on the ground,
constexpr double kTouchThrust = 0.6;
// which carries at least so much of the weight.
constexpr double kStandsOn = 0.8;
constexpr double kTouchSpeed = 0.15;  // m/s
constexpr double kTouchTime = 0.3;    // s
constexpr double kThrustMin = 0.04;   // share, in flight
constexpr double kHeightP = 1;        // 1/s, where it holds its height (MPC_Z_P)

/// Attitude with its z axis along `z_I` (not zero) and heading `yaw`.
Matrix3 attitude_for(const Vector3& z_I, double yaw) {
  const Vector3 z = z_I.normalized();
  const Vector3 ahead(std::cos(yaw), std::sin(yaw), 0);
  Matrix3 R;
  R.col(2) = z;
  R.col(1) = z.cross(ahead).normalized();
  R.col(0) = R.col(1).cross(z);
  return R;
}

}  // namespace

Autopilot::Autopilot(const AutopilotConfig& config, const DroneSpec& drone, Rng rng)
    : config_(config),
      attitude_(config.attitude, drone),
      belief_(config.belief, rng.fork("belief")),
      rng_(rng.fork("telemetry")),
      hover_share_(config.hover_share),
      motor_tau_(drone.motor_ms * 1e-3) {}

void Autopilot::receive(const Setpoint& setpoint, Time sent, Time now) {
  if (setpoint.kind == Setpoint::Kind::none) return;
  const bool finite = setpoint.q_IB.coeffs().allFinite() &&
                      setpoint.q_IB.norm() > 0.5 && std::isfinite(setpoint.thrust) &&
                      setpoint.v_IB.allFinite() && setpoint.a_IB.allFinite() &&
                      std::isfinite(setpoint.yaw);
  if (!finite || (any_received_ && sent < newest_sent_)) return;
  newest_sent_ = sent;
  last_received_ = now;
  any_received_ = true;
  queue_.push_back({setpoint, now + from_seconds(config_.attitude.delay_ms * 1e-3)});
}

void Autopilot::receive(AutopilotOrder order, Time now) {
  switch (order) {
    case AutopilotOrder::none:
      break;
    case AutopilotOrder::arm:
      if (armed_ || arming_ || refuses_) break;
      arming_ = true;
      arming_until_ = now + from_seconds(config_.arming_s);
      told_to_land_ = false;
      break;
    case AutopilotOrder::disarm:
      disarm();
      break;
    case AutopilotOrder::land:
      told_to_land_ = armed_;
      break;
  }
}

void Autopilot::disarm() {
  armed_ = arming_ = told_to_land_ = false;
  mode_ = AutopilotMode::manual;
  thrust_ = thrust_felt_ = 0;
  integral_.setZero();
  attitude_.reset();
}

void Autopilot::choose_mode(Time now) {
  if (arming_ && now >= arming_until_) {
    arming_ = false;
    armed_ = true;
    still_for_ = 0;
  }
  AutopilotMode next = AutopilotMode::manual;
  if (armed_) {
    const bool fresh = any_received_ && setpoint_.kind != Setpoint::Kind::none &&
                       to_seconds(now - last_received_) <= config_.loss_s;
    if (held_) {
      next = AutopilotMode::hold;
    } else if (told_to_land_) {
      next = AutopilotMode::land;
    } else if (fresh) {
      next = AutopilotMode::offboard;
    } else if (mode_ != AutopilotMode::manual) {
      next = AutopilotMode::failsafe;
    }
  }
  if (next == mode_) return;
  if (next == AutopilotMode::hold || next == AutopilotMode::land ||
      next == AutopilotMode::failsafe) {
    alone_yaw_ = yaw_of(belief_.R_IF());
    still_for_ = 0;
    land_v_ = belief_.v_I().z();
    land_a_ = 0;
    height_off_ = 0;
    // Falling with as little thrust it would feel hardly any force.
    on_ground_ = thrust_felt_ < kTouchThrust * hover_share_ &&
                 sensed_.f_F.z() > kStandsOn * kGravity;
  }
  integral_.setZero();
  mode_ = next;
}

RotorShares Autopilot::step(const Sensed& sensed, Time now, Seconds dt) {
  sensed_ = sensed;
  belief_.step(sensed.R_IF, sensed.f_F, sensed.climb, now, dt);
  while (!queue_.empty() && queue_.front().in_force <= now) {
    setpoint_ = queue_.front().setpoint;
    queue_.pop_front();
  }
  choose_mode(now);
  if (!armed_) return {};

  thrust_felt_ += (1 - std::exp(-dt / motor_tau_)) * (thrust_ - thrust_felt_);
  const bool told_thrust =
      mode_ == AutopilotMode::offboard && setpoint_.kind == Setpoint::Kind::attitude;
  if (!told_thrust && thrust_felt_ > kTouchThrust * hover_share_ &&
      sensed.f_F.z() > 0.5 * kGravity) {
    const double hover = thrust_felt_ * kGravity / sensed.f_F.z();
    hover_share_ += dt / kHoverTau * (std::clamp(hover, 0.1, 0.9) - hover_share_);
  }

  switch (mode_) {
    case AutopilotMode::offboard:
      return follow(setpoint_, now, dt);
    case AutopilotMode::land:
      return land(config_.land_speed_m_s, true, now, dt);
    case AutopilotMode::failsafe:
      return without_setpoints(now, dt);
    case AutopilotMode::hold:
      if (on_ground_) break;
      height_off_ += sensed.climb * dt;
      return follow_velocity(Vector3(0, 0, -kHeightP * height_off_), Vector3::Zero(),
                             alone_yaw_, !belief_.velocity_valid(now), dt);
    case AutopilotMode::manual:
      break;
  }
  return idle();
}

RotorShares Autopilot::idle() {
  thrust_ = config_.idle;
  return {config_.idle, config_.idle, config_.idle, config_.idle};
}

RotorShares Autopilot::without_setpoints(Time now, Seconds dt) {
  LinkLossAction action = config_.loss_action;
  // Its landing mode needs a velocity to start with; else the firmware only descends.
  if (action == LinkLossAction::land && !config_.belief.external_pose) {
    action = LinkLossAction::descend;
  }
  switch (action) {
    case LinkLossAction::land:
      return land(config_.land_speed_m_s, true, now, dt);
    case LinkLossAction::descend:
      return land(config_.descend_speed_m_s, false, now, dt);
    case LinkLossAction::drift:
      break;
  }
  if (on_ground_) return idle();
  thrust_ = hover_share_;
  return attitude_.step(belief_.R_IF(), sensed_.w_F,
                        attitude_for(Vector3::UnitZ(), alone_yaw_), thrust_, dt);
}

RotorShares Autopilot::follow(const Setpoint& setpoint, Time now, Seconds dt) {
  if (setpoint.kind == Setpoint::Kind::attitude) {
    integral_.setZero();
    thrust_ = std::clamp(setpoint.thrust, config_.idle, 1.0);
    return attitude_.step(belief_.R_IF(), sensed_.w_F,
                          setpoint.q_IB.normalized().toRotationMatrix(), thrust_, dt);
  }
  return follow_velocity(setpoint.v_IB, setpoint.a_IB, setpoint.yaw,
                         !belief_.velocity_valid(now), dt);
}

RotorShares Autopilot::follow_velocity(const Vector3& v_I, const Vector3& a_I,
                                       double yaw, bool blind, Seconds dt) {
  Vector3 error = v_I - belief_.v_I();
  if (blind) error.head<2>().setZero();
  Vector3 a = a_I + integral_;
  a.head<2>() += config_.velocity_p * error.head<2>();
  if (!blind) a.head<2>() -= config_.velocity_d * belief_.a_I().head<2>();
  a.z() += config_.velocity_p_z * error.z();

  // Height before way: the tilt is what the limit leaves.
  const double lift = std::max(0.2 * kGravity, kGravity + a.z());
  const double side_max = lift * std::tan(config_.tilt_max_deg * kDegree);
  const double side = a.head<2>().norm();
  const bool tilted_out = side > side_max;
  if (tilted_out) a.head<2>() *= side_max / side;
  const Vector3 z_I(a.x(), a.y(), lift);

  // Turned by the tilt the drone has, not the one it is to have.
  const double along = std::max(0.5, belief_.R_IF()(2, 2));
  const double wanted = hover_share_ * (kGravity + a.z()) / kGravity / along;
  thrust_ = std::clamp(wanted, kThrustMin, 1.0);
  const double ki[3] = {config_.velocity_i, config_.velocity_i, config_.velocity_i_z};
  for (int axis = 0; axis < 3; ++axis) {
    const bool winding =
        axis == 2 ? (wanted != thrust_ && error.z() * a.z() > 0) : tilted_out;
    if (!winding) integral_[axis] += ki[axis] * error[axis] * dt;
  }
  integral_.z() = std::clamp(integral_.z(), -kGravity, kGravity);
  return attitude_.step(belief_.R_IF(), sensed_.w_F, attitude_for(z_I, yaw), thrust_,
                        dt);
}

RotorShares Autopilot::land(double speed, bool disarms, Time now, Seconds dt) {
  if (on_ground_ || (disarms && still_for_ > kTouchTime)) {
    // Not flying: it corrects nothing.
    still_for_ += dt;
    if (!disarms || still_for_ <= config_.land_disarm_s) return idle();
    disarm();
    return {};
  }
  const double left = -speed - land_v_;
  const double jerk = config_.land_jerk_m_s3;
  const double wanted = std::copysign(
      std::min(std::sqrt(2 * jerk * std::abs(left)), config_.land_acceleration_m_s2),
      left);
  land_a_ += std::clamp(wanted - land_a_, -jerk * dt, jerk * dt);
  land_v_ += land_a_ * dt;
  const RotorShares shares =
      follow_velocity(Vector3(0, 0, land_v_), Vector3(0, 0, land_a_), alone_yaw_,
                      !belief_.velocity_valid(now), dt);
  const bool at_rest = disarms && thrust_ < kTouchThrust * hover_share_ &&
                       std::abs(belief_.v_I().z()) < kTouchSpeed;
  still_for_ = at_rest ? still_for_ + dt : 0;
  return shares;
}

AutopilotTelemetry Autopilot::telemetry(Time now) {
  AutopilotTelemetry out;
  out.captured = now;
  out.q_IB = Eigen::Quaterniond(belief_.R_IF());
  const double x = rng_.normal(0, kGyroNoise);
  const double y = rng_.normal(0, kGyroNoise);
  const double z = rng_.normal(0, kGyroNoise);
  out.w_IB_B = sensed_.w_F + Vector3(x, y, z);
  if (belief_.velocity_valid(now)) out.v_IB = belief_.v_I();
  out.climb = belief_.v_I().z();
  out.armed = armed_;
  out.mode = mode_;
  out.battery = sensed_.battery;
  return out;
}

}  // namespace alight
