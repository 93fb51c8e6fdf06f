#include "alight/control/pid_controller.h"

#include <cmath>
#include <sstream>

namespace alight {
namespace {

Result<void> in_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  std::ostringstream text;
  text << name << " is " << value << ", must lie in [" << low << ", " << high << "]";
  return fail(Fault::invalid_config, text.str());
}

Vector3 clamped(const Vector3& v, double norm) {
  const double n = v.norm();
  return n > norm ? Vector3(v * (norm / n)) : v;
}

}  // namespace

Result<void> PidControllerConfig::validate() const {
  for (int i = 0; i < 4; ++i) {
    if (auto r = in_range("pid.kp", kp[i], 0, 20); !r) return r;
    if (auto r = in_range("pid.ki", ki[i], 0, 20); !r) return r;
    if (auto r = in_range("pid.kd", kd[i], 0, 20); !r) return r;
    if (auto r = in_range("pid.integral_max", integral_max[i], 0, 20); !r) return r;
  }
  if (auto r = in_range("pid.speed_max_m_s", speed_max_m_s, 0.05, 50); !r) return r;
  return in_range("pid.yaw_rate_max_deg_s", yaw_rate_max_deg_s, 1, 1000);
}

Result<PidController> PidController::create(const PidControllerConfig& config) {
  if (auto valid = config.validate(); !valid) return fail(valid.error());
  return PidController(config);
}

void PidController::reset() {
  integral_.setZero();
  has_last_ = false;
}

PidOutput PidController::step(const PlatformState& platform, const RelativeState& state,
                              const FlatState& reference, Seconds dt,
                              double autopilot_heading) {
  PidOutput out;
  out.setpoint.kind = Setpoint::Kind::velocity;
  const Matrix3& R_IN = platform.X_IN.linear();

  Vector4 error;
  error << reference.p_NB - state.p_NB, wrap_angle(reference.yaw - yaw_of(state.R_NB));
  const bool finite = error.allFinite() && R_IN.allFinite() && std::isfinite(dt) &&
                      std::isfinite(autopilot_heading) && reference.v_NB.allFinite() &&
                      platform.v_IN_N.allFinite() && platform.w_IN_N.allFinite();
  if (!finite || dt < 0) {
    out.invalid = true;
    has_last_ = false;
    return out;
  }
  out.p_error_N = error.head<3>();

  Vector4 rate = Vector4::Zero();
  if (has_last_ && dt > 0) {
    rate = error - last_error_;
    rate[3] = wrap_angle(rate[3]);
    rate /= dt;
  }
  last_error_ = error;
  has_last_ = true;
  integral_ += config_.ki.cwiseProduct(error) * dt;
  integral_ = integral_.cwiseMax(-config_.integral_max).cwiseMin(config_.integral_max);

  const Vector4 command =
      config_.kp.cwiseProduct(error) + integral_ + config_.kd.cwiseProduct(rate);
  const Vector3 v_N = clamped(command.head<3>(), config_.speed_max_m_s);
  out.limited = v_N != command.head<3>();
  double yaw_rate = command[3];
  const double yaw_rate_max = config_.yaw_rate_max_deg_s * kDegree;
  if (std::abs(yaw_rate) > yaw_rate_max) {
    yaw_rate = std::copysign(yaw_rate_max, yaw_rate);
    out.limited = true;
  }

  const Matrix3 R_AI = from_rpy(0, 0, autopilot_heading);
  out.setpoint.v_IB = R_AI * (R_IN * v_N);
  out.setpoint.yaw = wrap_angle(autopilot_heading + yaw_of(R_IN) + reference.yaw);
  out.setpoint.yaw_rate = yaw_rate;
  return out;
}

}  // namespace alight
