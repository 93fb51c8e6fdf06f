#pragma once
#include "alight/mission/landing_io.h"
#include "alight/mission/link_monitor.h"
#include "alight/mission/maneuver.h"
#include "alight/mission/mission_config.h"
#include "alight/mission/sight_watch.h"

namespace alight {

/// What the mission knows when it decides.
struct MissionInput {
  Time now = 0;
  OperatorWish wish = OperatorWish::none;  ///< The newest, since the last step.

  bool telemetry_heard = false;
  bool armed = false;
  AutopilotMode mode = AutopilotMode::manual;
  double battery = 1;

  const LinkMonitor* link = nullptr;
  bool platform_ready = false;  ///< Odometry is fresh.

  bool estimate_valid = false;  ///< There is a state, if only a predicted one.
  RelativeState x;              ///< At now.
  RelativeState x_seen;         ///< At the last picture.
  Time seen = 0;                ///< When that was captured.
  double position_sd_m = 0;     ///< Of x, as far as it is known, along the worst axis.
  Blindness blindness = Blindness::leds;  ///< Why nothing newer is seen.
  bool picture_repeats = false;           ///< It equals the one before to the last bit.
  bool computer_was_late = false;         ///< The brain was not run for a while.
  PlatformState platform;                 ///< At now.
  /// Specific force in N that keeps the drone at rest over the pad's middle, as
  /// predicted for Mission::kTouchAhead from now.
  Vector3 f_touch_N = Vector3(0, 0, kGravity);

  const PlanArrival* plan = nullptr;  ///< Arrived since the last step.
};

/// What control is asked to do.
struct MissionCommand {
  enum class Mode : std::uint8_t {
    silent,  ///< Nothing is sent.
    idle,    ///< Attitude level with the platform, no thrust.
    ramp,    ///< Level, thrust as told: the drone leaves the ground.
    track,   ///< Feedback on the maneuver.
    settle   ///< Touching down: from the last attitude over to the pad's, a share of
             ///< the last thrust. Feedback would fight the pad's friction.
  };
  Mode mode = Mode::silent;
  double ramp_share = 0;  ///< ramp: of the nominal hover thrust; settle: of the last.
  double tilt_limit = 0;  ///< rad
  AutopilotOrder order = AutopilotOrder::none;
  double platform_speed_wish = 1;
  bool on_ground = true;     ///< The ground carries the drone: thrust does not move it.
  bool lifted = false;       ///< In this step it was seen to have left the ground,
  Seconds lifted_since = 0;  ///< which it did this long before the picture.
};

/// The mission's state machine (paper, fig:fsm, and what it lacks). Decides where to
/// fly; how is control's.
class Mission {
 public:
  /// s; how far ahead the touch-down is looked at.
  static constexpr Seconds kTouchAhead = 0.4;

  Mission(const MissionConfig& config, const Rig& rig);

  /// @param request  Filled in when a plan is wanted; `has_request` says so.
  MissionCommand step(const MissionInput& in, Output& out);

  const Maneuver& maneuver() const { return maneuver_; }
  const MissionStatus& status() const { return status_; }
  bool flying() const;
  /// Heading in N in which the drone stood before take-off, rad.
  double heading_at_rest() const { return yaw_of(R_rest_); }

 private:
  using Command = MissionCommand;
  void go(MissionState to, const char* reason, const MissionInput& in, Output& out);
  void move_to(const Vector3& p_NB, double speed, const MissionInput& in);
  void request_plan(const MissionInput& in, Output& out);
  /// Something to be told that changes no state: an event all the same.
  void note(const char* reason, const MissionInput& in, Output& out);
  bool settled(const MissionInput& in);
  /// Seen far from where it should be.
  bool strayed(const MissionInput& in) const;
  /// The platform is faster than the drone may fly, and stays so.
  bool too_fast(const MissionInput& in);
  /// Seen, but for a while not well enough to land by it.
  bool too_vague(const MissionInput& in);
  /// No landing comes about: as the user wants it.
  void give_up(const char* reason, const MissionInput& in, Output& out);
  bool overruled(const MissionInput& in, Output& out);
  bool pilot_flies(const MissionInput& in) const;
  bool watch_battery(const MissionInput& in, Output& out);
  void stop_over_ground(const MissionInput& in);
  /// What the platform is wished to do about a drone that its autopilot or its pilot
  /// flies.
  double platform_wish(const MissionInput& in);
  /// The drone would come down on the platform, drove that on.
  bool would_meet(const MissionInput& in) const;
  bool may_be_left(const MissionInput& in);
  Seconds in_state(const MissionInput& in) const;

  void idle(const MissionInput& in, Command& c, Output& out);
  void disarm(const MissionInput& in, Command& c);
  void armed(const MissionInput& in, Command& c, Output& out);
  void taken_off(const MissionInput& in, Command& c, Output& out);
  void follow(const MissionInput& in, Output& out);
  void rendezvous(const MissionInput& in, Output& out);
  void land(const MissionInput& in, Command& c, Output& out);
  void shut_down(const MissionInput& in, Command& c, Output& out);
  void lost_target(const MissionInput& in, Output& out);
  void lost_link(const MissionInput& in, Command& c, Output& out);
  void aborted(const MissionInput& in, Command& c, Output& out);
  void flare(const MissionInput& in);
  void pilot(const MissionInput& in, Command& c, Output& out);
  bool may_touch(const MissionInput& in) const;
  bool touched_down(const MissionInput& in);
  /// A bounce or a slide since the feet took the weight, and where it stands.
  void watch_touch(const MissionInput& in, Output& out);
  const char* how_it_stands(const MissionInput& in) const;

  MissionConfig config_;
  PlatformOutline outline_;
  double gear_height_;
  double arm_;
  double pad_half_;
  double reach_;  // level, of drone and pad together, m
  Vector3 from_lens_;
  double speed_max_;        // the drone's, m/s
  Seconds unseen_lifting_;  // at take-off: two pictures are missing
  double tilt_max_;
  MissionStatus status_;
  Maneuver maneuver_;
  // The operator said go, hold (and not go since), abort.
  bool wanted_ = false, hold_wanted_ = false, abort_wanted_ = false;
  bool airborne_ = false;
  Matrix3 R_rest_ = Matrix3::Identity();
  Vector3 p_rest_ = Vector3::Zero();  // where it stood before take-off

  bool obeyed_ = false;    // the autopilot has followed set-points since it was armed
  bool failsafe_ = false;  // the autopilot's, for want of set-points
  Time failsafe_since_ = 0;
  Blindness blindness_ = Blindness::leds;  // as told last
  Time told_ = 0;                          // when the last note was made
  bool seen_by_pilot_ = false;
  bool lateness_told_ = false;  // the computer's
  bool battery_low_ = false, battery_falling_ = false;
  Time battery_falling_since_ = 0;
  int landings_before_low_ = 0;  // begun when the battery became low
  bool disarms_ = false;         // on the ground: an armed drone is told to disarm
  int starts_ = 0;               // take-offs begun
  bool coming_down_ = false;     // sight was lost before the drone was known to fly
  Time coming_down_since_ = 0;
  bool left_ = false;          // aborted: the autopilot has been told to land
  bool waits_for_it_ = false;  // the platform, for a drone that lands by itself
  Time left_alone_since_ = 0;
  bool alone_ = false;    // the autopilot or the pilot flies, or soon does:
  bool beneath_ = false;  // they would meet, and the platform brakes as the drone does
  Time alone_since_ = 0;
  Time settled_since_ = 0;
  bool settling_ = false;
  Time last_order_ = 0;
  // Planning.
  std::uint32_t plan_id_ = 0;
  bool plan_pending_ = false;
  Time plan_asked_ = 0;
  int plan_tries_ = 0;
  const char* plan_trouble_ = "";
  int planless_ = 0;  // times in a row that no plan came about at the rendezvous
  bool vague_ = false;
  Time vague_since_ = 0;
  bool fast_ = false;
  Time fast_since_ = 0;
  bool awaits_odometry_ = false;  // hold: ends when there is odometry again
  bool committed_ = false;
  bool flared_ = false;
  bool abort_told_ = false;
  // Touch-down.
  bool low_ = false;
  Time low_since_ = 0;
  double low_z_ = 0;
  bool settling_down_ = false;
  Vector3 p_touch_ = Vector3::Zero();
  bool bounced_ = false, slid_ = false;
  Time settle_since_ = 0;
};

}  // namespace alight
