#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/geometry/platform_state.h"
#include "alight/geometry/rig.h"
#include "alight/geometry/safety.h"

namespace alight {

/// A drone in sight that its autopilot is about to bring down beside the platform, and
/// what moves the two.
struct LeftDrone {
  Vector3 p_NB = Vector3::Zero();
  Vector3 v_IB_N = Vector3::Zero();  ///< Over the ground, in N.
  Vector3 push_N = Vector3::Zero();  ///< As of MissionInput: wind above all, m/s^2.
};

/// The way of such a drone to the floor, past a platform that drives on or brakes: its
/// autopilot brakes over the ground and then gives way to the wind, which it has to
/// learn first. Behind a platform that stands in its lee, or before one that comes
/// back, it must not be left.
class WayDown {
 public:
  static constexpr std::size_t kPlacesMost = 12;
  using Places = FixedVector<Vector3, kPlacesMost>;

  /// How such an autopilot comes to rest over the ground (PX4: MPC_XY_VEL_P_ACC of
  /// 1.8/s), s.
  static constexpr Seconds kBrakes = 0.55;
  /// And comes down: after so long, s, so fast at the least, m/s; the longer it takes,
  /// the farther it is blown.
  static constexpr Seconds kSinksAfter = 0.2;
  static constexpr double kSinksLeast = 0.42;

  explicit WayDown(const Rig& rig);

  /// How near, level, its origin comes to the platform's middle line from pad to camera
  /// until it is on the floor and a little longer, m. `brakes_in`: time constant with
  /// which the platform comes to rest, s; infinite: it drives on as it does.
  double nearest(const LeftDrone& drone, const PlatformState& platform,
                 Seconds brakes_in) const;
  /// Whether that leaves room between pad and rotors.
  bool comes_near(const LeftDrone& drone, const PlatformState& platform,
                  Seconds brakes_in) const;
  /// Whether it keeps clear of a platform that drives on, in less wind than is believed
  /// and in more.
  bool clear(const LeftDrone& drone, const PlatformState& platform) const;

  /// Whether it keeps clear of a platform that is stopped at once, as by an operator
  /// who aborts, in the wind that is believed.
  bool clear_of_stop(const LeftDrone& drone, const PlatformState& platform) const;

  /// Level, of drone and pad together, m.
  double reach() const { return reach_; }

  /// Places in N to leave a drone at, in sight and beside the platform: `first`, and
  /// others around it.
  Places places(const Vector3& first) const;

 private:
  Camera camera_;
  Constellation leds_;
  PlatformOutline outline_;
  double gear_height_, above_floor_;  // m
  double reach_;
};

/// Displacement, as a time at the first speed, of what brakes with time constant `tau`.
double braking(Seconds tau, Seconds t);

}  // namespace alight
