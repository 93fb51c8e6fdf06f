#include "alight/sim/attitude_loop.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kDisturbanceMax = 40;  // rad/s^2
constexpr double kOnGround = 0.5;       // of the hover thrust: too little to fly

}  // namespace

AttitudeLoop::AttitudeLoop(const AttitudeLoopConfig& config, const DroneSpec& drone)
    : config_(config),
      layout_(drone),
      inertia_(drone.inertia_kg_m2),
      motor_tau_(drone.motor_ms * 1e-3),
      hover_share_(1 / drone.thrust_to_weight) {
  // Angle, rate and motor lag make three poles; they are put where the second-order lag
  // and the third pole want them.
  const double w = config.omega_rad_s;
  const double damping = 2 * config.zeta * w;
  const double p = config.pole_rad_s;
  k_angle_ = motor_tau_ * w * w * p;
  k_rate_ = motor_tau_ * (w * w + damping * p);
  k_acceleration_ = motor_tau_ * (damping + p) - 1;
}

void AttitudeLoop::reset() {
  motors_ = {};
  w_model_.setZero();
  disturbance_.setZero();
}

RotorShares AttitudeLoop::step(const Matrix3& R_IF, const Vector3& w_F,
                               const Matrix3& R_sp, double thrust, Seconds dt) {
  const Vector3 acceleration = acceleration_of(motors_);
  if (thrust < kOnGround * hover_share_) {
    // What the ground does to the drone is not to be learnt.
    disturbance_ *= std::exp(-dt * config_.observer_rad_s);
    w_model_ = w_F;
  } else {
    const double l = config_.observer_rad_s;
    const Vector3 miss = w_F - w_model_;
    w_model_ += dt * (acceleration + disturbance_ + 2 * l * miss);
    disturbance_ += dt * l * l * miss;
    disturbance_ = disturbance_.cwiseMax(-kDisturbanceMax).cwiseMin(kDisturbanceMax);
  }

  const double angle_max = config_.rate_max_rad_s * k_rate_ / k_angle_;
  const double yaw_max = config_.yaw_rate_max_rad_s * k_rate_ / k_angle_;
  Vector3 error = so3_log(R_IF.transpose() * R_sp);
  const double tilt_error = error.head<2>().norm();
  if (tilt_error > angle_max) error.head<2>() *= angle_max / tilt_error;
  error.z() = std::clamp(error.z(), -yaw_max, yaw_max);

  const Vector3 wanted = k_angle_ * error - k_rate_ * w_F -
                         k_acceleration_ * (acceleration + disturbance_) - disturbance_;
  const RotorShares shares = mix(thrust, wanted);
  const double gain = 1 - std::exp(-dt / motor_tau_);
  for (std::size_t i = 0; i < kRotors; ++i)
    motors_[i] += gain * (shares[i] - motors_[i]);
  return shares;
}

Vector3 AttitudeLoop::acceleration_of(const RotorShares& shares) const {
  Vector3 moment = Vector3::Zero();
  for (std::size_t i = 0; i < kRotors; ++i) {
    const double thrust = shares[i] * layout_.max_thrust;
    moment += layout_.p_FR[i].cross(Vector3(0, 0, thrust));
    moment.z() += layout_.yaw_per_thrust[i] * thrust;
  }
  return moment.cwiseQuotient(inertia_);
}

RotorShares AttitudeLoop::mix(double thrust, const Vector3& acceleration) const {
  const Vector3 moment = acceleration.cwiseProduct(inertia_);
  // The layout is symmetric, so the inverse is written down: each rotor's share of the
  // three moments.
  const double arm = std::abs(layout_.p_FR[0].x()) * layout_.max_thrust * kRotors;
  RotorShares tilt{}, yaw{};
  for (std::size_t i = 0; i < kRotors; ++i) {
    const Vector3& p = layout_.p_FR[i];
    tilt[i] = (std::copysign(1.0, p.y()) * moment.x() -
               std::copysign(1.0, p.x()) * moment.y()) /
              arm;
    yaw[i] = moment.z() / (layout_.yaw_per_thrust[i] * layout_.max_thrust * kRotors);
  }
  // Too much asked: yaw gives way first, then thrust, then tilt, as in PX4.
  double room = 1;
  for (std::size_t i = 0; i < kRotors; ++i) {
    room = std::max(room, 2 * std::abs(tilt[i]));
  }
  double low = 0, high = 0;
  for (double& share : tilt) {
    share /= room;
    low = std::min(low, share);
    high = std::max(high, share);
  }
  const double base = std::clamp(thrust, -low, 1 - high);
  double keep = 1;
  for (std::size_t i = 0; i < kRotors; ++i) {
    const double share = base + tilt[i];
    if (yaw[i] > 0) keep = std::min(keep, (1 - share) / yaw[i]);
    if (yaw[i] < 0) keep = std::min(keep, share / -yaw[i]);
  }
  RotorShares shares{};
  for (std::size_t i = 0; i < kRotors; ++i) {
    shares[i] = std::clamp(base + tilt[i] + std::max(0.0, keep) * yaw[i], 0.0, 1.0);
  }
  return shares;
}

}  // namespace alight
