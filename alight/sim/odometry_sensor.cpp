#include "alight/sim/odometry_sensor.h"

#include <algorithm>

namespace alight {
namespace {

constexpr double kSpeedNoise = 0.01;     // m/s, each reading
constexpr double kYawRateNoise = 0.01;   // rad/s
constexpr double kImuForceNoise = 0.05;  // m/s^2
constexpr double kImuGyroNoise = 0.005;  // rad/s
constexpr double kLatenessSpread = 0.1;  // of the latency, uniform, on top
constexpr double kImuLateness = 0.005;   // s

Time period(double rate_hz) { return from_seconds(1 / rate_hz); }

Vector3 normal3(Rng& rng, double sd) {
  const double x = rng.normal(0, sd);
  const double y = rng.normal(0, sd);
  const double z = rng.normal(0, sd);
  return {x, y, z};
}

}  // namespace

OdometrySensor::OdometrySensor(const OdometryScenario& config,
                               const PlatformState& start, Rng rng)
    : config_(config),
      rng_(rng),
      scale_(rng_.uniform(-1, 1) * config.scale_error),
      bias_(rng_.uniform(-1, 1) * config.yaw_rate_bias_deg_s * kDegree),
      slip_yaw_(rng_.uniform(-1, 1) * config.slip),
      slip_side_(rng_.uniform(-1, 1) * config.slip),
      X_IN_(start.X_IN),
      last_(start.t),
      next_(start.t + static_cast<Time>(rng_.uniform() *
                                        static_cast<double>(period(config.rate_hz)))),
      next_imu_(start.t),
      imu_bias_N_(normal3(rng_, 0.05)) {}

void OdometrySensor::step(const PlatformState& truth, bool silent) {
  const double dt = to_seconds(truth.t - last_);
  last_ = truth.t;
  const Vector3& w = truth.w_IN_N;
  Vector3 v_N = truth.v_IN_N;
  v_N.x() *= 1 + scale_;
  // Wheels that slip sideways in a turn do not know it.
  v_N.y() += slip_side_ * truth.v_IN_N.x() * std::clamp(w.z(), -1.0, 1.0);
  v_N += drift_N_;
  const Vector3 w_N = w + Vector3(0, 0, bias_ + slip_yaw_ * w.z() + drift_yaw_);

  yaw_error_ += (w_N.z() - w.z()) * dt;
  X_IN_.linear() = from_rpy(0, 0, yaw_error_) * truth.X_IN.linear();
  Vector3 p_I = X_IN_.translation() + X_IN_.linear() * v_N * dt;
  p_I.z() = truth.X_IN.translation().z();
  X_IN_.translation() = p_I;

  if (truth.t >= next_) {
    next_ += period(config_.rate_hz);
    PlatformOdometry event;
    event.captured = truth.t;
    const double late = config_.latency_ms * 1e-3;
    event.received =
        truth.t + from_seconds(late * (1 + kLatenessSpread * rng_.uniform()));
    if (!odometry_.empty()) {
      event.received = std::max(event.received, odometry_.back().received);
    }
    event.X_IN = X_IN_;
    event.v_IN_N = v_N + normal3(rng_, kSpeedNoise).cwiseProduct(Vector3(1, 0.3, 0));
    event.w_IN_N = w_N + Vector3(0, 0, rng_.normal(0, kYawRateNoise));
    event.resets = resets_;
    if (!silent) odometry_.push_back(event);
  }
  if (config_.imu_rate_hz > 0 && truth.t >= next_imu_) {
    next_imu_ += period(config_.imu_rate_hz);
    PlatformImu event;
    event.captured = truth.t;
    event.received = truth.t + from_seconds(kImuLateness);
    event.f_N =
        truth.a_IN_N - gravity_N(truth) + imu_bias_N_ + normal3(rng_, kImuForceNoise);
    event.w_IN_N = w + Vector3(0, 0, bias_) + normal3(rng_, kImuGyroNoise);
    if (!silent) imu_.push_back(event);
  }
}

void OdometrySensor::jump(const Vector3& p_I, bool told) {
  X_IN_.translation() += p_I;
  resets_ += told ? 1 : 0;
}

bool OdometrySensor::receive(Time now, PlatformOdometry& out) {
  if (odometry_.empty() || odometry_.front().received > now) return false;
  out = odometry_.front();
  odometry_.pop_front();
  return true;
}

bool OdometrySensor::receive(Time now, PlatformImu& out) {
  if (imu_.empty() || imu_.front().received > now) return false;
  out = imu_.front();
  imu_.pop_front();
  return true;
}

}  // namespace alight
