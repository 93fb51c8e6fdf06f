#pragma once
#include <algorithm>
#include <array>

#include "alight/base/time.h"
#include "alight/geometry/rig.h"

namespace alight {

inline constexpr int kRotors = 4;
using RotorShares = std::array<double, kRotors>;  ///< of the maximum thrust, 0 to 1

/// Where the rotors sit and what they can do. X layout, numbered as PX4 does: front
/// right, back left (both seen from above turning left), front left, back right
/// (turning right).
struct RotorLayout {
  std::array<Vector3, kRotors> p_FR;             ///< m
  std::array<double, kRotors> yaw_per_thrust{};  ///< m; about body z
  double max_thrust = 0;                         ///< N, of one rotor, battery full

  explicit RotorLayout(const DroneSpec& drone);
};

/// Force and moment about F's origin, in F.
struct Wrench {
  Vector3 force = Vector3::Zero();
  Vector3 moment = Vector3::Zero();
};

/// Thrust near a surface over thrust in free air, for a rotor `height` m above it, of a
/// quadrotor with arms `arm` m (Sanchez-Cuevas, Heredia and Ollero 2017, who add the
/// neighbours' wakes and the body's to Cheeseman and Bennett 1955). One from two
/// propeller diameters upwards.
double ground_effect(double height, double propeller_radius, double arm);

/// Four motors: first-order lag, saturation, battery.
class Rotors {
 public:
  /// `thrust_scale` of what the rig file says of the maximum thrust.
  Rotors(const DroneSpec& drone, double thrust_scale);

  /// Advances by `dt` s. Commands outside 0 to 1 saturate; stopped motors run down.
  void step(const RotorShares& command, bool running, Seconds dt);

  /// `ground` is the factor of ground_effect at each rotor.
  Wrench wrench(const std::array<double, kRotors>& ground) const;

  const RotorLayout& layout() const { return layout_; }
  double mean_share() const;
  double battery() const { return charge_; }  ///< Remaining share.
  /// Leaves no more than `charge` in the battery.
  void drain_to(double charge) { charge_ = std::min(charge_, charge); }

 private:
  double thrust_now() const;  ///< N at full share, as the battery stands.

  RotorLayout layout_;
  double motor_tau_;
  double thrust_scale_;
  double hover_share_;
  RotorShares share_{};
  double charge_ = 1;
};

}  // namespace alight
