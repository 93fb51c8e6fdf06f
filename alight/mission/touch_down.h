#pragma once
#include "alight/mission/maneuver.h"
#include "alight/mission/mission_config.h"
#include "alight/mission/mission_input.h"

namespace alight {

/// The last tenths of a second of a landing: the drone stands up, its feet take the
/// weight as its thrust goes, and it is seen to stand, to bounce or to slide.
///
/// Wind and turns have it lean. Upright on its feet with its thrust still there it is
/// blown away, and a drone whose thrust goes while it leans falls onto its feet; both
/// have thrown drones over. So thrust goes when it will be the feet's turn, earlier the
/// harder it is blown, what is left of it leans into the wind, and the motors stop only
/// once it is upright and slides no more. Against a strong push, as in 4 m/s of wind,
/// it stays leant down to the pad: a radio may be silent just then.
class TouchDown {
 public:
  TouchDown(const MissionConfig& config, const Rig& rig);

  /// A landing begins.
  void begin();
  /// Has the landing end upright, and when the drone gets there, not when its reference
  /// does. Each step of a landing until `settling`.
  void flare(const MissionInput& in, Maneuver& maneuver);
  /// How long before a landing's end the flare may begin, s.
  Seconds begins_before_end() const;
  /// From the commit on, each step: whether thrust is to go is decided here.
  void feel(const MissionInput& in, const Maneuver& maneuver);
  /// From the commit on: what share of the pad's own attitude is to be asked for. The
  /// drone's lags behind, and it is there half the time before the touch. Where it
  /// would touch far off the middle, by `miss` m, being brought back comes first.
  double square_up(const MissionInput& in, double miss);
  /// In how long it will touch as it sinks, s, at most kTouchAhead.
  Seconds touches_within(const MissionInput& in) const;
  /// Of its feet from its middle along the pad's edges, m.
  double foot_spread() const;
  /// The feet take the weight.
  bool settling() const { return settling_; }
  /// While settling: of the last thrust in flight.
  double thrust_share(Time now) const;
  /// While settling: the specific force, in N, against which its last thrust leans.
  const Vector3& leans_against_N() const { return f_touch_N_; }
  /// While settling, each step: nothing was heard of it as its thrust was to go, or the
  /// computer stood still; it is heard again, and it slides off the pad before that is
  /// done: with what thrust it still has it had better fly.
  bool slides_off(const MissionInput& in);
  /// Settled, or as good as it will be: the motors may stop.
  bool stands(const MissionInput& in);
  /// Its autopilot has brought it down onto the pad by itself, and it rests there:
  /// asked each step, not past the commit.
  bool was_set_down(const MissionInput& in);
  /// Since the feet took the weight: that it bounced or slid, told once each; else
  /// null.
  const char* moved(const MissionInput& in);
  const char* how_it_stands(const MissionInput& in) const;

 private:
  /// By how much the flare lessens the lean that a push asks for, m/s^2.
  double flare_most(const MissionInput& in) const;
  Seconds flare_lasts(double a) const;
  bool may_touch(const MissionInput& in, const Maneuver& maneuver) const;
  bool carried(const MissionInput& in);
  Seconds still_for(const MissionInput& in);

  MissionConfig config_;
  double gear_height_;
  double arm_;
  double pad_half_;
  bool flared_ = false;
  bool squares_up_ = false;
  double square_up_most_ = 0;
  Time flare_aimed_ = 0;
  bool settling_ = false;
  Time settle_since_ = 0;
  Vector3 p_touch_ = Vector3::Zero();
  Vector3 f_touch_N_ = Vector3(0, 0, kGravity);
  bool low_ = false;  // not sinking any more, nor sliding, since:
  Time low_since_ = 0;
  Vector3 low_p_ = Vector3::Zero();
  bool bounced_ = false, slid_ = false;
  Time deaf_ = 0;  // last, while settling
};

}  // namespace alight
