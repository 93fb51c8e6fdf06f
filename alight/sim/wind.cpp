#include "alight/sim/wind.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

// MIL-F-8785C, 3.7.3.2, at 10 ft.
constexpr double kFeet = 0.3048;
const double kShape = 0.177 + 0.000823 * 10;
const double kLengthAlong = 10 / std::pow(kShape, 1.2) * kFeet;
const double kLengthUp = 10 * kFeet;
const double kSdUp = 0.1;  // of the mean wind
const double kSdAlong = kSdUp / std::pow(kShape, 0.4);

/// Second-order Dryden form, H = sd sqrt(tau) (1 + sqrt(3) tau s) / (1 + tau s)^2 on
/// white noise, as two first-order lags with exact steps.
double second_order(double state[2], double sd, double tau, double dt, double noise) {
  const double keep = std::exp(-dt / tau);
  const double gain = 1 - keep;
  // White noise held over a step, with the density that gives the filter variance sd^2.
  const double input = sd * std::sqrt(tau / dt) * noise;
  state[0] += gain * (input - state[0]);
  state[1] += gain * (state[0] - state[1]);
  // (1 + a s tau) / (1 + s tau)^2 = a / (1 + s tau) + (1 - a) / (1 + s tau)^2
  const double a = std::sqrt(3.0);
  return a * state[0] + (1 - a) * state[1];
}

}  // namespace

Wind::Wind(const WindScenario& config, Rng rng) : rng_(rng) {
  const double from = config.from_deg * kDegree;
  direction_ = Vector3(-std::cos(from), -std::sin(from), 0);
  across_ = Vector3(-direction_.y(), direction_.x(), 0);
  mean_ = config.mean_m_s * direction_;
  if (config.gusts == Gusts::none) return;
  sd_along_ = kSdAlong * config.mean_m_s;
  sd_up_ = kSdUp * config.mean_m_s;
  // Begins in the midst of it.
  along_ = sd_along_ * rng_.normal();
  for (int k = 0; k < 4000; ++k) step(0.05, config.mean_m_s);
}

Vector3 Wind::step(Seconds dt, double airspeed) {
  if (sd_along_ == 0) return mean_;
  const double speed = std::max(0.5, airspeed);
  const double tau = kLengthAlong / speed;
  const double tau_up = kLengthUp / speed;
  const double keep = std::exp(-dt / tau);
  along_ = keep * along_ + std::sqrt(1 - keep * keep) * sd_along_ * rng_.normal();
  const double across = second_order(across_state_, sd_along_, tau, dt, rng_.normal());
  const double up = second_order(up_state_, sd_up_, tau_up, dt, rng_.normal());
  return mean_ + along_ * direction_ + across * across_ + up * Vector3::UnitZ();
}

}  // namespace alight
