#pragma once
#include "alight/control/reference.h"
#include "alight/geometry/trajectory.h"
#include "alight/mission/flare.h"
#include "alight/mission/pace.h"

namespace alight {

/// What the drone is asked to do, as a function of time: stand still in N, go on as it
/// flies, move to a point, or fly a planned landing and, past its end, go on down at
/// its last speed.
class Maneuver {
 public:
  Maneuver() = default;  ///< At rest in the origin of N.

  static Maneuver stay(const Vector3& p_NB, double yaw);
  /// On from `from` at `start` with its velocity and acceleration, for a moment.
  static Maneuver coast(const FlatState& from, Time start);
  static Maneuver move(const PointToPoint& move);
  /// `sink_m`: how far below the trajectory's end the reference may go on.
  static Maneuver landing(const Trajectory& trajectory, Time start, double sink_m);

  FlatState at(Time t) const;
  /// Of a landing: from `from` on it goes over to this share, 0 to 1, of its speed.
  void aim_pace(Time from, double rate) { pace_.aim(from, rate); }
  double rate(Time t) const { return pace_.at(t).rate; }
  /// Of a landing: how high it comes to rest if its pace is aimed at 0 at `t`, m. The
  /// trajectory's end is the least.
  double stops_at_z(Time t) const;
  /// Of a landing: the state it comes to.
  FlatState end() const { return trajectory_.at(trajectory_.duration()); }
  /// Of a landing: how it ends. Nearer to the end than the flare lasts the reference
  /// steps aside, by what the flare moves it there; its speed does not where it waits.
  void end_with(const Flare& flare) { flare_ = flare; }
  /// Of a landing: the flare comes so much later than the end of the trajectory, s.
  void delay_flare(Seconds by) { flare_delay_ = by; }
  Seconds flare_delay() const { return flare_delay_; }
  /// How far a landing is behind its plan by having been slowed down, s.
  Seconds lag(Time t) const { return to_seconds(t - start_) - pace_.at(t).s; }

  bool done(Time t) const { return past_end(t) >= 0; }
  /// Time since the end of a move or, by its own pace, of a landing; negative before.
  /// `stay` and `coast` ended at 0.
  Seconds past_end(Time t) const;

 private:
  enum class Kind : std::uint8_t { stay, coast, move, landing };
  Kind kind_ = Kind::stay;
  FlatState rest_;
  PointToPoint move_;
  Trajectory trajectory_;
  Time start_ = 0;
  Pace pace_;
  Flare flare_;
  Seconds flare_delay_ = 0;
  double sink_m_ = 0;
};

}  // namespace alight
