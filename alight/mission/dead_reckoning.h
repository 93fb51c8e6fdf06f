#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/base/time.h"
#include "alight/geometry/sensor_events.h"

namespace alight {

/// The velocity that the autopilot tells of itself, made good by what was seen. For
/// seconds after the last pose it was sent, its estimator goes on from accelerometers
/// and barometer: these feel the wind and the true thrust, at which a prediction from
/// set-points guesses. (Inertial dead reckoning: Titterton and Weston 2004.)
///
/// Velocities are in the autopilot's own inertial frame, m/s. No clock, no allocation.
class DeadReckoning {
 public:
  struct Velocity {
    Time captured = 0;
    Vector3 v_IB = Vector3::Zero();
  };

  /// Something else moves the drone, or another drone: nothing is known of it.
  void forget();

  /// Telemetry of a drone that is in sight, moving with `seen_v_IB` when that was
  /// captured. One that tells no velocity changes nothing; after one that is far off,
  /// none is believed until one is near.
  void in_sight(const AutopilotTelemetry& told, const Vector3& seen_v_IB);

  /// Telemetry of a drone out of sight waits here. Lost: what tells no velocity, what
  /// comes before it was ever in sight, and the oldest where too many wait.
  void out_of_sight(const AutopilotTelemetry& told);

  /// The oldest that waits, captured at `until` or before; false: there is none.
  bool next(Time until, Velocity& out);

 private:
  static constexpr std::size_t kMost = 16;

  bool known_ = false;
  Vector3 off_ = Vector3::Zero();  // what it tells too much
  FixedVector<Velocity, kMost> waiting_;
};

}  // namespace alight
