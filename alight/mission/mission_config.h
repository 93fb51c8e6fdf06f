#pragma once
#include <array>

#include "alight/base/result.h"
#include "alight/geometry/rig.h"
#include "alight/geometry/safety.h"

namespace alight {

/// Where, when and how fast the mission goes; lengths in N. Points and lengths that are
/// left zero are `places_for`'s to set, where that is said.
struct MissionConfig {
  Safety safety;
  Vector3 follow_point = Vector3::Zero();
  Vector3 rendezvous_point = Vector3::Zero();
  Vector3 search_point = Vector3::Zero();  ///< Where a lost target is searched for, as
                                           ///< long as pictures come.
  // Distance of those two from the lens, in multiples of that from lens to pad: far
  // enough to see the whole approach, near enough to see well. What is beyond the pad
  // is less where the lens is farther off than the drone needs (places_for): so far
  // behind a platform that turns nothing follows it.
  double follow_distance = 2.7;
  double rendezvous_distance = 2.2;
  double take_off_height_m = 0;  ///< First stop above the pad,
  double take_off_back_m = 0.2;  ///< away from the lens by this, into the picture.
  bool start_on_floor = false;   ///< The first climb is blind.

  double climb_speed_m_s = 0.6;
  double move_speed_m_s = 0.9;
  double move_acceleration_m_s2 = 1.2;
  double settle_s = 0.6;       ///< On the spot this long before going on,
  double settle_more_s = 0.9;  ///< Longer by this after each landing that failed: what
                               ///< came in between may come round regularly.
  double settle_error_m = 0.12;    ///< this near to the reference,
  double settle_speed_m_s = 0.35;  ///< and no faster against it.

  double plan_ahead_s = 0.12;  ///< From request to the start of the trajectory.
  bool plan_with_turns =
      true;  ///< Plans are told how the platform turns and speeds up.
  double plan_retry_s = 0.25;
  int plan_tries = 8;  ///< Then back to follow.

  double replan_every_s = 0.3;  ///< While landing, until its end is near; 0: never.
  int replan_sweep_every = 4;   ///< Of these one samples the durations again.
  bool way_back = true;         ///< Goes around on a certified way, where there is one,
                                ///< and commits where that ends.

  double commit_height_m = 0.08;  ///< Above gear height; below, landing is the safe
                                  ///< choice. A climb takes 6 cm to begin.
  double commit_error_m = 0;      ///< Expected miss at which commit is refused; 0: by
                                  ///< the room that the pad leaves (places_for).
  /// Miss from which the descent slows; at a third more it waits. A drone whose misses
  /// are usually small waits for less: such a share of them (rms of some seconds).
  double wait_error_m = 0.018;  ///< At most; 0: it never waits.
  double wait_least_m = 0.010;  ///< No smaller than that or wait_error_m.
  double wait_share = 0.35;
  double wait_more_s = 4;     ///< Or twice that after so long, and so on.
  double wait_room_m = 0.12;  ///< Above the commit height: there it may wait.
  double quiet_deg = 3;       ///< A deck that swings is touched when it leans no more
                              ///< than this against the drone. 0: whenever.
  double quiet_more_s = 8;    ///< Or twice that after so long, thrice after twice it.
  double go_around_error_m = 0.35;
  double sight_lost_s = 0.25;  ///< Without a tracked frame: lost target.
  // A lost target is searched for from above the follow point, and soon: blown off at
  // the take-off the drone is out of the picture by the lens. Then the drone stops
  // over the ground and the autopilot lands. Flown on the prediction in a wind of 2 m/s
  // it was up to 0.6 m away and 0.4 m low after 2 s, 1.4 m and 0.8 m after 3 s: the
  // floor is 0.8 m below.
  double search_speed_m_s = 1.8;        ///< To where a lost target is searched for.
  double search_climb_m = 0.4;          ///< That far above it at most, in view.
  double give_up_s = 2.0;               ///< The search ends after this,
  double give_up_dark_s = 1.1;          ///< or, while no new pictures come,
  double give_up_late_s = 6.0;          ///< or, of pictures that come late, after this.
  double stop_acceleration_m_s2 = 1.5;  ///< With which it stops over the ground.
  double leave_max_s = 4;         ///< To clear the platform before the autopilot lands.
  double unsettled_max_s = 20;    ///< At the follow or rendezvous point; then it holds.
  double sink_m = 0.08;           ///< How far below touch-down the reference goes.
  double touch_height_m = 0.03;   ///< Above gear height: may stand on the pad.
  double settle_share = 0.4;      ///< Then thrust falls to this share of the last,
  double settle_down_s = 0.25;    ///< and in this time to what keeps it upright.
  double flare_s = 0.8;           ///< The drone stands up last, in this time or, for a
                                  ///< wide swing, up to 1.3 times it. 0: never;
  double flare_share = 0.7;       ///< by this share of what it leans,
  double flare_max_m_s2 = 2.5;    ///< at most: swings as wide as a gust asks for end
                                  ///< harder than they began.
  double square_up_s = 0.3;       ///< So long before the touch it begins to go over to
                                  ///< the pad's attitude. 0: never.
  double upright_deg = 6;         ///< Tilted more, it does not stand yet.
  double touch_settled_s = 0.06;  ///< Neither sinking nor sliding so long: it stands.
  double blind_sink_s = 0.6;  ///< From the trajectory's end to when thrust goes, for a
                              ///< committed drone that is not seen, or that does not
                              ///< sink though its height says it should.
  double landing_overtime_s = 4;  ///< Past the trajectory's end: go around.
  double cut_height_m = 0;        ///< paper: motors are cut at the trajectory's end.

  double ready_timeout_s = 8;  ///< For sight, link and platform before arming.
  double arm_timeout_s = 4;
  int starts_max = 3;  ///< Take-offs begun, when sight is lost before the drone lifts.
  double ramp_from = 0.7;  ///< Thrust at take-off, share of the nominal hover,
  double ramp_rate = 1.4;  ///< its growth, 1/s,
  double ramp_to = 1.6;    ///< and its end.
  double ramp_timeout_s = 4;
  double lift_m = 0.012;     ///< Rise by which the drone has left the ground.
  double slip_m = 0.006;     ///< Or so far to the side,
  double slip_m_s = 0.015;   ///< so fast,
  double slip_tilt_deg = 3;  ///< or tilted: feedback can wait no longer.
  double failsafe_s = 1;     ///< The autopilot's failsafe is given this to end.
  double blind_max_s = 1.3;  ///< From the floor: sight must come by then, and by what a
                             ///< climb to the follow point's height takes.
  double blind_climb_m_s = 0.9;  ///< Unseen it climbs so fast, by what it tells.
  double blind_ramp_rate = 1.1;  ///< As ramp_rate, from the floor: unseen, and light on
                                 ///< its feet, it is blown away.
  double blind_ramp_to = 1.35;   ///< As ramp_to: heavier it cannot be.
  double battery_sure_s = 0.3;   ///< So long low in flight: no dip of the voltage.

  Result<void> validate() const;
};

/// `config` with its zero points placed for the rig: on the camera's optical axis,
/// where every LED has the widest room in the picture, or above that, where it leads
/// below where a landing begins; the take-off height below the upper edge of the
/// picture.
MissionConfig places_for(MissionConfig config, const Rig& rig);

/// Whether those of `places_for` are above the height that a landing begins at, with
/// every LED in the picture, leaning as far as planned; and, of `start_on_floor`,
/// whether the floor is near enough below the pad.
/// @returns invalid_config: that the camera sees no such place, and what to turn, or
///          how high the pad is.
Result<void> check_places(const MissionConfig& config, const Rig& rig);

/// Whether pictures are new enough to fly by when they can be used: older than
/// kFreshSight they are no sight, and a drone would never be let off the pad.
/// @returns invalid_config: how old they are.
Result<void> check_pictures(const CameraTiming& timing);

}  // namespace alight
