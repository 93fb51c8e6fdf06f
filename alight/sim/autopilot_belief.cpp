#include "alight/sim/autopilot_belief.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kNoiseTau = 0.4;    // s
constexpr double kBaroTau = 1.0;     // s
constexpr double kBaroNoise = 0.05;  // m/s
constexpr double kAccelerationTau = 0.02;

Vector3 normal3(Rng& rng) {
  const double x = rng.normal();
  const double y = rng.normal();
  const double z = rng.normal();
  return {x, y, z};
}

}  // namespace

AutopilotBelief::AutopilotBelief(const AutopilotBeliefConfig& config, Rng rng)
    : config_(config), rng_(rng) {
  const double way = rng_.uniform(0, 2 * kPi);
  const double tilt = rng_.uniform() * config.tilt_error_deg * kDegree;
  tilt_F_ = tilt * Vector3(std::cos(way), std::sin(way), 0);
  heading_ = rng_.uniform(-kPi, kPi);
  heading_drift_ = rng_.uniform(-1, 1) * config.heading_drift_deg_min * kDegree / 60;
}

void AutopilotBelief::step(const Matrix3& R_IF, const Vector3& f_F, double climb,
                           Time now, Seconds dt) {
  // A tilt error that is fixed in the airframe turns with its heading.
  const Vector3 tilt_I = from_rpy(0, 0, yaw_of(R_IF)) * tilt_F_;
  const Matrix3 level = so3_exp(tilt_I + pull_I_);
  if (!config_.external_pose) {
    heading_ += heading_drift_ * dt;
    const Vector3 f_I = level * R_IF * f_F;
    const double f = f_I.norm();
    if (f > 0.5 * kGravity) {
      Vector3 pull = f_I.cross(Vector3::UnitZ()) / f + tilt_I;
      pull.z() = 0;
      pull_I_ += config_.gravity_pull_per_s * dt * pull;
    }
  }
  R_IF_ = from_rpy(0, 0, heading_) * level * R_IF;

  const Vector3 a_I = R_IF_ * f_F - Vector3(0, 0, kGravity);
  a_I_ += (1 - std::exp(-dt / kAccelerationTau)) * (a_I - a_I_);
  v_I_ += a_I * dt;
  const double baro = climb + kBaroNoise * noise_I_.z();
  v_I_.z() += (1 - std::exp(-dt / kBaroTau)) * (baro - v_I_.z());
  const double keep = std::exp(-dt / kNoiseTau);
  noise_I_ = keep * noise_I_ + std::sqrt(1 - keep * keep) * normal3(rng_);
  v_reported_ = v_I_ + config_.velocity_noise_m_s * noise_I_;
  past_[count_++ % kPast] = {now, yaw_of(R_IF_), v_I_};
}

void AutopilotBelief::fuse(const ExternalPose& pose, Time now) {
  if (!config_.external_pose || !pose.X_IB.matrix().allFinite() ||
      !pose.v_IB.allFinite() || count_ == 0) {
    return;
  }
  const double since = to_seconds(pose.captured - pose_captured_);
  const bool restart = !velocity_valid(now) || pose.resets != resets_;
  if (!restart && since <= 0) return;

  // Compared with the belief at the pose's capture, as far back as it is remembered.
  std::size_t k = count_ - 1;
  const std::size_t oldest = count_ > kPast ? count_ - kPast : 0;
  while (k > oldest && past_[k % kPast].t > pose.captured) --k;
  const Past then = past_[k % kPast];
  const double turn = wrap_angle(yaw_of(pose.X_IB.linear()) - then.yaw);
  const Vector3 miss = pose.v_IB - then.v_I;
  const double yaw_gain = restart ? 1 : 1 - std::exp(-since / config_.heading_tau_s);
  const double gain = restart ? 1 : 1 - std::exp(-since / config_.velocity_tau_s);
  correct(yaw_gain * turn, gain * miss);
  aligned_ = true;
  resets_ = pose.resets;
  pose_received_ = now;
  pose_captured_ = pose.captured;
}

void AutopilotBelief::reset(double turn, const Vector3& v_I) {
  correct(turn, v_I);
  v_reported_ += v_I;
}

void AutopilotBelief::correct(double turn, const Vector3& v_I) {
  heading_ = wrap_angle(heading_ + turn);
  R_IF_ = from_rpy(0, 0, turn) * R_IF_;
  v_I_ += v_I;
  const std::size_t oldest = count_ > kPast ? count_ - kPast : 0;
  for (std::size_t i = oldest; i < count_; ++i) {
    past_[i % kPast].yaw += turn;
    past_[i % kPast].v_I += v_I;
  }
}

bool AutopilotBelief::velocity_valid(Time now) const {
  return aligned_ && to_seconds(now - pose_received_) <= config_.dead_reckoning_s;
}

}  // namespace alight
