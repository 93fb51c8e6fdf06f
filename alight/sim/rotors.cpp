#include "alight/sim/rotors.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kYawPerThrust = 0.016;  // m, small two-bladed propellers
constexpr double kRotorsAbove = 0.015;   // m, rotor plane above B's origin
constexpr double kHoverSeconds = 360;    // a full battery
constexpr double kSagEmpty = 0.12;       // thrust lost at the end of the battery
constexpr double kSagLoad = 0.05;        // thrust lost at full load
constexpr double kBodyLift = 2;          // K_b of the authors' fit

double raw_ground_effect(double z, double R, double arm) {
  const double d = arm * std::sqrt(2.0);  // between neighbours
  const double b = 2 * arm;               // between opposites
  const auto cube = [](double square) { return square * std::sqrt(square); };
  const double z4 = 4 * z * z;
  const double own = R * R / (16 * z * z);
  const double neighbours = R * R * z / cube(d * d + z4);
  const double opposite = R * R / 2 * z / cube(2 * d * d + z4);
  const double body = 2 * R * R * kBodyLift * z / cube(b * b + z4);
  return 1 / (1 - own - neighbours - opposite - body);
}

}  // namespace

RotorLayout::RotorLayout(const DroneSpec& drone)
    : max_thrust(drone.thrust_to_weight * drone.mass_kg * kGravity / kRotors) {
  const double a = drone.arm_m / std::sqrt(2.0);
  p_FR = {Vector3(a, -a, kRotorsAbove), Vector3(-a, a, kRotorsAbove),
          Vector3(a, a, kRotorsAbove), Vector3(-a, -a, kRotorsAbove)};
  // The air brakes a rotor that turns left, which turns the airframe to the right.
  yaw_per_thrust = {-kYawPerThrust, -kYawPerThrust, kYawPerThrust, kYawPerThrust};
}

double ground_effect(double height, double propeller_radius, double arm) {
  const double R = propeller_radius;
  const double none = 4 * R;
  if (height >= none) return 1;
  // Nearer than a radius the wakes no longer form; the fit ends there.
  const double z = std::max(height, R);
  // Taken to one at two diameters, where the fit still says a little.
  return 1 + raw_ground_effect(z, R, arm) - raw_ground_effect(none, R, arm);
}

Rotors::Rotors(const DroneSpec& drone, double thrust_scale)
    : layout_(drone),
      motor_tau_(drone.motor_ms * 1e-3),
      thrust_scale_(thrust_scale),
      hover_share_(1 / drone.thrust_to_weight) {}

void Rotors::step(const RotorShares& command, bool running, Seconds dt) {
  const double gain = 1 - std::exp(-dt / motor_tau_);
  double power = 0;
  for (std::size_t i = 0; i < kRotors; ++i) {
    const double wanted = running ? std::clamp(command[i], 0.0, 1.0) : 0.0;
    share_[i] += gain * (wanted - share_[i]);
    power += std::pow(share_[i] / hover_share_, 1.5) / kRotors;
  }
  charge_ = std::max(0.0, charge_ - power * dt / kHoverSeconds);
}

double Rotors::mean_share() const {
  return (share_[0] + share_[1] + share_[2] + share_[3]) / kRotors;
}

double Rotors::thrust_now() const {
  const double sag = 1 - kSagEmpty * (1 - charge_) - kSagLoad * mean_share();
  return layout_.max_thrust * thrust_scale_ * sag;
}

Wrench Rotors::wrench(const std::array<double, kRotors>& ground) const {
  const double full = thrust_now();
  Wrench sum;
  for (std::size_t i = 0; i < kRotors; ++i) {
    const double thrust = share_[i] * full * ground[i];
    const Vector3 force(0, 0, thrust);
    sum.force += force;
    sum.moment += layout_.p_FR[i].cross(force);
    sum.moment.z() += layout_.yaw_per_thrust[i] * thrust;
  }
  return sum;
}

}  // namespace alight
