#pragma once
#include "alight/mission/blind_climb.h"
#include "alight/mission/into_view.h"
#include "alight/mission/maneuver.h"
#include "alight/mission/miss.h"
#include "alight/mission/mission_config.h"
#include "alight/mission/mission_input.h"
#include "alight/mission/quiet_deck.h"
#include "alight/mission/touch_down.h"
#include "alight/mission/way_down.h"

namespace alight {

/// What control is asked to do.
struct MissionCommand {
  enum class Mode : std::uint8_t {
    silent,  ///< Nothing is sent.
    idle,    ///< Attitude level with the platform, no thrust.
    ramp,    ///< Level, thrust as told: the drone leaves the ground.
    track,   ///< Feedback on the maneuver.
    settle   ///< Touching down: from the last attitude over to the pad's, leaning
             ///< against f_rest_N, a share of the last thrust. Feedback would fight the
             ///< pad's friction.
  };
  Mode mode = Mode::silent;
  double ramp_share = 0;  ///< ramp: of the nominal hover thrust; settle: of the last.
  Vector3 f_rest_N = Vector3(0, 0, kGravity);  ///< settle: the specific force that
                                               ///< keeps it where it is.
  double square_up = 0;     ///< track: share of the way from the attitude that feedback
                            ///< asks for over to that of the pad.
  double tilt_limit = 0;    ///< rad
  double thrust_least = 0;  ///< track: of the nominal hover thrust. Not zero: the drone
                            ///< leaves the ground or has just done so.
  double raise_m = 0;       ///< track: on top of the reference, for it may have sunk,
  double raise_m_s = 0;     ///< which grows so fast.
  AutopilotOrder order = AutopilotOrder::none;
  double platform_speed_wish = 1;
  bool on_ground = true;     ///< The ground carries the drone: thrust does not move it.
  bool lifted = false;       ///< In this step it was seen to leave the ground,
  bool carried = false;      ///< by its thrust alone (it did not only slide),
  Seconds lifted_since = 0;  ///< which it did this long before the picture.
};

/// The mission's state machine (paper, fig:fsm, and what it lacks). Decides where to
/// fly; how is control's.
class Mission {
 public:
  Mission(const MissionConfig& config, const Rig& rig);

  /// @param request  Filled in when a plan is wanted; `has_request` says so.
  MissionCommand step(const MissionInput& in, Output& out);

  /// Where the drone is to be at `t`, also when that is later than now.
  FlatState reference(Time t) const {
    return has_next_ && t >= next_from_ ? next_.at(t) : maneuver_.at(t);
  }
  /// When a landing that goes on now would touch, within what is foreseen of decks;
  /// kTouchAhead while there is none.
  Seconds touches_in(const MissionInput& in) const;
  const MissionStatus& status() const { return status_; }
  bool flying() const;
  /// Heading in N in which the drone stood before take-off, rad.
  double heading_at_rest() const { return yaw_of(R_rest_); }

 private:
  using Command = MissionCommand;
  void go(MissionState to, const char* reason, const MissionInput& in, Output& out);
  void move_to(const Vector3& p_NB, double speed, const MissionInput& in);
  /// From there on, with what room is below it.
  void begin_move(const FlatState& from, const Vector3& p_NB, MoveLimits limits,
                  const MissionInput& in);
  /// From where and as it flies, braking within the room below it.
  void move_from_here(const Vector3& p_NB, MoveLimits limits, const MissionInput& in);
  /// How far it may sink there before it rises, m.
  double room_below(const Vector3& p_NB) const;
  /// Where a take-off leads, and how fast.
  Vector3 above_pad() const;
  MoveLimits climb() const;
  /// As plans are told it.
  PlatformState platform_at(Time t, const MissionInput& in) const;
  /// From where the reference will be when a plan can be in force.
  PlanRequest request_from_reference(const MissionInput& in) const;
  void request_plan(const MissionInput& in, Output& out);
  void ask(PlanRequest request, const MissionInput& in, Output& out);
  /// The plan that was asked for, once; null as long as there is none.
  const PlanResult* plan_arrived(const MissionInput& in);
  /// The landing under way, anew for what the platform does now.
  void replan(const MissionInput& in, Output& out);
  /// A certified way back instead of the one begun at once.
  void take_way_back(const MissionInput& in);
  /// Something to be told that changes no state: an event all the same.
  void note(const char* reason, const MissionInput& in, Output& out);
  /// Without it being the reason of the state.
  void mention(const char* what, const MissionInput& in, Output& out);
  bool settled(const MissionInput& in);
  /// Seen to move as it is told: set-points arrive.
  bool obeys(const MissionInput& in) const;
  /// Where it is the platform's turn moves it much more than at the follow point.
  bool swept(const MissionInput& in) const;
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
  /// For sure: what does not land now is left to its autopilot.
  bool battery_empty(const MissionInput& in) const;
  void stop_over_ground(const MissionInput& in);
  /// In N: with which a blind drone is left to its autopilot, m/s.
  Vector3 left_with_over_ground(const MissionInput& in) const;
  /// What the platform is wished to do about a drone that its autopilot or its pilot
  /// flies.
  double platform_wish(const MissionInput& in);
  bool stopped_beneath(const MissionInput& in);
  /// The drone is not seen to fly on with the platform, nor to stay up as it is told.
  bool falls_behind(const MissionInput& in) const;
  /// The share of its speed at which the pad keeps beneath a drone that brakes.
  double stays_beneath(const MissionInput& in) const;
  double ramp_rate(const MissionInput& in) const;  // 1/s
  /// Of the nominal hover thrust, before it is known to fly.
  double ramp_share(const MissionInput& in);
  bool left_floor(const MissionInput& in) const;
  Seconds blind_for_at_most() const;
  bool at_gear_height(const MissionInput& in, double slack) const;
  bool stood(const MissionInput& in);
  bool lifts_off(const MissionInput& in) const;
  bool still_stands(const MissionInput& in) const;
  bool misses_pictures(const MissionInput& in) const;
  bool lost_as_it_lifts(const MissionInput& in) const;
  /// The computer stood still during this ramp, and no picture has shown it since.
  bool slept_unseen(const MissionInput& in) const;
  void come_down(bool for_the_link, const MissionInput& in);
  void taken_over_on_ramp(double share, const MissionInput& in, Command& c,
                          Output& out);
  void lift(bool carried, double flown, const MissionInput& in, Command& c,
            Output& out);
  bool leaves_ground(const MissionInput& in) const;
  void leave_ground(const MissionInput& in, Command& c) const;
  void keep_off_ground(const MissionInput& in, Command& c) const;
  /// Aborted in sight and clear of the platform, which stays to see it to the floor.
  bool stays_beside(const MissionInput& in) const;
  bool seen_clear(const MissionInput& in) const;
  /// Near the pad on its way to the floor, if the platform stays beside it.
  bool comes_near(const MissionInput& in) const;
  LeftDrone left_here(const MissionInput& in) const;
  void choose_leave_place(const MissionInput& in);
  /// Others have stopped its motors, wherever that is.
  void came_down(const MissionInput& in);
  /// Has the motors stopped of a drone that its autopilot has landed beside the
  /// platform.
  /// @returns false: it does not stand there.
  bool stop_on_floor(const MissionInput& in, Command& c, Output& out);
  /// Each step, for it is only given now and then: one may be lost on its way.
  /// @returns whether it is given now.
  bool keep_ordering(AutopilotOrder order, const MissionInput& in, Command& c);
  /// Its autopilot acted for want of set-points less than `s` before `t`.
  bool alone_within(Seconds s, Time t) const;
  /// The drone would come down on the platform, drove that on.
  bool would_meet(const MissionInput& in) const;
  Vector3 search_from(const MissionInput& in) const;
  bool may_be_left(const MissionInput& in);
  /// Whether or not it is heard.
  bool does_as_told(const MissionInput& in) const;
  /// It has been seen flying for long enough to know its weight and the wind.
  bool learnt(const MissionInput& in) const;
  Seconds in_state(const MissionInput& in) const;

  void idle(const MissionInput& in, Command& c, Output& out);
  /// On the ground: at once, and until it is heard that they stand.
  void stop_motors(const MissionInput& in, Command& c);
  /// What has been begun so goes on.
  void disarm(const MissionInput& in, Command& c);
  void armed(const MissionInput& in, Command& c, Output& out);
  void taken_off(const MissionInput& in, Command& c, Output& out);
  void follow(const MissionInput& in, Output& out);
  void rendezvous(const MissionInput& in, Output& out);
  /// Its autopilot has set it down on the pad: its motors are stopped.
  /// @returns false: it does not rest there.
  bool set_down(const MissionInput& in, Command& c, Output& out);
  void leave_pad(const MissionInput& in, Command& c, Output& out);
  bool sinks_beside(const MissionInput& in) const;
  bool gone_meanwhile(const MissionInput& in) const;
  void land(const MissionInput& in, Command& c, Output& out);
  /// Gusts pass, and decks come round: better to wait above the pad than to touch
  /// beside its middle or on the edge of a foot.
  /// @returns It waits, and is not to be committed to its landing.
  bool wait_low(const MissionInput& in, const FlatState& ref, double miss,
                double commit_height);
  bool may_start_anew() const;
  void shut_down(const MissionInput& in, Command& c, Output& out);
  void lost_target(const MissionInput& in, Output& out);
  void lost_link(const MissionInput& in, Command& c, Output& out);
  void aborted(const MissionInput& in, Command& c, Output& out);
  void pilot(const MissionInput& in, Command& c, Output& out);

  MissionConfig config_;
  PlatformOutline outline_;
  double gear_height_;
  double arm_;
  double pad_half_;
  double above_floor_;  // the pad, m
  Vector3 from_lens_;
  double speed_max_;        // the drone's, m/s
  Seconds unseen_lifting_;  // at take-off: two pictures are missing
  double tilt_max_;
  IntoView into_view_;
  WayDown way_down_;
  bool leaves_where_told_;  // by the user
  WayDown::Places leave_places_;
  MissionStatus status_;
  Maneuver maneuver_;
  Maneuver next_;  // takes over at next_from_
  Time next_from_ = 0;
  bool has_next_ = false;
  PlanResult plan_;  // of the landing under way, the last certified
  // The operator said go, hold (and not go since), abort.
  bool wanted_ = false, hold_wanted_ = false, abort_wanted_ = false;
  bool airborne_ = false;
  Time lifted_at_ = 0;
  Time climbs_since_ = 0;    // its way up begins
  double highest_ = 0;       // that it was seen since, m
  double share_lifted_ = 0;  // of the nominal hover thrust, then
  Matrix3 R_rest_ = Matrix3::Identity();
  Vector3 p_rest_ = Vector3::Zero();  // where it stood before take-off

  bool obeyed_ = false;    // the autopilot has followed set-points since it was armed,
  Time obeyed_till_ = 0;   // for all that is known until then
  Time as_told_till_ = 0;  // seen to move as it is told
  bool failsafe_ = false;  // the autopilot's, for want of set-points
  Time failsafe_since_ = 0, failsafe_till_ = 0;
  const char* reason_before_ = "";         // it began
  Blindness blindness_ = Blindness::leds;  // as told last
  Time told_ = 0;                          // when the last note was made
  Vector3 search_goal_ = Vector3::Zero();  // of a lost target
  bool seen_by_pilot_ = false;
  bool lateness_told_ = false;  // the computer's
  bool battery_low_ = false, battery_falling_ = false;
  Time battery_falling_since_ = 0;
  int landings_before_low_ = 0;  // begun when the battery became low
  bool disarms_ = false;         // on the ground: an armed drone is told to disarm
  int starts_ = 0;               // take-offs begun
  Time stood_since_ = 0;         // on its feet on the pad
  // Sight or the link was lost before the drone was known to fly.
  bool coming_down_ = false, for_the_link_ = false;
  Time coming_down_since_ = 0;
  BlindClimb blind_climb_;
  double ramp_most_ = 0;  // that this start has asked for
  bool left_ = false;     // aborted: the autopilot has been told to land
  Vector3 leave_place_ = Vector3::Zero();  // where it is to be,
  Time leave_by_ = 0;                      // by then at the latest
  Time chose_place_ = 0;
  Time not_clear_ = 0;              // of the platform, last, to be left there
  bool stops_here_ = false;         // over the ground, to be left
  bool floor_told_ = false;         // that it stands there
  bool for_want_of_sight_ = false;  // aborted: nothing else was wrong
  bool waits_for_it_ = false;       // the platform, for a drone that lands by itself
  Vector2 landing_v_IN_N_ =
      Vector2::Zero();            // the platform's, as the landing began, m/s
  bool stays_for_touch_ = false;  // it has stopped since
  Time left_alone_since_ = 0;
  bool alone_ = false;     // the autopilot or the pilot flies, or soon does:
  Seconds brakes_in_ = 0;  // the platform does, if not zero: they would meet, or the
                           // drone comes down beside it and is to be seen
  Time alone_since_ = 0;
  Vector2 alone_v_IN_N_ = Vector2::Zero();  // the platform's then, m/s
  Time settled_since_ = 0;
  bool settling_ = false;
  Time last_order_ = 0;
  Time arm_told_ = 0;
  // Planning.
  std::uint32_t plan_id_ = 0;
  bool plan_pending_ = false;
  Time plan_asked_ = 0;
  int plan_tries_ = 0;
  int replans_ = 0;  // of the landing under way
  const char* plan_trouble_ = "";
  int planless_ = 0;  // times in a row that no plan came about at the rendezvous
  bool vague_ = false;
  Time vague_since_ = 0;
  bool fast_ = false;
  Time fast_since_ = 0;
  bool awaits_odometry_ = false;  // hold: ends when there is odometry again
  bool committed_ = false;
  bool abort_told_ = false;
  UsualMiss usual_miss_;
  QuietDeck quiet_deck_;
  TouchDown touch_down_;
};

}  // namespace alight
