#include "alight/control/attitude_controller.h"

#include <algorithm>
#include <cmath>

#include "alight/base/bounds.h"

namespace alight {
namespace {

Vector3 clamped(const Vector3& v, double norm) {
  const double n = v.norm();
  return n > norm ? Vector3(v * (norm / n)) : v;
}

bool finite(const FlatState& s) {
  return s.p_NB.allFinite() && s.v_NB.allFinite() && s.a_NB.allFinite() &&
         s.j_NB.allFinite() && std::isfinite(s.yaw) && std::isfinite(s.yaw_rate);
}

bool finite(const PlatformState& p) {
  return p.X_IN.matrix().allFinite() && p.v_IN_N.allFinite() && p.w_IN_N.allFinite() &&
         p.a_IN_N.allFinite() && p.alpha_IN_N.allFinite();
}

bool finite(const AttitudeInput& in) {
  return finite(in.platform) && finite(in.platform_later) &&
         in.state.p_NB.allFinite() && in.state.v_NB.allFinite() &&
         in.response.R_IB.allFinite() && in.response.w_IB_B.allFinite() &&
         std::isfinite(in.response.thrust_m_s2) &&
         std::isfinite(in.autopilot_heading) && in.d_N.allFinite() &&
         in.b_N.allFinite() && finite(in.reference) && std::isfinite(in.tilt_limit_rad);
}

/// Body z along `f`, heading `yaw`. @pre f points up.
Matrix3 attitude_along(const Vector3& f, double yaw) {
  const Vector3 z = f.normalized();
  const Vector3 y = z.cross(Vector3(std::cos(yaw), std::sin(yaw), 0)).normalized();
  Matrix3 R;
  R << y.cross(z), y, z;
  return R;
}

}  // namespace

Vector3 wished_force_N(const PlatformState& platform, const FlatState& r,
                       const Vector3& d_N, double drag_per_s) {
  return inertial_acceleration_N(platform, r.p_NB, r.v_NB, r.a_NB) +
         drag_per_s * inertial_velocity_N(platform, r.p_NB, r.v_NB) - d_N -
         gravity_N(platform);
}

Result<void> AttitudeControllerConfig::validate() const {
  return check_bounds(
      {{"attitude.kp", kp, 0.1, 100},
       {"attitude.kv", kv, 0.1, 50},
       {"attitude.ka", ka, 0, 10},
       {"attitude.kp_z", kp_z, 0.1, 100},
       {"attitude.kv_z", kv_z, 0.1, 50},
       {"attitude.ka_z", ka_z, 0, 10},
       {"attitude.disturbance_lag_s", disturbance_lag_s, 1e-3, 10},
       {"attitude.drag_per_s", drag_per_s, 0, 5},
       {"attitude.error_max_m", error_max_m, 0.01, 100},
       {"attitude.velocity_error_max_m_s", velocity_error_max_m_s, 0.01, 100},
       {"attitude.disturbance_max_m_s2", disturbance_max_m_s2, 0, 20},
       {"attitude.thrust_min", thrust_min, 0, 0.5},
       {"attitude.thrust_max", thrust_max, 0.5, 1},
       {"attitude.yaw_step_max_deg", yaw_step_max_deg, 1, 90}});
}

Result<AttitudeController> AttitudeController::create(
    const AttitudeControllerConfig& config, const DroneResponseConfig& response,
    const DroneSpec& drone) {
  if (auto valid = config.validate(); !valid) return fail(valid.error());
  if (auto valid = response.validate(); !valid) return fail(valid.error());
  if (!(drone.thrust_to_weight >= 1.2 && drone.thrust_to_weight <= 20)) {
    return fail(Fault::invalid_config,
                "drone.thrust_to_weight must lie in [1.2, 20], is " +
                    std::to_string(drone.thrust_to_weight));
  }
  return AttitudeController(config, response, drone);
}

AttitudeController::AttitudeController(const AttitudeControllerConfig& config,
                                       const DroneResponseConfig& response,
                                       const DroneSpec& drone)
    : config_(config),
      response_(response),
      tilt_max_(drone.tilt_max_deg * kDegree),
      thrust_full_(drone.thrust_to_weight * kGravity) {}

AttitudeOutput AttitudeController::step(const AttitudeInput& in, Seconds dt) {
  AttitudeOutput out;
  out.setpoint.kind = Setpoint::Kind::attitude;
  if (!finite(in) || !(dt >= 0)) {
    out.invalid = true;
    const Matrix3& R = in.response.R_IB;
    const double yaw = R.allFinite() ? yaw_of(R) : 0;
    out.setpoint.q_IB = Eigen::Quaterniond(from_rpy(0, 0, yaw));
    out.setpoint.thrust = kGravity / thrust_full_;
    return out;
  }

  const Matrix3& R_IN = in.platform.X_IN.linear();
  const Matrix3 R_AI = from_rpy(0, 0, in.autopilot_heading);
  const Matrix3 R_NA = (R_AI * R_IN).transpose();

  // The force that keeps to the reference, and how it changes (seen from I).
  const FlatState& r = in.reference;
  const Vector3 d_now =
      R_NA.transpose() * clamped(in.d_N, config_.disturbance_max_m_s2);
  const Vector3 b_now = clamped(in.b_N, config_.disturbance_max_m_s2);
  if (!has_d_) {
    d_A_ = d_now;
    b_N_ = b_now;
  }
  has_d_ = true;
  // Each in the frame in which it rests: the other would lag behind in a turn.
  const double newest = 1 - std::exp(-dt / config_.disturbance_lag_s);
  d_A_ += (d_now - d_A_) * newest;
  b_N_ += (b_now - b_N_) * newest;
  const Vector3 wind_N = R_NA * d_A_;
  const Vector3 beside_N(b_N_.x(), b_N_.y(), 0);
  const double lifts = 1 + b_N_.z() / kGravity;
  const auto wished = [&](const PlatformState& platform, const FlatState& at,
                          const Vector3& d_N) -> Vector3 {
    return wished_force_N(platform, at, d_N, config_.drag_per_s) / lifts;
  };
  const Vector3 f = wished(in.platform, r, wind_N + beside_N);
  constexpr Seconds kLater = AttitudeInput::kLater;
  FlatState later = r;
  later.p_NB += kLater * r.v_NB;
  later.v_NB += kLater * r.a_NB;
  later.a_NB += kLater * r.j_NB;
  // Wind is fixed in I, hence turning in N.
  const Vector3 turn = kLater * in.platform.w_IN_N;
  const Matrix3 R_later = so3_exp(turn);
  const Vector3 f_later = R_later * wished(in.platform_later, later,
                                           R_later.transpose() * wind_N + beside_N);
  const Vector3 f_rate = (f_later - f) / kLater;
  const Vector3 f_model = R_NA * in.response.f_I();

  out.p_error_N = r.p_NB - in.state.p_NB;
  out.v_error_N = r.v_NB - in.state.v_NB;
  const Vector3 e_p = clamped(out.p_error_N, config_.error_max_m);
  const Vector3 e_v = clamped(out.v_error_N, config_.velocity_error_max_m_s);

  // Horizontal and vertical differ: one goes through the attitude, one through the
  // motors. Both in A, whose z is the vertical.
  const Matrix3 R_AN = R_NA.transpose();
  const AttitudeControllerConfig& c = config_;
  const Vector3 kp(c.kp, c.kp, c.kp_z), kv(c.kv, c.kv, c.kv_z), ka(c.ka, c.ka, c.ka_z);
  const double lag = 2 * response_.zeta / response_.omega_rad_s;
  const Vector3 lead(lag, lag, response_.motor_ms * 1e-3);
  const Vector3 forward_A =
      config_.feed_forward
          ? Vector3(R_AN * f + lead.cwiseProduct(R_AN * f_rate))
          : Vector3(R_AN * (-wind_N - beside_N - gravity_N(in.platform)) / lifts);
  const Vector3 u_A = forward_A + kp.cwiseProduct(R_AN * e_p) +
                      kv.cwiseProduct(R_AN * e_v) +
                      ka.cwiseProduct(R_AN * (f - f_model));
  out.f_wish_N = R_NA * u_A;

  // Height before place: the vertical force is kept as far as the motors allow, the
  // horizontal one cut to the tilt.
  Vector3 u = u_A;
  u.z() = std::max(u.z(), 0.2 * kGravity);
  const double tilt = std::clamp(in.tilt_limit_rad, 0.0, tilt_max_);
  const double widest = u.z() * std::tan(tilt);
  if (const double h = u.head<2>().norm(); h > widest) {
    u.head<2>() *= widest / h;
    out.limited = true;
  }

  // The heading goes over in steps that the attitude loop follows without giving up
  // tilt for it.
  const double heading = yaw_of(R_AI * R_IN) + r.yaw;
  const double heading_model = yaw_of(in.response.R_IB);
  const double step_max = config_.yaw_step_max_deg * kDegree;
  const double ahead = lag * (in.platform.w_IN_N.z() + r.yaw_rate);
  const double yaw =
      heading_model +
      std::clamp(wrap_angle(heading + ahead - heading_model), -step_max, step_max);
  out.setpoint.q_IB = Eigen::Quaterniond(attitude_along(u, yaw));

  // Thrust for the attitude that will be there, not for the one that is asked for.
  const double cos_tilt = std::max(in.response.R_IB(2, 2), std::cos(60 * kDegree));
  const double share = u.z() / cos_tilt / thrust_full_;
  out.setpoint.thrust = std::clamp(share, config_.thrust_min, config_.thrust_max);
  out.limited = out.limited || out.setpoint.thrust != share;
  return out;
}

}  // namespace alight
