// A drone that is not seen, not heard or not to be landed: it is left to its autopilot.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "alight/mission/mission.h"
#include "alight/mission/mission_common.h"

namespace alight {
namespace {

// A second word about the same thing comes no sooner, s.
constexpr Seconds kNotesApart = 0.5;
// m/s over the ground: the autopilot's landing goes on from there without drifting far.
constexpr double kStopped = 0.15;
// How soon what is left of the speed is to be gone, s: longer than the drone's lag.
constexpr Seconds kStopIn = 0.4;
// The platform drives on for so long, s, away from a drone that lands by itself.
constexpr Seconds kOutOfTheWay = 3;
// So fast an autopilot that is left alone sinks, m/s: at its landing speed, and what
// its estimate is off.
constexpr double kSinks = 0.6;
// m/s; slower than this share of what it drove as the landing began, it has stopped.
constexpr double kDrives = 0.2, kStoppedShare = 0.3;
// One that is seen to come down beside the platform is left behind a little.
constexpr Seconds kBrakesBeside = 1;
constexpr double kUnsure = 0.05;  // m, of where it comes down
// m/s behind its reference along the platform's way, of a drone that is not heard: one
// that falls behind so fast may be braking by itself. A platform that brakes for
// nothing does less harm than one that drives on beneath it.
constexpr double kFallsBehind = 0.16;
constexpr Seconds kBeneathIn = 0.4;  // the pad is to be beneath it again, s
// So long after its autopilot has acted alone, s, a drone is lost because of that.
constexpr Seconds kAloneBefore = 1;
// m/s^2, by which a platform's turn moves a place at rest to it more than the follow
// point; a circle of 0.9 m/s, 1.5 m in radius, by 0.6 at 1.7 m from that.
constexpr double kSweptMost = 1;
// It is near enough to where it is to be left, m, level; and how often that is chosen
// anew, s: the wind and the platform change.
constexpr double kThere = 0.3;
constexpr Seconds kChoosesEvery = 0.3;
constexpr Seconds kStaysClear = 0.2;  // where it may be left, and then is
// Unseen for so long, s, the drone may be elsewhere than predicted.
constexpr Seconds kStillKnown = 1;
// What a tenth of thrust that is not known does to a prediction: 0.5 m in the second
// after the LEDs were lost. It is learnt in this time of flight in sight, s; a search
// is as short before that.
constexpr Seconds kLearntIn = 0.4;
constexpr Seconds kShortSearch = 0.9;
// The wind is known after so long a flight that is seen or told of, s. A blind
// autopilot keeps level and is blown off, 2 m and more until it is down: it is left
// moving against that, m/s at most, to come down about where it was left. How soon it
// sinks, s.
constexpr Seconds kWindLearntIn = 1.5;
constexpr double kAgainstWindMost = 0.8;
constexpr Seconds kBlindSinksAfter = 0.5;

// A drone that is not seen may be lower than predicted by a tenth of a m/s that its
// last pictures had not told yet and by thrust that is not known to 5 %: twice that,
// m/s and m/s^2, after a time, s, in which pictures may be late; m, at most, for higher
// up there is room. So far above its feet's height, m, it is to stay all the same.
constexpr Seconds kHeightKnown = 0.1;
constexpr double kSinksUnseen = 0.2, kFallsUnseen = 0.8, kSunkMost = 0.3;
constexpr double kOffGround = 0.15;
// A gust and its lift-off have it do something else for so long.
constexpr Seconds kStillAsTold = 0.5;

}  // namespace

double Mission::platform_wish(const MissionInput& in) {
  // A platform that can wait does so until it can be followed.
  const MissionState state = status_.state;
  // Motors of a start that has ended, until they are heard to have stopped.
  const bool may_turn =
      (state == MissionState::idle || state == MissionState::refused) && starts_ > 0 &&
      in.armed;
  const bool on_its_way = state == MissionState::idle || state == MissionState::armed ||
                          state == MissionState::taken_off;
  // Where others bring it down, the platform is first to get out of the way, then not
  // to come round again, nor to drive over it where it stands.
  const bool left_alone = state == MissionState::lost_link ||
                          state == MissionState::pilot ||
                          (state == MissionState::aborted && left_);
  if (flying() && !left_alone) waits_for_it_ = false;
  if (!left_alone) left_alone_since_ = in.now;
  if ((airborne_ && to_seconds(in.now - left_alone_since_) > kOutOfTheWay) ||
      (left_alone && in.stands_on_floor)) {
    waits_for_it_ = true;
  }
  // Where there is no way out any more, they had better meet gently.
  const bool up =
      may_turn || (state != MissionState::idle && state != MissionState::armed &&
                   state != MissionState::complete);
  // Unseen and light on its feet the wind brakes it, too.
  const bool light = state == MissionState::taken_off && !airborne_ && coming_down_;
  // Not heard but seen to do as it is told: only its words are lost.
  const bool unheard = !in.link->healthy(in.now) && (state == MissionState::lost_link ||
                                                     may_turn || falls_behind(in));
  const bool alone =
      light || (up && in.telemetry_heard && in.armed &&
                (unheard || in.mode == AutopilotMode::failsafe ||
                 in.mode == AutopilotMode::land || in.mode == AutopilotMode::hold));
  if (alone && !alone_) {
    alone_since_ = in.now;
    alone_v_IN_N_ = in.platform.v_IN_N.head<2>();
    brakes_in_ = light || would_meet(in) ? WayDown::kBrakes
                 : stays_beside(in)      ? kBrakesBeside
                                         : 0;
  } else if (alone && brakes_in_ == kBrakesBeside && seen_clear(in) && comes_near(in)) {
    brakes_in_ = 0;  // A gust blows it back towards the platform after all.
  }
  alone_ = alone;
  if ((config_.start_on_floor && on_its_way) || waits_for_it_) return 0;
  if (stopped_beneath(in)) return 0;
  if (!alone || brakes_in_ <= 0) return 1;
  const bool stands =
      in.platform_ready && in.platform.v_IN_N.head<2>().norm() < kDrives;
  if (brakes_in_ == kBrakesBeside && stands) return 0;
  const double since = to_seconds(in.now - alone_since_) / brakes_in_;
  // On its feet it is soon to stand: a landing mode that is carried along leans.
  const double as_it_brakes = airborne_ ? std::exp(-since) : std::max(0.0, 1 - since);
  return std::min(as_it_brakes, stays_beneath(in));
}

// A platform that brakes beneath it has it fall behind less fast: that is no sign that
// it obeys. And a gust from behind is none that it brakes.
bool Mission::falls_behind(const MissionInput& in) const {
  if (!in_sight(in)) return true;
  const Vector3 strays_N = in.x.v_NB - reference(in.now).v_NB;
  if (strays_N.z() < -kObeys) return true;
  const Vector2 v_IN_N = in.platform.v_IN_N.head<2>();
  if (v_IN_N.norm() < kDrives) return false;
  const double behind = -strays_N.head<2>().dot(v_IN_N.normalized());
  return behind > (alone_ ? 0 : kFallsBehind);
}

// The platform does what the drone cannot: it keeps the pad beneath it.
double Mission::stays_beneath(const MissionInput& in) const {
  const double speed = alone_v_IN_N_.norm();
  if (brakes_in_ != WayDown::kBrakes || !in_sight(in) || speed < kDrives) return 1;
  const Vector2 ahead_N = alone_v_IN_N_ / speed;
  const RelativeState& x = in.x;
  const Vector3 v_IB_N = inertial_velocity_N(in.platform, x.p_NB, x.v_NB);
  const double wish = ahead_N.dot(v_IB_N.head<2>() + x.p_NB.head<2>() / kBeneathIn);
  return std::clamp(wish / speed, 0.0, 1.0);
}

// What stopped a platform may let it go again just as the feet touch: 3 m/s^2 throw a
// drone over that has no weight on them yet. It is asked to stay until that is done.
// Odometry that drifts sideways does not hide that it no longer drives the way it did,
// and odometry that ends does not tell so.
bool Mission::stopped_beneath(const MissionInput& in) {
  const MissionState state = status_.state;
  const Vector2 v = in.platform.v_IN_N.head<2>();
  if (state != MissionState::land && state != MissionState::shut_down) {
    landing_v_IN_N_ = v;
    stays_for_touch_ = false;
  }
  const double speed = landing_v_IN_N_.norm();
  stays_for_touch_ =
      stays_for_touch_ || (in.platform_ready && speed > kDrives &&
                           v.dot(landing_v_IN_N_) < kStoppedShare * speed * speed);
  return stays_for_touch_;
}

// Until it is on the floor the autopilot knows its place and speed only while it is
// seen: blind it leans against a drift that it has made up, and tips over.
bool Mission::stays_beside(const MissionInput& in) const {
  return status_.state == MissionState::aborted && seen_clear(in) && !comes_near(in);
}

bool Mission::seen_clear(const MissionInput& in) const {
  return in_sight(in) && outline_.clear(in.x.p_NB);
}

bool Mission::comes_near(const MissionInput& in) const {
  return way_down_.comes_near(left_here(in), in.platform, kBrakesBeside);
}

LeftDrone Mission::left_here(const MissionInput& in) const {
  return {in.x.p_NB, inertial_velocity_N(in.platform, in.x.p_NB, in.x.v_NB), in.push_N};
}

// From where it would be blown against the platform, or met by it, it is not left: it
// goes to where it would not.
void Mission::choose_leave_place(const MissionInput& in) {
  if (!in_sight(in) || to_seconds(in.now - chose_place_) < kChoosesEvery) return;
  chose_place_ = in.now;
  const auto clear = [&](const Vector3& p_NB) {
    return way_down_.clear(
        {p_NB, inertial_velocity_N(in.platform, p_NB, Vector3::Zero()), in.push_N},
        in.platform);
  };
  if (clear(leave_place_)) return;
  const Vector3* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Vector3& place : leave_places_) {
    const double way = horizontal(place - in.x.p_NB);
    if (way >= least || !clear(place)) continue;
    least = way;
    best = &place;
  }
  if (best == nullptr) return;
  leave_place_ = *best;
  move_to(leave_place_, config_.move_speed_m_s, in);
}

bool Mission::would_meet(const MissionInput& in) const {
  if (!in.estimate_valid) return false;
  const RelativeState& x = in.x;
  const Seconds down =
      WayDown::kSinksAfter + std::max(0.0, x.p_NB.z() - gear_height_) / kSinks;
  const Vector3 v_IB_N = inertial_velocity_N(in.platform, x.p_NB, x.v_NB);
  const Vector3 where =
      x.p_NB + braking(WayDown::kBrakes, down) * v_IB_N - down * in.platform.v_IN_N;
  return horizontal(where) < way_down_.reach() + kUnsure;
}

Vector3 Mission::left_with_over_ground(const MissionInput& in) const {
  const bool wind_known = to_seconds(in.motion_known - lifted_at_) >= kWindLearntIn;
  if (!wind_known || !dark(in.blindness)) return Vector3::Zero();
  const double height = std::max(0.0, in.x.p_NB.z() + above_floor_ - gear_height_);
  const Seconds blown = kBlindSinksAfter + height / WayDown::kSinksLeast;
  Vector3 v_N = -0.5 * blown * in.push_N;
  v_N.z() = 0;
  return std::min(1.0, kAgainstWindMost / (v_N.norm() + 1e-6)) * v_N;
}

void Mission::stop_over_ground(const MissionInput& in) {
  FlatState ref = maneuver_.at(in.now);
  const Vector3 v_N = left_with_over_ground(in);
  const Vector3 left =
      v_N - inertial_velocity_N(in.platform, ref.p_NB, Vector3::Zero()) - ref.v_NB;
  const double gain =
      std::min(1 / kStopIn, config_.stop_acceleration_m_s2 / (left.norm() + 1e-6));
  ref.a_NB = gain * left;
  // Else this lags behind, outwards of a turning platform's way: stopped at once in a
  // wind that is not known it is blown into that, and where pictures come the LEDs have
  // longer to be seen again (docs/decisions.md).
  if (!v_N.isZero(0)) {
    ref.a_NB = relative_acceleration(in.platform, ref.p_NB, ref.v_NB, ref.a_NB);
  }
  ref.j_NB.setZero();
  ref.yaw_rate = ref.yaw_acceleration = 0;
  maneuver_ = Maneuver::coast(ref, in.now);
}

// Height helps to be seen. Where there are no pictures it only is the longer to fall.
Vector3 Mission::search_from(const MissionInput& in) const {
  return dark(in.blindness) ? config_.follow_point : into_view_.first_N(in.x.p_NB);
}

void Mission::lost_target(const MissionInput& in, Output& out) {
  if (overruled(in, out)) return;
  if (unseen(in) < kFreshSight) {
    go(MissionState::go_around, "the LEDs are in sight again", in, out);
    return;
  }
  // What the computer missed while it stood still stays its fault.
  const Blindness why =
      blindness_ == Blindness::computer && in.blindness == Blindness::leds
          ? blindness_
          : in.blindness;
  if (why != blindness_ && to_seconds(in.now - told_) > kNotesApart) {
    blindness_ = why;
    note(words_for(blindness_).lost, in, out);
  }
  if (maneuver_.done(in.now) && search_goal_ != config_.search_point && !dark(why)) {
    search_goal_ = config_.search_point;
    move_to(search_goal_, config_.search_speed_m_s, in);
  }
  // Pictures that come late still say where it was, if not whether it may land.
  const Seconds search = unseen(in) < kStillKnown ? config_.give_up_late_s
                         : !learnt(in)            ? kShortSearch
                         : dark(why)              ? config_.give_up_dark_s
                                                  : config_.give_up_s;
  if (in_state(in) > search || !in.estimate_valid) {
    // What its autopilot did alone has taken it out of the picture.
    const bool went_alone =
        why == Blindness::leds && alone_within(kAloneBefore, in.seen);
    go(MissionState::aborted,
       went_alone ? "set-points did not arrive, the LEDs are lost: the autopilot lands"
                  : words_for(why).given_up,
       in, out);
    for_want_of_sight_ = true;
  }
}

// Blown off at the take-off it would touch, out of sight, what it believes to be above.
void Mission::keep_off_ground(const MissionInput& in, Command& c) const {
  const bool lands = status_.state == MissionState::land;
  const Seconds u = unseen(in) - kHeightKnown;
  if (c.mode != Command::Mode::track || lands || !in.estimate_valid || u <= 0) return;
  const double sunk =
      std::min(kSinksUnseen * u + 0.5 * kFallsUnseen * u * u, kSunkMost);
  const double least = in.x.p_NB.z() - gear_height_ - sunk;
  c.raise_m = std::clamp(kOffGround - least, 0.0, sunk);
  if (c.raise_m > 0 && sunk < kSunkMost) c.raise_m_s = kSinksUnseen + kFallsUnseen * u;
}

bool Mission::learnt(const MissionInput& in) const {
  return to_seconds(in.seen - lifted_at_) > kLearntIn;
}

void Mission::lost_link(const MissionInput& in, Command& c, Output& out) {
  if (!in.link->healthy(in.now)) return;
  const bool stood_still = std::strcmp(status_.reason, kStoodStill) == 0;
  const bool failsafe = std::strcmp(status_.reason, kFailsafe) == 0;
  // Set-points that come again end its failsafe, but where they have not for long.
  const bool waits = in.mode == AutopilotMode::failsafe && !failsafe && in_sight(in) &&
                     in.x.p_NB.z() > gear_height_ + config_.commit_height_m;
  const bool autopilot_acts =
      in.mode == AutopilotMode::land || (in.mode == AutopilotMode::failsafe && !waits);
  if (in.telemetry_heard && !in.armed) {
    came_down(in);
    // Why it was alone stays told.
    go(MissionState::complete,
       stood_still ? "the computer stood still: the autopilot landed by itself"
       : failsafe  ? "set-points did not arrive: the autopilot landed by itself"
                   : "the link was lost: the autopilot landed by itself",
       in, out);
  } else if (pilot_flies(in)) {
    seen_by_pilot_ = in_sight(in);
    go(MissionState::pilot, "the pilot has taken over", in, out);
  } else if (abort_wanted_) {
    go(MissionState::aborted, "the operator aborted: the autopilot lands", in, out);
  } else if (!autopilot_acts) {
    const bool fresh = in_sight(in);
    go(fresh ? MissionState::go_around : MissionState::lost_target,
       fresh ? "the link is back" : "the link is back, the LEDs are out of sight", in,
       out);
    failsafe_ = false;  // It is given its time anew.
    c.mode = Command::Mode::track;
  } else if (!stop_on_floor(in, c, out) && touch_down_.was_set_down(in)) {
    keep_ordering(AutopilotOrder::disarm, in, c);
  }
}

// But for one that is seen on the pad the platform waits.
void Mission::came_down(const MissionInput& in) {
  const bool on_pad = in_sight(in) && !outline_.clear(in.x.p_NB);
  if (airborne_ && !on_pad) waits_for_it_ = true;
  airborne_ = false;
}

bool Mission::stop_on_floor(const MissionInput& in, Command& c, Output& out) {
  if (!in.stands_on_floor) return false;
  if (!keep_ordering(AutopilotOrder::disarm, in, c)) return true;
  // Why it came down there stays the reason.
  if (!floor_told_) mention("stands on the floor: its motors are stopped", in, out);
  floor_told_ = true;
  return true;
}

bool Mission::does_as_told(const MissionInput& in) const {
  return in_sight(in) && to_seconds(in.now - as_told_till_) <= kStillAsTold;
}

bool Mission::may_be_left(const MissionInput& in) {
  // Unheard but seen to do as it is told, an order to land would have it come down
  // where it is.
  const bool obeys = in.mode == AutopilotMode::offboard &&
                     (in.link->healthy(in.now) || does_as_told(in));
  if (!obeys || !in.estimate_valid || in.now > leave_by_) return true;
  if (in_sight(in)) {
    const bool there = !leaves_where_told_ || stops_here_ ||
                       horizontal(in.x.p_NB - leave_place_) < kThere;
    const LeftDrone here = left_here(in);
    // On its way there it may look as if it flew on.
    LeftDrone at_rest = here;
    at_rest.v_IB_N = inertial_velocity_N(in.platform, in.x.p_NB, Vector3::Zero());
    const bool beside = there && outline_.clear(in.x.p_NB) &&
                        way_down_.clear(here, in.platform) &&
                        way_down_.clear(at_rest, in.platform);
    // Else it would come down on a platform that is stopped meanwhile.
    const bool clear = beside && way_down_.clear_of_stop(here, in.platform);
    if (beside && !clear) {
      stops_here_ = true;
    } else if (!beside && stops_here_) {
      move_to(leave_place_, config_.move_speed_m_s, in);
    }
    if (stops_here_) stop_over_ground(in);
    // What begins to brake is slow before the drone is seen to come nearer.
    if (!clear) not_clear_ = in.now;
    return to_seconds(in.now - not_clear_) > kStaysClear;
  }
  not_clear_ = in.now;  // Seen again it is where it is then.
  // Better it drifts than that it sinks on a prediction that knows no thrust.
  if (!learnt(in)) return true;
  // The autopilot does not know its speed without us, and would drift with it.
  stop_over_ground(in);
  const FlatState ref = maneuver_.at(in.now);
  const Vector3 v_N = inertial_velocity_N(in.platform, ref.p_NB, ref.v_NB);
  return (v_N - left_with_over_ground(in)).norm() < kStopped;
}

void Mission::aborted(const MissionInput& in, Command& c, Output& out) {
  if (in.telemetry_heard && !in.armed) {
    came_down(in);
    return;
  }
  if (pilot_flies(in)) {
    seen_by_pilot_ = in_sight(in);
    go(MissionState::pilot, "the pilot has taken over", in, out);
    return;
  }
  // Lower it may have touched something, and what stands there had better stay.
  const bool flies = in.x.p_NB.z() > gear_height_ + config_.commit_height_m;
  if (!left_ && for_want_of_sight_ && !abort_wanted_ && flies &&
      unseen(in) < kFreshSight) {
    go(MissionState::go_around, "the LEDs are in sight again", in, out);
    c.mode = Command::Mode::track;
    return;
  }
  // Why it was aborted stays told.
  if (!left_ && strayed(in)) {
    move_to(leave_place_, config_.move_speed_m_s, in);
  } else if (!left_) {
    choose_leave_place(in);
  }
  left_ = left_ || may_be_left(in);
  if (!left_) {
    c.mode = Command::Mode::track;
  } else if (!stop_on_floor(in, c, out)) {
    keep_ordering(AutopilotOrder::land, in, c);
  }
}

// What a turn asks for far out is large, and its change known late: taken for a push,
// it has a drone that is given back there lean away, blind soon after.
bool Mission::swept(const MissionInput& in) const {
  const auto at_rest = [&](const Vector3& p_NB) {
    return inertial_acceleration_N(in.platform, p_NB, Vector3::Zero(), Vector3::Zero());
  };
  return horizontal(at_rest(in.x.p_NB) - at_rest(config_.follow_point)) > kSweptMost;
}

// Set-points go on, so that the autopilot may be switched back to them; they ask for
// nothing but to fly on as the drone does. Nothing is ordered.
void Mission::pilot(const MissionInput& in, Command& c, Output& out) {
  if (in.telemetry_heard && !in.armed) {
    came_down(in);
    go(MissionState::complete, "the pilot stopped the motors", in, out);
    return;
  }
  if (in.link->lost(in.now)) {
    go(MissionState::lost_link, kUnheard, in, out);
    return;
  }
  const bool fresh = in_sight(in);
  if (in.mode == AutopilotMode::offboard) {
    if (fresh && swept(in)) {
      go(MissionState::aborted,
         "the pilot has given it back far from a platform that turns: the autopilot "
         "lands",
         in, out);
    } else if (fresh) {
      go(MissionState::go_around, "the pilot has given it back", in, out);
    } else if (in.estimate_valid && unseen(in) < kStillKnown) {
      go(MissionState::lost_target, "the pilot has given it back out of sight", in,
         out);
    } else {
      go(MissionState::aborted,
         "the pilot has given it back out of sight: the autopilot lands", in, out);
    }
    c.mode = in.estimate_valid ? Command::Mode::track : Command::Mode::silent;
    return;
  }
  if (in.mode == AutopilotMode::failsafe) {
    go(MissionState::lost_link, kFailsafe, in, out);
    return;
  }
  if (fresh != seen_by_pilot_ && to_seconds(in.now - told_) > kNotesApart) {
    seen_by_pilot_ = fresh;
    note(fresh ? "the pilot flies, the LEDs are in sight"
               : "the pilot flies, the LEDs are out of sight",
         in, out);
  }
  if (!in.estimate_valid) {
    // The stream is to go on; where it flies is not known.
    c.mode = Command::Mode::ramp;
    c.ramp_share = 1;
    return;
  }
  FlatState on = as_it_flies(in.x);
  on.a_NB = relative_acceleration(in.platform, on.p_NB, on.v_NB, Vector3::Zero());
  maneuver_ = Maneuver::coast(on, in.now);
  c.mode = Command::Mode::track;
}

}  // namespace alight
