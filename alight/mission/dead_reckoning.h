#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/base/time.h"
#include "alight/geometry/so3.h"

namespace alight {

/// The velocity that the autopilot tells of itself, made good by what was seen. For
/// seconds after the last pose it was sent, its estimator goes on from accelerometers
/// and barometer: these feel the wind and the true thrust, at which a prediction from
/// set-points guesses. (Inertial dead reckoning: Titterton and Weston 2004.)
///
/// Velocities are m/s, in one level frame that does not turn, the platform odometry's I
/// say: the autopilot's own turns as its heading begins anew. No clock, no allocation.
class DeadReckoning {
 public:
  struct Velocity {
    Time captured = 0;
    Vector3 v_IB = Vector3::Zero();
  };

  /// Something else moves the drone, or another drone: nothing is known of it.
  void forget();

  /// Told of a drone that is in sight, moving with `seen_v_IB` when that was captured.
  /// NaN changes nothing; after velocities that were far off for 0.5 s, or from the
  /// first on, none is believed until one is near.
  void in_sight(const Velocity& told, const Vector3& seen_v_IB);

  /// Told of a drone out of sight: it waits here. Lost: NaN, what comes before it was
  /// ever in sight, and the oldest where too many wait. What changes from one report to
  /// the next as no drone can is its estimator, begun anew: off by that much more.
  void out_of_sight(const Velocity& told);

  /// The oldest that waits, captured at `until` or before; false: there is none.
  bool next(Time until, Velocity& out);

 private:
  static constexpr std::size_t kMost = 16;

  void watch_for_jump(const Velocity& told);

  bool known_ = false;
  Time agreed_ = 0;                // when it was told last, near to what was seen
  Vector3 off_ = Vector3::Zero();  // what it tells too much
  Velocity last_;                  // as told, while `known_`
  FixedVector<Velocity, kMost> waiting_;
};

}  // namespace alight
