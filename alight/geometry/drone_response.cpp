#include "alight/geometry/drone_response.h"

#include <algorithm>
#include <cmath>

#include "alight/base/bounds.h"

namespace alight {
namespace {

constexpr Time kMillisecond = 1'000'000;

Time from_ms(double ms) { return std::llround(ms * kMillisecond); }

std::int64_t floor_index(Time t) {
  const std::int64_t q = t / DroneResponse::kGrid;
  return t % DroneResponse::kGrid < 0 ? q - 1 : q;
}

bool finite(const Setpoint& s) {
  return s.q_IB.coeffs().allFinite() && std::isfinite(s.thrust) && s.v_IB.allFinite() &&
         s.a_IB.allFinite() && std::isfinite(s.yaw) && std::isfinite(s.yaw_rate) &&
         s.q_IB.norm() > 0.5;
}

/// The attitude whose third axis is along `f` and whose heading is `yaw`.
Matrix3 attitude_along(const Vector3& f, double yaw) {
  const Vector3 z = f.normalized();
  const Vector3 y = z.cross(Vector3(std::cos(yaw), std::sin(yaw), 0)).normalized();
  Matrix3 R;
  R << y.cross(z), y, z;
  return R;
}

}  // namespace

Result<void> DroneResponseConfig::validate() const {
  return check_bounds({{"response.omega_rad_s", omega_rad_s, 1, 60},
                       {"response.zeta", zeta, 0.1, 3},
                       {"response.delay_ms", delay_ms, 0, 200},
                       {"response.thrust_delay_ms", thrust_delay_ms, 0, 200},
                       {"response.motor_ms", motor_ms, 1, 500},
                       {"response.thrust_to_weight", thrust_to_weight, 1.2, 20},
                       {"response.velocity_gain", velocity_gain, 0, 20},
                       {"response.velocity_gain_z", velocity_gain_z, 0, 20},
                       {"response.velocity_integral", velocity_integral, 0, 20},
                       {"response.velocity_integral_z", velocity_integral_z, 0, 20},
                       {"response.velocity_damping", velocity_damping, 0, 5},
                       {"response.tilt_max_deg", tilt_max_deg, 1, 80},
                       {"response.attitude_share", attitude_share, 0, 1},
                       {"response.rate_observer_rad_s", rate_observer_rad_s, 0, 100},
                       {"response.moment_fade_s", moment_fade_s, 0.01, 100}});
}

DroneResponse::DroneResponse(const DroneResponseConfig& config)
    : config_(config),
      delay_(from_ms(config.delay_ms)),
      thrust_delay_(from_ms(config.thrust_delay_ms)) {
  reset(0, Matrix3::Identity());
}

void DroneResponse::reset(Time t, const Matrix3& R_IB, double thrust_m_s2,
                          const Vector3& v_IB) {
  first_ = last_ = covered_ = floor_index(t);
  setpoint_count_ = 0;
  setpoint_head_ = 0;
  State& x = slot(first_);
  x = State{};
  x.s.t = first_ * kGrid;
  if (R_IB.allFinite()) x.s.R_IB = R_IB;
  if (std::isfinite(thrust_m_s2)) x.s.thrust_m_s2 = thrust_m_s2;
  if (v_IB.allFinite()) x.s.v_IB = v_IB;
}

DroneResponse::State& DroneResponse::slot(std::int64_t index) {
  return ring_[static_cast<std::size_t>(index) % kSamples];
}
const DroneResponse::State& DroneResponse::slot(std::int64_t index) const {
  return ring_[static_cast<std::size_t>(index) % kSamples];
}

void DroneResponse::sent(const Setpoint& setpoint, Time arrives) {
  if (setpoint.kind == Setpoint::Kind::none || !finite(setpoint)) return;
  // The newest set-point wins: those it overtakes never take effect after it.
  while (setpoint_count_ > 0) {
    const std::size_t newest = (setpoint_head_ + kSetpoints - 1) % kSetpoints;
    if (setpoints_[newest].arrives < arrives) break;
    setpoint_head_ = newest;
    --setpoint_count_;
  }
  Sent& entry = setpoints_[setpoint_head_];
  entry = {arrives, setpoint};
  entry.setpoint.q_IB.normalize();
  setpoint_head_ = (setpoint_head_ + 1) % kSetpoints;
  setpoint_count_ = std::min(setpoint_count_ + 1, kSetpoints);
  cut(arrives + std::min(delay_, thrust_delay_));
}

void DroneResponse::cut(Time t) {
  const std::int64_t index = floor_index(t);
  if (index < last_) last_ = std::max(index, first_);
  advance(covered_ * kGrid);
}

void DroneResponse::advance(Time t) {
  std::int64_t until = floor_index(t + kGrid - 1);
  if (setpoint_count_ > 0) {
    const Time newest =
        setpoints_[(setpoint_head_ + kSetpoints - 1) % kSetpoints].arrives;
    until = std::min(until, std::max(floor_index(newest + kAhead), last_));
  }
  covered_ = std::max(covered_, until);
  constexpr std::int64_t kept = (kHistory + kAhead) / kGrid;
  static_assert(kept < static_cast<std::int64_t>(kSamples));
  if (until - last_ > 2 * kept) {
    // A long silence: nothing of the history would be left, so only its end goes on.
    const State end = slot(last_);
    last_ = first_ = until - kept;
    slot(last_) = end;
    slot(last_).s.t = last_ * kGrid;
  }
  while (last_ < until) {
    State x = slot(last_);
    step(x, last_ * kGrid, (last_ + 1) * kGrid);
    ++last_;
    x.s.t = last_ * kGrid;
    slot(last_) = x;
    first_ = std::max(first_, last_ - kept);
  }
}

const DroneResponse::Sent* DroneResponse::in_force(Time t, Time delay) const {
  for (std::size_t i = 1; i <= setpoint_count_; ++i) {
    const Sent& s = setpoints_[(setpoint_head_ + kSetpoints - i) % kSetpoints];
    if (s.arrives + delay <= t) return &s;
  }
  return nullptr;
}

Time DroneResponse::next_change(Time t, Time delay) const {
  Time next = t + 2 * kGrid;
  for (std::size_t i = 1; i <= setpoint_count_; ++i) {
    const Sent& s = setpoints_[(setpoint_head_ + kSetpoints - i) % kSetpoints];
    if (s.arrives + delay <= t) break;
    next = s.arrives + delay;
  }
  return next;
}

void DroneResponse::step(State& x, Time t, Time until) const {
  while (t < until) {
    const Time next =
        std::min({until, next_change(t, delay_), next_change(t, thrust_delay_)});
    const Seconds dt = to_seconds(next - t);
    const Sent* attitude = in_force(t, delay_);
    const Sent* thrust = in_force(t, thrust_delay_);
    Sample& s = x.s;

    // What the autopilot's inner loops are asked for.
    Matrix3 R_sp = s.R_IB;
    double T_sp = s.thrust_m_s2;
    const double T_full = config_.thrust_to_weight * kGravity;
    if (attitude != nullptr && attitude->setpoint.kind == Setpoint::Kind::velocity) {
      const Vector3 f = velocity_loop(x, attitude->setpoint, dt);
      R_sp = attitude_along(f, attitude->setpoint.yaw);
      T_sp = std::min(f.norm(), T_full);
    } else {
      if (attitude != nullptr) R_sp = attitude->setpoint.q_IB.toRotationMatrix();
      if (thrust != nullptr && thrust->setpoint.kind == Setpoint::Kind::attitude) {
        T_sp = std::clamp(thrust->setpoint.thrust, 0.0, 1.0) * T_full;
      }
    }

    // Midpoint rule for the attitude, exact for the motors.
    const double w0 = config_.omega_rad_s;
    const auto torque = [&](const Matrix3& R, const Vector3& w) -> Vector3 {
      return x.moment_B - 2 * config_.zeta * w0 * w +
             w0 * w0 * so3_log(R.transpose() * R_sp);
    };
    const Vector3 w_mid = s.w_IB_B + 0.5 * dt * torque(s.R_IB, s.w_IB_B);
    const Matrix3 R_mid = s.R_IB * so3_exp(0.5 * dt * s.w_IB_B);
    const Vector3 f_before = s.f_I();
    s.w_IB_B += dt * torque(R_mid, w_mid);
    s.R_IB = s.R_IB * so3_exp(dt * w_mid);
    x.moment_B *= std::exp(-dt / config_.moment_fade_s);
    const double tau = config_.motor_ms * 1e-3;
    s.thrust_m_s2 = T_sp + (s.thrust_m_s2 - T_sp) * std::exp(-dt / tau);
    s.v_IB += dt * (0.5 * (f_before + s.f_I()) - Vector3(0, 0, kGravity));
    t = next;
  }
  x.s.R_IB = orthonormalized(x.s.R_IB);
}

Vector3 DroneResponse::velocity_loop(State& x, const Setpoint& setpoint,
                                     Seconds dt) const {
  const DroneResponseConfig& c = config_;
  const Vector3 gain(c.velocity_gain, c.velocity_gain, c.velocity_gain_z);
  const Vector3 integral(c.velocity_integral, c.velocity_integral,
                         c.velocity_integral_z);
  const Vector3 error = setpoint.v_IB - x.s.v_IB;
  const Vector3 acceleration = x.s.f_I() - Vector3(0, 0, kGravity);
  Vector3 f = gain.cwiseProduct(error) + x.v_integral -
              c.velocity_damping * acceleration + setpoint.a_IB +
              Vector3(0, 0, kGravity);
  f.z() = std::max(f.z(), 0.1 * kGravity);
  const double widest = f.z() * std::tan(c.tilt_max_deg * kDegree);
  const double tilting = f.head<2>().norm();
  if (tilting > widest) {
    f.head<2>() *= widest / tilting;  // and the integral stands still
  } else {
    x.v_integral += dt * integral.cwiseProduct(error);
  }
  return f;
}

Time DroneResponse::oldest() const { return first_ * kGrid; }
Time DroneResponse::newest() const { return last_ * kGrid; }

DroneResponse::Sample DroneResponse::at(Time t) const {
  if (t <= oldest()) return slot(first_).s;
  if (t >= newest()) return slot(last_).s;
  const std::int64_t i = floor_index(t);
  const Sample& a = slot(i).s;
  const Sample& b = slot(i + 1).s;
  const double u = to_seconds(t - a.t) / to_seconds(kGrid);
  Sample s;
  s.t = t;
  s.R_IB = a.R_IB * so3_exp(u * so3_log(a.R_IB.transpose() * b.R_IB));
  s.w_IB_B = (1 - u) * a.w_IB_B + u * b.w_IB_B;
  s.thrust_m_s2 = (1 - u) * a.thrust_m_s2 + u * b.thrust_m_s2;
  s.v_IB = (1 - u) * a.v_IB + u * b.v_IB;
  return s;
}

void DroneResponse::correct(Time captured, const Matrix3& R_IB, const Vector3& w_IB_B) {
  if (captured < oldest() || captured > newest() || !R_IB.allFinite() ||
      !w_IB_B.allFinite()) {
    return;
  }
  const Seconds dt = std::clamp(to_seconds(captured - corrected_), 0.0, 0.05);
  corrected_ = captured;
  const Sample model = at(captured);
  const Vector3 turned = so3_log(model.R_IB.transpose() * R_IB);
  const Vector3 faster = w_IB_B - model.w_IB_B;
  // Critically damped, for any time between two reports.
  const double kept = std::exp(-config_.rate_observer_rad_s * dt);
  State& x = restart_after(captured);
  x.s.R_IB *= so3_exp(config_.attitude_share * turned);
  x.s.w_IB_B += (1 - kept * kept) * faster;
  if (dt > 0) x.moment_B += (1 - kept) * (1 - kept) / dt * faster;
  advance(covered_ * kGrid);
}

void DroneResponse::correct_velocity(Time captured, const Vector3& v_IB, double gain) {
  if (captured < oldest() || captured > newest() || !v_IB.allFinite()) return;
  const Vector3 error = v_IB - at(captured).v_IB;
  restart_after(captured).s.v_IB += gain * error;
  advance(covered_ * kGrid);
}

DroneResponse::State& DroneResponse::restart_after(Time t) {
  last_ = std::min(last_, floor_index(t + kGrid - 1));
  return slot(last_);
}

}  // namespace alight
