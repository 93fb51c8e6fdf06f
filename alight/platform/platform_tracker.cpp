#include "alight/platform/platform_tracker.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "alight/base/bounds.h"

namespace alight {
namespace {

// The IMU's last motion speaks for the times between, s from its own.
constexpr double kImuBefore = -0.1;
constexpr double kImuAhead = 0.4;
constexpr double kJumpPosition = 0.15;  ///< m; more than any motion between two events.
constexpr double kJumpAngle = 0.15;     ///< rad
constexpr double kFadeAcceleration =
    0.3;                            ///< s; a change of speed is not kept up longer.
constexpr double kFadeUnknown = 2;  ///< s, as motion does that was told too long ago.

double gain(double dt, double tau) { return 1 - std::exp(-dt / tau); }

/// Alpha-beta filter (Kalata 1984, "The tracking index") of one vector and its rate.
void alpha_beta(Vector3& x, Vector3& rate, const Vector3& measured, double dt,
                double tau, double tau_rate) {
  const Vector3 ahead = x + rate * dt;
  const Vector3 innovation = measured - ahead;
  const double alpha = gain(dt, tau);
  x = ahead + alpha * innovation;
  rate += alpha * gain(dt, tau_rate) / dt * innovation;
}

/// Critically damped filter of a vector with its first and second derivative (Brookner
/// 1998, "Tracking and Kalman Filtering Made Easy", sec. 1.3): it does not trail behind
/// what changes ever faster.
void critically_damped(Vector3& x, Vector3& rate, Vector3& curve,
                       const Vector3& measured, double dt, double tau) {
  const double keep = std::exp(-dt / tau), take = 1 - keep;
  const Vector3 ahead = x + dt * (rate + 0.5 * dt * curve);
  const Vector3 innovation = measured - ahead;
  x = ahead + (1 - keep * keep * keep) * innovation;
  rate += dt * curve + 1.5 * take * take * (1 + keep) / dt * innovation;
  curve += take * take * take / (dt * dt) * innovation;
}

bool is_rotation(const Matrix3& R) {
  return (R.transpose() * R).isIdentity(1e-6) && R.determinant() > 0;
}

}  // namespace

Result<void> PlatformTrackerConfig::validate() const {
  return check_bounds({{"velocity_tau_s", velocity_tau_s, 1e-3, 5},
                       {"yaw_rate_tau_s", yaw_rate_tau_s, 1e-3, 5},
                       {"acceleration_tau_s", acceleration_tau_s, 1e-3, 5},
                       {"imu_tau_s", imu_tau_s, 1e-3, 5},
                       {"stale_after_s", stale_after_s, 0.01, 10},
                       {"predict_max_s", predict_max_s, 0.01, 10},
                       {"gap_max_s", gap_max_s, 0.01, 10}});
}

PlatformTracker::PlatformTracker(const PlatformTrackerConfig& config)
    : config_(config) {
  assert(config.validate());
}

bool PlatformTracker::add(const PlatformOdometry& odometry) {
  if (!odometry.X_IN.matrix().allFinite() || !is_rotation(odometry.X_IN.linear()) ||
      !odometry.v_IN_N.allFinite() || !odometry.w_IN_N.allFinite()) {
    return false;
  }
  if (count_ > 0 && odometry.captured <= newest().t) return false;

  Fused next{odometry.captured, odometry.X_IN,   odometry.v_IN_N,
             odometry.w_IN_N,   Vector3::Zero(), Vector3::Zero()};
  if (count_ > 0) {
    const Fused& last = newest();
    const double dt = to_seconds(odometry.captured - last.t);
    if (dt <= config_.gap_max_s) {
      next.v_N = last.v_N;
      next.dv_N = last.dv_N;
      next.w_N = last.w_N;
      next.dw_N = last.dw_N;
      alpha_beta(next.v_N, next.dv_N, odometry.v_IN_N, dt, config_.velocity_tau_s,
                 config_.acceleration_tau_s);
      alpha_beta(next.w_N, next.dw_N, odometry.w_IN_N, dt, config_.yaw_rate_tau_s,
                 config_.acceleration_tau_s);
    }
    const Pose expected = predicted(last, odometry.captured).X_IN;
    // After a gap the vehicle may have gone anywhere its speed allows.
    const double slack = dt > config_.gap_max_s ? dt : 0;
    const bool jumped = (odometry.X_IN.translation() - expected.translation()).norm() >
                            kJumpPosition + slack * (1 + odometry.v_IN_N.norm()) ||
                        angle_between(odometry.X_IN.linear(), expected.linear()) >
                            kJumpAngle + slack * (1 + odometry.w_IN_N.norm());
    if (jumped || odometry.resets != announced_) {
      ++resets_;
      first_ = count_;
    }
  }
  announced_ = odometry.resets;
  history_[count_ % kHistory] = next;
  ++count_;
  if (count_ - first_ > kHistory) first_ = count_ - kHistory;
  return true;
}

bool PlatformTracker::add(const PlatformImu& imu) {
  if (!imu.f_N.allFinite() || !imu.w_IN_N.allFinite()) return false;
  if (has_imu_ && imu.captured <= imu_t_) return false;
  const double dt = has_imu_ ? to_seconds(imu.captured - imu_t_) : 0;
  // What weight presses turns with the deck, as the gyros tell without a filter: only
  // what speeds it up is filtered, in axes that do not turn.
  PlatformState tilted;
  if (count_ > 0) tilted = predicted(newest(), imu.captured);
  const Vector3 a_N = imu.f_N + gravity_N(tilted);
  if (!has_imu_ || dt > config_.gap_max_s) {
    imu_w_N_ = imu.w_IN_N;
    imu_a_N_ = a_N;
    for (Vector3* d : {&imu_dw_N_, &imu_ddw_N_, &imu_da_N_, &imu_dda_N_}) d->setZero();
  } else {
    const Matrix3 R = so3_exp(-dt * imu_w_N_);
    for (Vector3* d : {&imu_a_N_, &imu_da_N_, &imu_dda_N_}) *d = R * *d;
    critically_damped(imu_w_N_, imu_dw_N_, imu_ddw_N_, imu.w_IN_N, dt,
                      config_.imu_tau_s);
    critically_damped(imu_a_N_, imu_da_N_, imu_dda_N_, a_N, dt, config_.imu_tau_s);
  }
  has_imu_ = true;
  imu_t_ = imu.captured;
  return true;
}

Seconds PlatformTracker::age(Time now) const {
  if (count_ == 0) return std::numeric_limits<double>::infinity();
  return to_seconds(now - newest().t);
}

PlatformState PlatformTracker::at(Time t) const {
  if (count_ == 0) {
    PlatformState still;
    still.t = t;
    return still;
  }
  std::uint64_t k = count_ - 1;
  while (k > first_ && history_[k % kHistory].t > t) --k;
  const Fused& last = history_[k % kHistory];
  if (!config_.carry_forward) {
    PlatformState as_it_was;
    as_it_was.t = t;
    as_it_was.X_IN = last.X_IN;
    as_it_was.v_IN_N = last.v_N;
    as_it_was.w_IN_N = last.w_N;
    return as_it_was;
  }
  PlatformState state = predicted(last, t);

  const double ahead = to_seconds(t - imu_t_);
  if (has_imu_ && ahead > kImuBefore && ahead < kImuAhead) {
    state.w_IN_N = imu_w_N_ + ahead * (imu_dw_N_ + 0.5 * ahead * imu_ddw_N_);
    state.alpha_IN_N = imu_dw_N_ + ahead * imu_ddw_N_;
    state.a_IN_N = so3_exp(-ahead * 0.5 * (imu_w_N_ + state.w_IN_N)) *
                   (imu_a_N_ + ahead * (imu_da_N_ + 0.5 * ahead * imu_dda_N_));
  }
  return state;
}

PlatformState PlatformTracker::predicted(const Fused& from, Time t) const {
  const double span = std::abs(to_seconds(t - from.t));
  const double sign = t < from.t ? -1 : 1;
  // Nothing jumps as odometry ends: what drove on is likely to, for a while.
  const double beyond = std::max(span - config_.predict_max_s, 0.0);
  const double drives = std::exp(-beyond / kFadeUnknown);
  const double dt = sign * (span - beyond + kFadeUnknown * (1 - drives));
  // A change of speed fades: v(dt) = v + dv tau (1 - exp(-dt / tau)), and its mean.
  const double tau = kFadeAcceleration;
  const double faded = tau * (1 - std::exp(-span / tau));
  const double mean = span > 1e-9 ? tau * (1 - faded / span) : 0;

  PlatformState state;
  state.X_IN = from.X_IN;
  state.v_IN_N = from.v_N + sign * mean * from.dv_N;
  state.w_IN_N = from.w_N + sign * mean * from.dw_N;
  state = predict(state, dt);
  state.t = t;
  const double left = std::exp(-span / tau);
  state.v_IN_N = drives * (from.v_N + sign * faded * from.dv_N);
  state.w_IN_N = drives * (from.w_N + sign * faded * from.dw_N);
  state.alpha_IN_N = left * from.dw_N;
  // Derivative of v in I: of its components in N, and of N itself.
  state.a_IN_N = left * from.dv_N + state.w_IN_N.cross(state.v_IN_N);
  return state;
}

}  // namespace alight
