#pragma once
#include <array>
#include <cstdint>
#include <memory>

#include "alight/base/fixed_vector.h"
#include "alight/base/result.h"
#include "alight/base/time.h"
#include "alight/geometry/rig.h"
#include "alight/geometry/sensor_events.h"
#include "alight/sim/scenario.h"
#include "alight/sim/true_rig.h"

namespace alight {

/// What is so at one instant. I's floor lies at z = 0; the platform starts at its
/// origin heading along x, the pad's surface `pad.above_floor_m` above. B is the LED
/// frame.
struct TruthState {
  Time t = 0;
  PlatformState platform;  ///< X_IN, velocities and accelerations of N
  Pose X_IB = Pose::Identity();
  Pose X_NB = Pose::Identity();
  Vector3 v_IB = Vector3::Zero();    ///< m/s in I, of B's origin
  Vector3 v_NB = Vector3::Zero();    ///< m/s, derivative taken in N
  Vector3 w_IB_B = Vector3::Zero();  ///< rad/s
  double rotor_share = 0;            ///< Mean rotor thrust, share of the maximum.
  bool motors_running = false;
  AutopilotMode mode = AutopilotMode::manual;

  RelativeState relative() const { return {X_NB.translation(), X_NB.linear(), v_NB}; }
};

/// What the drone has touched. "Flown" begins when it has been 5 cm clear of anything
/// for 0.2 s; touches before that belong to the start.
struct ContactReport {
  int feet_on_pad = 0;  ///< Now.
  int feet_on_floor = 0;
  bool flown = false;

  bool touched_down = false;  ///< A foot met the pad after the flight; the first time:
  Time first_contact = 0;
  double relative_speed_m_s = 0;  ///< of the drone's origin in N
  double tilt_deg = 0;            ///< of the airframe against the pad
  double yaw_error_deg = 0;       ///< heading of the LED frame in N

  bool landed_elsewhere = false;  ///< A foot met the floor after the flight.
  bool struck =
      false;  ///< Anything else touched anything, or tilt over 60 deg, in flight.
  Time struck_at = 0;
  const char* struck_what = "";  ///< Static text, e.g. "body on pad".
};

/// Events that have arrived, in order.
struct SensorBatch {
  FixedVector<PlatformOdometry, 64> odometry;
  FixedVector<PlatformImu, 128> imu;
  FixedVector<AutopilotTelemetry, 64> telemetry;
  FixedVector<LinkStatus, 16> link;
  int dropped = 0;  ///< Did not fit: collect more often.

  void clear();
};

/// Drone, platform, air, autopilot, radio and odometry: everything but the pictures.
///
/// Time starts at 0 and goes forward by whole steps of `kStep`. Same scenario, rig and
/// seed, same calls: the same bits.
class World {
 public:
  static constexpr Time kStep = 2'000'000;      ///< 500 Hz
  static constexpr Time kMemory = 200'000'000;  ///< How far back truth_at reaches.

  static Result<std::unique_ptr<World>> create(const Scenario& scenario,
                                               const Rig& nominal, std::uint64_t seed);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// Runs the physics up to the last whole step at or before `t`.
  void advance_to(Time t);

  /// Into the radio at `now`; they arrive late, or not at all. Kind::none is not sent.
  /// @pre `now` does not run backwards and has been advanced to within a step.
  void send(const Setpoint& setpoint, Time now);
  void send(const ExternalPose& pose, Time now);
  void send(AutopilotOrder order, Time now);

  /// The platform is wired to the brain; not above the scenario's speed.
  void wish_platform_speed(double m_s);
  void start_platform();

  /// Adds what has arrived up to `now` since the last call.
  void collect(Time now, SensorBatch& out);

  const TruthState& truth() const;  ///< Now.
  TruthState truth_at(
      Time t) const;  ///< Interpolated; clamped to [now - kMemory, now].
  const ContactReport& contact() const;
  /// All feet stand on the pad, and the airframe's footprint lies inside its edges.
  bool standing_on_pad() const;

  const TrueRig& true_rig() const;
  const Scenario& scenario() const;
  /// The fault of this kind that is on at `t`; null when none is. Those of camera,
  /// depth, computer and planner are the caller's to carry out.
  const FaultScenario* fault(FaultKind kind, Time t) const;

 private:
  struct Parts;
  explicit World(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace alight
