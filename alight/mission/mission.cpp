#include "alight/mission/mission.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>

#include "alight/mission/miss.h"
#include "alight/planning/replan.h"

namespace alight {
namespace {

constexpr Seconds kOrderEvery = 0.1;
// Around a block corners come more often than that: longer it does not ask for more
// rest than at first.
constexpr Seconds kPatientFor = 8;
// A second word about the same thing comes no sooner, s.
constexpr Seconds kNotesApart = 0.5;
// m/s over the ground: the autopilot's landing goes on from there without drifting far.
constexpr double kStopped = 0.15;
// How soon what is left of the speed is to be gone, s: longer than the drone's lag.
constexpr Seconds kStopIn = 0.4;
// Share of the nominal hover thrust with which a drone that is a tenth lighter than the
// rig says comes down before the wind has it off the pad, and one that is as much
// heavier not too hard; and how long it takes from 3 cm and 0.3 m/s upwards, s.
constexpr double kComingDown = 0.6;
constexpr Seconds kComingDownFor = 0.45;
// Likewise: with no more than this it has not left the ground yet.
constexpr double kStillStands = 0.85;
constexpr double kLeft = 0.02;      // m above where it stood: no foot touches,
constexpr Seconds kLeavesIn = 0.8;  // which is never far off.

// Of the nominal hover thrust: it moves even a drone that is a fifth heavier than the
// rig says, and pictures that show nothing of that show the past.
constexpr double kMovesIt = 1.25;
// The platform drives on for so long, s, away from a drone that lands by itself.
constexpr Seconds kOutOfTheWay = 3;
// How an autopilot that is left alone comes to rest over the ground (PX4:
// MPC_XY_VEL_P_ACC of 1.8/s), s, and how it comes down: after so long, s, at its
// landing speed, m/s.
constexpr Seconds kBrakes = 0.55;
constexpr Seconds kSinksAfter = 0.2;
// m/s against its reference: more than gusts do, less than an autopilot that brakes
// does within a tenth of a second or two.
constexpr double kObeys = 0.25;
constexpr double kSinks = 0.6;
// One that is seen to come down beside the platform is left behind a little.
constexpr Seconds kBrakesBeside = 1;
constexpr double kRoomBeside = 0.1;  // m, from the pad's corner to a rotor
constexpr double kUnsure = 0.05;     // m, of where it comes down
// Unseen for so long, s, the drone may be elsewhere than predicted.
constexpr Seconds kStillKnown = 1;
// What a tenth of thrust that is not known does to a prediction: 0.5 m in the second
// after the LEDs were lost. It is learnt in this time of flight in sight, s; a search
// is as short before that.
constexpr Seconds kLearntIn = 0.4;
constexpr Seconds kShortSearch = 0.9;
// How long a refused drone that is armed all the same is told to disarm, s.
constexpr Seconds kDisarmFor = 1;
// Without a word from the drone after touch-down its motors are its own, s.
constexpr Seconds kShutDownUnheard = 3;
constexpr double kStandNoise = 0.001;  // m; a rise that standing drones show
constexpr Seconds kRampActsIn = 0.1;  // Later, the take-off's thrust grows more slowly.
constexpr double kWaitsAt = 1.0 / 3;  // above the miss that slows it, as a share
// m above gear height: enough to stop sinking in.
constexpr double kRoomToLeave = 0.03;

// m from the reference: something has thrown it off its way, and what is asked for from
// there on must be flyable from where it is. It brakes within the other.
constexpr double kStrayed = 0.6;
constexpr double kBrakeWithin = 0.15;
constexpr double kHardestBrake = 4;  // m/s^2
// Of the drone's own speed limit: nearer to it, a platform leaves no room for a
// landing.
constexpr double kLeastRoom = 0.85;
// A platform that is faster than the limit for so long, s, stays so.
constexpr Seconds kTooFastFor = 0.5;
// So often nothing but failed plans at the rendezvous: more will not help.
constexpr int kPlanlessMax = 3;
// s; a landing that has waited is flown by another clock than it was planned for.
constexpr Seconds kNoLag = 1e-6;

// Above the commit height a descent still stops.
constexpr double kStopsWithin = 0.03;  // m

constexpr const char* kTooFast =
    "the platform is too fast for the drone's speed limit: no landing";
constexpr const char* kUnhealthy = "the radio link is not healthy";
constexpr const char* kNoOdometry = "no platform odometry comes";
// So many sd of an expected miss may come to the one at which commit is refused: what
// is known less well, and for longer, s, than it takes to be known again, is not landed
// by.
constexpr double kVagueSds = 2;
constexpr Seconds kVagueFor = 0.1;
constexpr const char* kOffItsWay = "far off its way: it goes on from where it is";

// Why only the autopilot acts.
constexpr const char* kUnheard =
    "nothing heard from the drone: its autopilot acts alone";
constexpr const char* kFailsafe = "the autopilot's failsafe has taken over";
constexpr const char* kStoodStill = "the computer stood still: the autopilot lands";

double angle_between(const Vector3& a, const Vector3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// Level direction from the lens to the pad.
Vector3 level_from_lens(const Rig& rig) {
  Vector3 v = -rig.camera.X_NC.translation();
  v.z() = 0;
  return v.norm() > 1e-3 ? Vector3(v.normalized()) : Vector3(Vector3::Zero());
}

double horizontal(const Vector3& v) { return v.head<2>().norm(); }

}  // namespace

Mission::Mission(const MissionConfig& config, const Rig& rig)
    : config_(places_for(config, rig)),
      outline_(rig),
      gear_height_(rig.drone.gear_height_m),
      arm_(rig.drone.arm_m),
      pad_half_(0.5 * rig.pad.size_m),
      reach_(std::sqrt(0.5) * rig.pad.size_m + rig.drone.arm_m +
             rig.drone.propeller_radius_m),
      from_lens_(level_from_lens(rig)),
      speed_max_(rig.limits.speed_m_s),
      unseen_lifting_(1e-3 * rig.timing.frame_to_use_ms + 2.5 / rig.timing.rate_hz),
      tilt_max_(rig.drone.tilt_max_deg * kDegree),
      into_view_(rig, config_.search_point),
      quiet_deck_(config, rig),
      touch_down_(config, rig) {}

bool Mission::flying() const {
  switch (status_.state) {
    case MissionState::taken_off:
      return airborne_;
    case MissionState::follow:
    case MissionState::rendezvous:
    case MissionState::land:
    case MissionState::hold:
    case MissionState::go_around:
    case MissionState::lost_target:
    case MissionState::lost_link:
    case MissionState::aborted:
    case MissionState::pilot:
      return airborne_;
    default:
      return false;
  }
}

Seconds Mission::in_state(const MissionInput& in) const {
  return to_seconds(in.now - status_.since);
}

void Mission::go(MissionState to, const char* reason, const MissionInput& in,
                 Output& out) {
  const MissionState from = status_.state;
  out.transitions.push_back({in.now, from, to, reason});
  status_.state = to;
  status_.reason = reason;
  status_.since = in.now;
  settling_ = false;
  plan_pending_ = false;
  plan_tries_ = 0;
  committed_ = committed_ && to == MissionState::land;
  left_ = false;
  for_want_of_sight_ = false;
  awaits_odometry_ = false;
  told_ = in.now;
  has_next_ = false;
  switch (to) {
    case MissionState::follow:
    case MissionState::go_around:
    case MissionState::hold:
      move_to(config_.follow_point, config_.move_speed_m_s, in);
      if (config_.way_back && from == MissionState::land &&
          to == MissionState::go_around && in.platform_ready) {
        // Begun at once; better is a way that is certified not to leave the picture.
        PlanRequest back = request_from_reference(in);
        back.way_back = true;
        back.has_return = true;
        back.return_to = config_.follow_point;
        ask(back, in, out);
      }
      break;
    case MissionState::lost_target:
      blindness_ = in.blindness;
      search_goal_ = into_view_.first_N(in.x.p_NB);
      move_to(search_goal_, config_.search_speed_m_s, in);
      break;
    case MissionState::aborted:
      move_to(config_.safety.leave_at_m, config_.move_speed_m_s, in);
      break;
    case MissionState::rendezvous:
      move_to(config_.rendezvous_point, config_.move_speed_m_s, in);
      break;
    default:
      break;
  }
}

void Mission::note(const char* reason, const MissionInput& in, Output& out) {
  out.transitions.push_back({in.now, status_.state, status_.state, reason});
  status_.reason = reason;
  told_ = in.now;
}

void Mission::move_to(const Vector3& p_NB, double speed, const MissionInput& in) {
  // From the reference where it is being followed, so that nothing jumps; from the
  // drone itself where it is not.
  MoveLimits limits;
  limits.speed_m_s = speed;
  limits.acceleration_m_s2 =
      config_.move_acceleration_m_s2 * speed / config_.move_speed_m_s;
  FlatState from = maneuver_.at(in.now);
  if ((from.p_NB - in.x.p_NB).norm() > config_.go_around_error_m) {
    from = FlatState{};
    from.p_NB = in.x.p_NB;
    from.v_NB = in.x.v_NB;
    from.yaw = yaw_of(in.x.R_NB);
    const double room = std::clamp(from.p_NB.z() - gear_height_, 0.03, kBrakeWithin);
    const double within = from.v_NB.z() < 0 ? room : kBrakeWithin;
    const double brake =
        std::min(in.x.v_NB.squaredNorm() / (2 * within), kHardestBrake);
    limits.acceleration_m_s2 = std::max(limits.acceleration_m_s2, brake);
  }
  maneuver_ = Maneuver::move(PointToPoint(in.now, from, p_NB, 0, limits));
  has_next_ = false;
}

bool Mission::settled(const MissionInput& in) {
  const FlatState ref = maneuver_.at(in.now);
  const bool near = maneuver_.done(in.now) && in_sight(in) &&
                    (in.x.p_NB - ref.p_NB).norm() < config_.settle_error_m &&
                    (in.x.v_NB - ref.v_NB).norm() < config_.settle_speed_m_s;
  if (!near) {
    settling_ = false;
    return false;
  }
  if (!settling_) {
    settling_ = true;
    settled_since_ = in.now;
  }
  const bool asks_less = battery_low_ || in_state(in) > kPatientFor;
  const Seconds more = asks_less ? 0 : config_.settle_more_s * status_.attempts;
  return to_seconds(in.now - settled_since_) >= config_.settle_s + more;
}

bool Mission::strayed(const MissionInput& in) const {
  return in_sight(in) && (in.x.p_NB - maneuver_.at(in.now).p_NB).norm() > kStrayed;
}

bool Mission::too_fast(const MissionInput& in) {
  if (!(in.platform_ready && horizontal(in.platform.v_IN_N) > speed_max_)) {
    fast_ = false;
  } else if (!fast_) {
    fast_ = true;
    fast_since_ = in.now;
  }
  return fast_ && to_seconds(in.now - fast_since_) > kTooFastFor;
}

bool Mission::too_vague(const MissionInput& in) {
  if (kVagueSds * in.miss_sd_m <= config_.commit_error_m) {
    vague_ = false;
  } else if (!vague_) {
    vague_ = true;
    vague_since_ = in.now;
  }
  return vague_ && to_seconds(in.now - vague_since_) > kVagueFor;
}

void Mission::give_up(const char* reason, const MissionInput& in, Output& out) {
  const bool leaves = config_.safety.when_failed == WhenFailed::leave || battery_low_;
  go(leaves ? MissionState::aborted : MissionState::hold, reason, in, out);
}

bool Mission::pilot_flies(const MissionInput& in) const {
  if (!in.telemetry_heard || !in.armed) return false;
  return in.mode == AutopilotMode::hold ||
         (in.mode == AutopilotMode::manual && obeyed_);
}

bool Mission::overruled(const MissionInput& in, Output& out) {
  const MissionState state = status_.state;
  if (pilot_flies(in)) {
    seen_by_pilot_ = in_sight(in);
    go(MissionState::pilot, "the pilot has taken over", in, out);
    return true;
  }
  // Past the commit height landing is the safe choice, whatever is wished or fails: the
  // autopilot would brake over the ground, and the pad drive on beneath it.
  if (committed_) return false;
  if (abort_wanted_) {
    go(MissionState::aborted, "the operator aborted: the autopilot lands", in, out);
    return true;
  }
  if (in.link->lost(in.now)) {
    // A landing that is seen to go on as told is safer than an autopilot left alone
    // over a platform that drives.
    if (state != MissionState::land || !obeys(in)) {
      go(MissionState::lost_link, kUnheard, in, out);
      return true;
    }
  }
  // A burst of losses puts the autopilot into its failsafe until set-points come again.
  if (in.mode != AutopilotMode::failsafe) {
    failsafe_ = false;
  } else if (!failsafe_) {
    failsafe_ = true;
    failsafe_since_ = in.now;
  }
  if (in.mode == AutopilotMode::land ||
      (failsafe_ && to_seconds(in.now - failsafe_since_) > config_.failsafe_s)) {
    go(MissionState::lost_link, in.computer_was_late ? kStoodStill : kFailsafe, in,
       out);
    return true;
  }
  if (in.telemetry_heard && !in.armed && state != MissionState::land) {
    go(MissionState::aborted, "the autopilot stopped its motors", in, out);
    return true;
  }
  if (in.computer_was_late && !lateness_told_) {
    lateness_told_ = true;
    const double off = (in.x.p_NB - maneuver_.at(in.now).p_NB).norm();
    if (in_sight(in) && off > config_.go_around_error_m) {
      go(MissionState::go_around, words_for(Blindness::computer).lost, in, out);
      return true;
    }
    note(words_for(Blindness::computer).lost, in, out);
  }
  lateness_told_ = in.computer_was_late;
  if (watch_battery(in, out)) return true;
  if (hold_wanted_ && !battery_low_ && state != MissionState::hold &&
      state != MissionState::land && state != MissionState::lost_target) {
    go(MissionState::hold, "the operator holds", in, out);
    return true;
  }
  return false;
}

bool Mission::watch_battery(const MissionInput& in, Output& out) {
  const Safety& safety = config_.safety;
  if (!in.telemetry_heard || in.battery >= safety.battery_low) {
    battery_falling_ = false;
    return false;
  }
  if (!battery_falling_) {
    battery_falling_ = true;
    battery_falling_since_ = in.now;
  }
  if (to_seconds(in.now - battery_falling_since_) < config_.battery_sure_s) {
    return false;
  }
  const bool landing = status_.state == MissionState::land;
  if (in.battery < safety.battery_empty && !landing) {
    go(MissionState::aborted, "the battery is empty: the autopilot lands", in, out);
    return true;
  }
  if (!battery_low_) {
    battery_low_ = true;
    landings_before_low_ = status_.attempts;
    if (landing) {
      note("the battery is low: the landing goes on", in, out);
    } else if (safety.when_battery_low == WhenBatteryLow::finish) {
      note("the battery is low: it lands without waiting", in, out);
    }
  }
  if (landing) return false;
  if (safety.when_battery_low == WhenBatteryLow::leave) {
    go(MissionState::aborted, "the battery is low: the autopilot lands", in, out);
    return true;
  }
  if (status_.attempts > landings_before_low_) {
    go(MissionState::aborted,
       "the battery is low and the landing failed: the autopilot lands", in, out);
    return true;
  }
  if (status_.state == MissionState::hold) {
    go(MissionState::follow, "the battery is low: it lands without waiting", in, out);
    return true;
  }
  return false;
}

MissionCommand Mission::step(const MissionInput& in, Output& out) {
  assert(in.link != nullptr);
  MissionCommand c;
  c.tilt_limit = status_.state == MissionState::land && obeys(in)
                     ? tilt_max_
                     : in.link->tilt_limit(in.now, tilt_max_);
  // What the operator said stands until he says otherwise, whatever comes between.
  if (in.wish == OperatorWish::go) {
    wanted_ = true;
    hold_wanted_ = false;
  }
  hold_wanted_ = hold_wanted_ || in.wish == OperatorWish::hold;
  abort_wanted_ = abort_wanted_ || in.wish == OperatorWish::abort;
  if (has_next_ && in.now >= next_from_) {
    maneuver_ = next_;
    has_next_ = false;
  }
  obeyed_ = in.armed && (obeyed_ || in.mode == AutopilotMode::offboard);
  switch (status_.state) {
    case MissionState::idle:
      idle(in, c, out);
      break;
    case MissionState::armed:
      armed(in, c, out);
      break;
    case MissionState::taken_off:
      taken_off(in, c, out);
      break;
    case MissionState::follow:
    case MissionState::go_around:
    case MissionState::hold:
      follow(in, out);
      break;
    case MissionState::rendezvous:
      rendezvous(in, out);
      break;
    case MissionState::land:
      land(in, c, out);
      break;
    case MissionState::shut_down:
      shut_down(in, c, out);
      break;
    case MissionState::lost_target:
      lost_target(in, out);
      break;
    case MissionState::lost_link:
      lost_link(in, c, out);
      break;
    case MissionState::aborted:
      aborted(in, c, out);
      break;
    case MissionState::pilot:
      pilot(in, c, out);
      break;
    case MissionState::refused:
      disarm(in, c);
      break;
    case MissionState::complete:
      break;
  }
  switch (status_.state) {
    case MissionState::follow:
    case MissionState::go_around:
    case MissionState::hold:
    case MissionState::rendezvous:
    case MissionState::land:
    case MissionState::lost_target:
      if (c.mode == Command::Mode::silent) c.mode = Command::Mode::track;
      break;
    default:
      break;
  }
  c.platform_speed_wish = platform_wish(in);
  c.on_ground = !airborne_;
  out.mission = status_;
  return c;
}

bool Mission::obeys(const MissionInput& in) const {
  return in_sight(in) && (in.x.v_NB - reference(in.now).v_NB).norm() < kObeys;
}

double Mission::platform_wish(const MissionInput& in) {
  // A platform that can wait does so until it can be followed.
  const MissionState state = status_.state;
  const bool on_its_way = state == MissionState::idle || state == MissionState::armed ||
                          state == MissionState::taken_off;
  // Where others bring it down, the platform is first to get out of the way, then not
  // to come round again.
  const bool left_alone = state == MissionState::lost_link ||
                          state == MissionState::pilot ||
                          (state == MissionState::aborted && left_);
  if (flying() && !left_alone) waits_for_it_ = false;
  if (!left_alone) left_alone_since_ = in.now;
  if (airborne_ && to_seconds(in.now - left_alone_since_) > kOutOfTheWay) {
    waits_for_it_ = true;
  }
  // Where there is no way out any more, they had better meet gently.
  const bool up = state != MissionState::idle && state != MissionState::armed &&
                  state != MissionState::complete;
  // Unseen and light on its feet the wind brakes it, too.
  const bool light = state == MissionState::taken_off && !airborne_ && coming_down_;
  // Not heard but seen to do as it is told: only its words are lost.
  const bool unheard =
      !in.link->healthy(in.now) && (state == MissionState::lost_link || !obeys(in));
  const bool alone =
      light || (up && in.telemetry_heard && in.armed &&
                (unheard || in.mode == AutopilotMode::failsafe ||
                 in.mode == AutopilotMode::land || in.mode == AutopilotMode::hold));
  if (alone && !alone_) {
    alone_since_ = in.now;
    brakes_in_ = light || would_meet(in) ? kBrakes
                 : stays_beside(in)      ? kBrakesBeside
                                         : 0;
  }
  alone_ = alone;
  if ((config_.start_on_floor && on_its_way) || waits_for_it_) return 0;
  if (!alone || brakes_in_ <= 0) return 1;
  return std::exp(-to_seconds(in.now - alone_since_) / brakes_in_);
}

// Until it is on the floor the autopilot knows its place and speed only while it is
// seen: blind it leans against a drift that it has made up, and tips over.
bool Mission::stays_beside(const MissionInput& in) const {
  const Vector3& p = in.x.p_NB;
  return status_.state == MissionState::aborted && in_sight(in) && outline_.clear(p) &&
         horizontal(p) > reach_ + kRoomBeside;
}

bool Mission::would_meet(const MissionInput& in) const {
  if (!in.estimate_valid) return false;
  const RelativeState& x = in.x;
  const Seconds down = kSinksAfter + std::max(0.0, x.p_NB.z() - gear_height_) / kSinks;
  const Vector3 v_IB_N = inertial_velocity_N(in.platform, x.p_NB, x.v_NB);
  const Vector3 where = x.p_NB + kBrakes * (1 - std::exp(-down / kBrakes)) * v_IB_N -
                        down * in.platform.v_IN_N;
  return horizontal(where) < reach_ + kUnsure;
}

// An order may be lost on its way. Later whoever arms has a reason for it.
void Mission::disarm(const MissionInput& in, Command& c) {
  disarms_ = disarms_ && in.telemetry_heard && in.armed && !pilot_flies(in) &&
             in_state(in) < kDisarmFor;
  if (disarms_ && to_seconds(in.now - last_order_) >= kOrderEvery) {
    c.order = AutopilotOrder::disarm;
    last_order_ = in.now;
  }
}

void Mission::idle(const MissionInput& in, Command& c, Output& out) {
  disarm(in, c);
  if (in.estimate_valid) {
    p_rest_ = in.x_seen.p_NB;
    R_rest_ = in.x_seen.R_NB;
  }
  if (abort_wanted_) {
    go(MissionState::refused, "the operator aborted before the start", in, out);
    return;
  }
  if (!wanted_ || hold_wanted_) {
    if (!disarms_) status_.since = in.now;
    return;
  }
  if (disarms_) return;
  const char* missing = nullptr;
  if (!in.link->ever_heard() || !in.link->healthy(in.now)) {
    missing = kUnhealthy;
  } else if (!in.telemetry_heard) {
    missing = "the autopilot sends no telemetry";
  } else if (!in.platform_ready) {
    missing = "there is no platform odometry";
  } else if (!config_.start_on_floor &&
             (!in.estimate_valid || unseen(in) > kFreshSight)) {
    missing = in.blindness == Blindness::leds ? "the LEDs are not seen on the pad"
                                              : words_for(in.blindness).lost;
  }
  if (missing == nullptr && in.battery < config_.safety.battery_low) {
    go(MissionState::refused, "the battery is too low to start", in, out);
  } else if (missing == nullptr && horizontal(in.platform.v_IN_N) > speed_max_) {
    go(MissionState::refused, kTooFast, in, out);
  } else if (missing == nullptr) {
    go(MissionState::armed, "all is ready: arming", in, out);
  } else if (in_state(in) > config_.ready_timeout_s) {
    go(MissionState::refused, missing, in, out);
  }
}

void Mission::armed(const MissionInput& in, Command& c, Output& out) {
  if (in.estimate_valid) {
    p_rest_ = in.x_seen.p_NB;
    R_rest_ = in.x_seen.R_NB;
  }
  c.mode = Command::Mode::idle;
  if (abort_wanted_) {
    c.order = AutopilotOrder::disarm;
    disarms_ = true;
    go(MissionState::refused, "the operator aborted before the start", in, out);
  } else if (hold_wanted_) {
    c.order = AutopilotOrder::disarm;
    c.mode = Command::Mode::silent;
    disarms_ = true;
    go(MissionState::idle, "the operator holds", in, out);
  } else if (in.armed && in.link->healthy(in.now)) {
    ++starts_;
    coming_down_ = false;
    go(MissionState::taken_off, "armed: taking off", in, out);
  } else if (in_state(in) > config_.arm_timeout_s) {
    c.order = AutopilotOrder::disarm;
    c.mode = Command::Mode::silent;
    disarms_ = true;
    go(MissionState::refused,
       in.link->healthy(in.now) ? "the autopilot does not arm" : kUnhealthy, in, out);
  } else if (to_seconds(in.now - last_order_) >= kOrderEvery) {
    c.order = AutopilotOrder::arm;
    last_order_ = in.now;
  }
}

void Mission::taken_off(const MissionInput& in, Command& c, Output& out) {
  const bool fresh = in_sight(in);
  if (airborne_) {
    if (overruled(in, out)) return;
    c.mode = Command::Mode::track;
    leave_ground(in, c);
    if (!fresh && unseen(in) > config_.sight_lost_s) {
      go(MissionState::lost_target, words_for(in.blindness).lost, in, out);
      return;
    }
    if (strayed(in)) {
      go(MissionState::follow, kOffItsWay, in, out);
      return;
    }
    const bool there = (in.x.p_NB - maneuver_.at(in.now).p_NB).norm() < 0.12;
    if (maneuver_.done(in.now) && (there || maneuver_.past_end(in.now) > 1.5)) {
      go(MissionState::follow, "clear of the pad: to the follow point", in, out);
    }
    return;
  }

  if (pilot_flies(in)) {
    go(MissionState::refused, "the pilot took over before the take-off", in, out);
    return;
  }
  const double rate = ramp_rate(in);
  const double share = config_.ramp_from + rate * in_state(in);
  if (obeyed_ &&
      (in.mode == AutopilotMode::failsafe || in.mode == AutopilotMode::land)) {
    const char* reason = in.computer_was_late ? kStoodStill : kFailsafe;
    if (share < kStillStands && starts_ < config_.starts_max) {
      c.order = AutopilotOrder::disarm;
      disarms_ = true;
      last_order_ = in.now;
      go(MissionState::idle, reason, in, out);
      return;
    }
    airborne_ = true;  // for all that is known
    go(MissionState::lost_link, reason, in, out);
    return;
  }
  c.mode = Command::Mode::ramp;
  const double most = config_.start_on_floor ? config_.blind_ramp_to : config_.ramp_to;
  c.ramp_share = std::min(share, most);
  const Seconds limit =
      config_.start_on_floor ? config_.blind_max_s : config_.ramp_timeout_s;
  // Unseen, it would climb and climb. It may be off the ground by a few centimetres:
  // with less thrust than carries it, it comes down softly.
  const bool stale =
      unseen(in) > unseen_lifting_ || (in.picture_repeats && c.ramp_share > kMovesIt);
  if (!config_.start_on_floor && !coming_down_ && stale) {
    coming_down_ = true;
    coming_down_since_ = in.now;
  }
  if (coming_down_) c.ramp_share = std::min(c.ramp_share, kComingDown);
  const bool blind =
      coming_down_ && to_seconds(in.now - coming_down_since_) > kComingDownFor;
  if (abort_wanted_ || blind || in.link->lost(in.now) || !in.armed ||
      in_state(in) > limit) {
    // From the floor it may fly unseen: only the autopilot can bring it down.
    c.order = config_.start_on_floor ? AutopilotOrder::land : AutopilotOrder::disarm;
    c.mode = Command::Mode::silent;
    airborne_ = config_.start_on_floor;
    disarms_ = !config_.start_on_floor;
    last_order_ = in.now;
    const char* reason = config_.start_on_floor
                             ? "never came into sight: the autopilot lands"
                             : "did not leave the ground";
    if (blind) reason = words_for(in.blindness).lost;
    if (blind && !abort_wanted_ && starts_ < config_.starts_max) {
      go(MissionState::idle, reason, in, out);
      return;
    }
    if (abort_wanted_) reason = "the operator aborted during take-off";
    go(config_.start_on_floor ? MissionState::aborted : MissionState::refused, reason,
       in, out);
    left_ = true;
    return;
  }
  const Vector3 way = in.x_seen.p_NB - p_rest_;
  const double tipped =
      angle_between(Vector3(in.x_seen.R_NB.col(2)), Vector3(R_rest_.col(2)));
  // Tipping over a foot lifts the middle, too.
  const double rise = way.z() - arm_ * std::sin(tipped);
  const bool rose = rise > config_.lift_m;
  // Light on its feet it slides and tips before it flies; thrust must go on growing, or
  // it stays there.
  const bool slipped =
      horizontal(way) > config_.slip_m || tipped > config_.slip_tilt_deg * kDegree;
  const bool lifted =
      fresh && !coming_down_ && (config_.start_on_floor || rose || slipped);
  if (!lifted) return;
  airborne_ = true;
  lifted_at_ = in.now;
  share_lifted_ = c.ramp_share;
  c.lifted = true;
  // Thrust grows evenly, so the rise goes with the third power of time.
  const double flown = std::max(rise - kStandNoise, 0.0);
  c.lifted_since =
      config_.start_on_floor ? 0 : std::cbrt(6 * flown / (ramp_rate(in) * kGravity));
  c.mode = Command::Mode::track;
  FlatState from;
  from.p_NB = in.x.p_NB;
  from.v_NB = in.x.v_NB;
  from.yaw = yaw_of(in.x.R_NB);
  maneuver_ = Maneuver::stay(from.p_NB, from.yaw);
  if (config_.start_on_floor) {
    go(MissionState::follow, "in sight: to the follow point", in, out);
    return;
  }
  MoveLimits limits;
  limits.speed_m_s = config_.climb_speed_m_s;
  limits.acceleration_m_s2 = config_.move_acceleration_m_s2;
  Vector3 up = p_rest_ + config_.take_off_back_m * from_lens_;
  up.z() = config_.take_off_height_m;
  maneuver_ = Maneuver::move(PointToPoint(in.now, from, up, 0, limits));
}

// Until lift-off is known and answered thrust goes on growing: over a late link it
// would throw the drone up, off to where the wind drives it, faster than it is seen.
double Mission::ramp_rate(const MissionInput& in) const {
  if (config_.start_on_floor) return config_.blind_ramp_rate;
  return config_.ramp_rate * std::min(1.0, kRampActsIn / std::max(in.acts_in, 1e-3));
}

// Light on its feet it may still stand when it is seen to slide: what the ground
// carries is no wind from below. (To limit its tilt has it slide off in a wind.) What
// is on its way to it counts: waiting to see it rise throws it up.
void Mission::leave_ground(const MissionInput& in, Command& c) const {
  const Seconds since = to_seconds(in.now - lifted_at_);
  if (config_.start_on_floor || since > kLeavesIn) return;
  if (in.z_acted - p_rest_.z() > kLeft) return;
  c.thrust_least = std::min(share_lifted_ + ramp_rate(in) * since, config_.ramp_to);
}

void Mission::follow(const MissionInput& in, Output& out) {
  if (overruled(in, out)) return;
  if (unseen(in) > config_.sight_lost_s) {
    go(MissionState::lost_target, words_for(in.blindness).lost, in, out);
    return;
  }
  if (strayed(in)) {
    move_to(config_.follow_point, config_.move_speed_m_s, in);
    note(kOffItsWay, in, out);
  }
  if (status_.state == MissionState::go_around) take_way_back(in);
  const bool there = settled(in);
  if (status_.state == MissionState::hold && !battery_low_) {
    if (awaits_odometry_ && in.platform_ready && !hold_wanted_) {
      go(MissionState::follow, "the platform odometry is back", in, out);
    } else if (in.wish == OperatorWish::go) {
      status_.attempts = 0;
      go(MissionState::follow, "the operator goes on", in, out);
    }
    return;
  }
  if (too_fast(in)) {
    give_up(kTooFast, in, out);
    return;
  }
  const bool unsettled = !there && in_state(in) > config_.unsettled_max_s;
  if ((there || unsettled) && !in.platform_ready && !battery_low_) {
    go(MissionState::hold, kNoOdometry, in, out);
    awaits_odometry_ = true;
    return;
  }
  if (!there) {
    if (unsettled) {
      go(MissionState::hold, "it does not come to rest at the follow point", in, out);
    }
    return;
  }
  if (status_.attempts < config_.safety.landings_max || battery_low_) {
    go(MissionState::rendezvous, "following well: to the rendezvous", in, out);
  } else if (config_.safety.when_failed == WhenFailed::leave) {
    go(MissionState::aborted, "too many landings have failed: the autopilot lands", in,
       out);
  } else {
    go(MissionState::hold, "too many landings have failed", in, out);
  }
}

PlatformState Mission::platform_at(Time t, const MissionInput& in) const {
  if (config_.plan_with_turns) return predict(in.platform, to_seconds(t - in.now));
  PlatformState straight_on;
  straight_on.X_IN = in.platform.X_IN;
  straight_on.v_IN_N = in.platform.v_IN_N;
  return straight_on;
}

PlanRequest Mission::request_from_reference(const MissionInput& in) const {
  PlanRequest request;
  request.start = in.now + from_seconds(config_.plan_ahead_s);
  request.from = maneuver_.at(request.start);
  request.platform = platform_at(request.start, in);
  return request;
}

void Mission::request_plan(const MissionInput& in, Output& out) {
  ask(request_from_reference(in), in, out);
  ++plan_tries_;
}

void Mission::ask(PlanRequest request, const MissionInput& in, Output& out) {
  out.plan_request = request;
  out.plan_request.id = ++plan_id_;
  out.plan_request.platform.t = request.start;
  out.has_plan_request = true;
  plan_pending_ = true;
  plan_asked_ = in.now;
}

const PlanResult* Mission::plan_arrived(const MissionInput& in) {
  if (in.plan == nullptr || !plan_pending_ || in.plan->result.id != plan_id_) {
    return nullptr;
  }
  plan_pending_ = false;
  return &in.plan->result;
}

void Mission::replan(const MissionInput& in, Output& out) {
  const PlanResult* fresh = plan_arrived(in);
  if (config_.replan_every_s <= 0 || maneuver_.lag(in.now) > kNoLag) return;
  if (fresh != nullptr && takes_over(plan_, *fresh, in.now)) {
    plan_ = *fresh;
    next_ = Maneuver::landing(plan_.trajectory, plan_.start, config_.sink_m);
    next_from_ = plan_.start;
    has_next_ = true;
  }
  const bool waited = to_seconds(in.now - plan_asked_) >= config_.replan_every_s;
  if (has_next_ || !waited || !in.platform_ready) return;
  const Time in_force = in.now + from_seconds(config_.plan_ahead_s);
  if (maneuver_.past_end(in_force) > -touch_down_.begins_before_end()) return;
  Replan anew;
  anew.in_force = in_force;
  anew.platform = platform_at(in_force, in);
  ++replans_;
  anew.sweep =
      config_.replan_sweep_every > 0 && replans_ % config_.replan_sweep_every == 0;
  if (const auto request = replan_request(plan_, anew)) ask(*request, in, out);
}

void Mission::take_way_back(const MissionInput& in) {
  const PlanResult* back = plan_arrived(in);
  if (back == nullptr || !back->ok() || in.now > back->start) return;
  next_ = Maneuver::landing(back->trajectory, back->start, 0);
  next_from_ = back->start;
  has_next_ = true;
}

void Mission::rendezvous(const MissionInput& in, Output& out) {
  if (overruled(in, out)) return;
  if (unseen(in) > config_.sight_lost_s) {
    go(MissionState::lost_target, words_for(in.blindness).lost, in, out);
    return;
  }
  if (const PlanResult* plan = plan_arrived(in)) {
    if (!plan->ok()) {
      plan_trouble_ = plan->reason;
    } else if (in.now > plan->start) {
      plan_trouble_ = "the plan came too late";
    } else {
      ++status_.attempts;
      planless_ = 0;
      replans_ = 0;
      plan_ = *plan;
      go(MissionState::land, "the landing is planned", in, out);
      maneuver_ = Maneuver::landing(plan_.trajectory, plan_.start, config_.sink_m);
      committed_ = false;
      quiet_deck_.begin();
      touch_down_.begin();
      return;
    }
  }
  if (too_fast(in)) {
    give_up(kTooFast, in, out);
    return;
  }
  if (strayed(in)) {
    go(MissionState::follow, kOffItsWay, in, out);
    return;
  }
  if (!in.platform_ready && !battery_low_ && !plan_pending_) {
    go(MissionState::follow, kNoOdometry, in, out);
    return;
  }
  if (!settled(in)) {
    if (in_state(in) > config_.unsettled_max_s) {
      go(MissionState::hold, "it does not come to rest at the rendezvous", in, out);
    }
    return;
  }
  const bool waited = to_seconds(in.now - plan_asked_) > config_.plan_retry_s;
  if (plan_tries_ > 0 && !waited) return;
  if (plan_tries_ >= config_.plan_tries) {
    ++status_.attempts;
    const bool fast = horizontal(in.platform.v_IN_N) > kLeastRoom * speed_max_;
    const char* trouble = plan_pending_ ? "the planner does not answer"
                          : fast        ? kTooFast
                                        : plan_trouble_;
    if (++planless_ >= kPlanlessMax || (fast && !plan_pending_)) {
      planless_ = 0;
      give_up(trouble, in, out);
    } else {
      go(MissionState::follow, trouble, in, out);
    }
    return;
  }
  request_plan(in, out);
}

Seconds Mission::touches_in(const MissionInput& in) const {
  return status_.state == MissionState::land ? quiet_deck_.touches_in(in, maneuver_)
                                             : kTouchAhead;
}

void Mission::land(const MissionInput& in, Command& c, Output& out) {
  if (overruled(in, out)) return;
  const FlatState ref = maneuver_.at(in.now);
  const Vector3 error = in.x.p_NB - ref.p_NB;
  if (config_.cut_height_m > 0 && maneuver_.done(in.now) &&
      in.x.p_NB.z() < config_.cut_height_m + 0.05) {
    go(MissionState::shut_down, "over the pad: thrust is cut", in, out);
    c.mode = Command::Mode::idle;
    return;
  }
  if (committed_ && abort_wanted_ && !abort_told_) {
    abort_told_ = true;
    note("the operator aborted past the commit height: it lands", in, out);
  }
  if (committed_) touch_down_.feel(in, maneuver_);
  if (touch_down_.stands(in)) {
    go(MissionState::shut_down, "stands on the pad", in, out);
    return;
  }
  if (touch_down_.settling()) {
    if (const char* told = touch_down_.moved(in)) note(told, in, out);
    c.mode = Command::Mode::settle;
    c.ramp_share = touch_down_.thrust_share(in.now);
    return;
  }
  // A change of pace before what is sent acts could only be missed.
  const Time acts = in.now + from_seconds(in.acts_in);
  // Where it would touch, off the middle of the pad.
  const double miss = horizontal(error + kMissAhead * (in.x.v_NB - ref.v_NB));
  if (committed_) c.square_up = touch_down_.square_up(in, miss);
  if (!committed_) replan(in, out);
  // A deck that swings is waited for instead.
  if (!has_next_ && !quiet_deck_.swings(in)) touch_down_.flare(in, maneuver_);
  if (!committed_) {
    // Below it there is no certified way back. Over a deck that swings it stops lower
    // down, and a way up begins from rest.
    const bool way_back =
        config_.way_back && plan_.escape.exists && !quiet_deck_.swings(in);
    const double commit_height = std::max(gear_height_ + config_.commit_height_m,
                                          way_back ? plan_.escape.height_m : 0);
    if (config_.wait_error_m > 0 &&
        ref.p_NB.z() < commit_height + config_.wait_room_m) {
      // Gusts pass, and decks come round: better to wait above the pad than to touch
      // beside its middle or on the edge of a foot.
      if (battery_low_) quiet_deck_.begin();  // it waits no more
      if (!battery_low_ && (quiet_deck_.swings(in) || quiet_deck_.waiting())) {
        const bool may_stop = in.x.p_NB.z() > commit_height + kStopsWithin;
        const bool waits = quiet_deck_.waits(in, maneuver_, miss, may_stop);
        maneuver_.aim_pace(acts, waits ? 0 : 1);
      } else {
        const double tired = std::exp2(maneuver_.lag(in.now) / config_.wait_more_s);
        const double off = miss / (tired * config_.wait_error_m);
        maneuver_.aim_pace(acts, std::clamp(1 - (off - 1) / kWaitsAt, 0.0, 1.0));
      }
    }
    if (hold_wanted_ && !battery_low_) {
      go(MissionState::hold, "the operator holds", in, out);
    } else if (unseen(in) > config_.sight_lost_s) {
      go(MissionState::lost_target, words_for(in.blindness).lost, in, out);
    } else if (too_vague(in) && unseen(in) < kFreshSight && config_.cut_height_m <= 0) {
      go(MissionState::go_around, "too few LEDs are seen to land by", in, out);
    } else if (error.norm() > config_.go_around_error_m) {
      go(MissionState::go_around,
         in.computer_was_late ? words_for(Blindness::computer).lost
         : !in.platform_ready ? kNoOdometry
                              : "too far from the trajectory",
         in, out);
    } else if (!quiet_deck_.waiting() && in.x.p_NB.z() < commit_height &&
               ref.p_NB.z() < commit_height &&
               horizontal(ref.p_NB) < 0.5 * config_.go_around_error_m) {
      if (miss > config_.commit_error_m) {
        go(MissionState::go_around,
           in.platform_ready ? "not over the pad at the commit height" : kNoOdometry,
           in, out);
      } else {
        committed_ = true;
        maneuver_.aim_pace(acts, 1);
        note("past the commit height: it lands", in, out);
      }
    }
    return;
  }
  // A pad that starts or stops beneath it is left, as long as there is room to.
  const bool room = in.x.p_NB.z() > gear_height_ + kRoomToLeave;
  const Vector3 soon = in.x.p_NB + (room ? kMissAhead : 0) * in.x.v_NB;
  if (in_sight(in) && soon.head<2>().cwiseAbs().maxCoeff() > pad_half_) {
    go(MissionState::go_around, "the pad is not beneath it", in, out);
  } else if (maneuver_.past_end(in.now) > config_.landing_overtime_s) {
    go(MissionState::go_around, "no touch-down where the pad should be", in, out);
  }
}

void Mission::shut_down(const MissionInput& in, Command& c, Output& out) {
  c.mode = Command::Mode::idle;
  if (pilot_flies(in)) {
    seen_by_pilot_ = in_sight(in);
    go(MissionState::pilot, "the pilot has taken over", in, out);
    c.mode = Command::Mode::silent;
    return;
  }
  if (in.telemetry_heard && !in.armed) {
    airborne_ = false;
    c.mode = Command::Mode::silent;
    go(MissionState::complete, touch_down_.how_it_stands(in), in, out);
    return;
  }
  if (in.link->silence(in.now) > kShutDownUnheard) {
    c.mode = Command::Mode::silent;
    go(MissionState::lost_link,
       "nothing heard since touch-down: the autopilot stops its motors", in, out);
    return;
  }
  if (const char* told = touch_down_.moved(in)) note(told, in, out);
  if (to_seconds(in.now - last_order_) >= kOrderEvery) {
    c.order = AutopilotOrder::disarm;
    last_order_ = in.now;
  }
}

void Mission::stop_over_ground(const MissionInput& in) {
  FlatState ref = maneuver_.at(in.now);
  const Vector3 left =
      -inertial_velocity_N(in.platform, ref.p_NB, Vector3::Zero()) - ref.v_NB;
  const double gain =
      std::min(1 / kStopIn, config_.stop_acceleration_m_s2 / (left.norm() + 1e-6));
  ref.a_NB = gain * left;
  ref.j_NB.setZero();
  ref.yaw_rate = ref.yaw_acceleration = 0;
  maneuver_ = Maneuver::coast(ref, in.now);
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
  if (maneuver_.done(in.now) && search_goal_ != config_.search_point) {
    search_goal_ = config_.search_point;
    move_to(search_goal_, config_.search_speed_m_s, in);
  }
  // Pictures that come late still say where it was, if not whether it may land.
  const Seconds search = unseen(in) < kStillKnown ? config_.give_up_late_s
                         : learnt(in)             ? config_.give_up_s
                                                  : kShortSearch;
  if (in_state(in) > search || !in.estimate_valid) {
    go(MissionState::aborted, words_for(why).given_up, in, out);
    for_want_of_sight_ = true;
  }
}

bool Mission::learnt(const MissionInput& in) const {
  return to_seconds(in.seen - lifted_at_) > kLearntIn;
}

void Mission::lost_link(const MissionInput& in, Command& c, Output& out) {
  if (!in.link->healthy(in.now)) return;
  const bool autopilot_acts =
      in.mode == AutopilotMode::land || in.mode == AutopilotMode::failsafe;
  if (in.telemetry_heard && !in.armed) {
    airborne_ = false;
    // Why it was alone stays told.
    const bool stood_still = std::strcmp(status_.reason, kStoodStill) == 0;
    const bool failsafe = std::strcmp(status_.reason, kFailsafe) == 0;
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
    c.mode = Command::Mode::track;
  }
}

bool Mission::may_be_left(const MissionInput& in) {
  const bool heard = in.link->healthy(in.now) && in.mode == AutopilotMode::offboard;
  if (!heard || !in.estimate_valid || in_state(in) > config_.leave_max_s) return true;
  if (in_sight(in)) return outline_.clear(in.x.p_NB);
  // Better it drifts than that it sinks on a prediction that knows no thrust.
  if (!learnt(in)) return true;
  // The autopilot does not know its speed without us, and would drift with it.
  stop_over_ground(in);
  const FlatState ref = maneuver_.at(in.now);
  return inertial_velocity_N(in.platform, ref.p_NB, ref.v_NB).norm() < kStopped;
}

void Mission::aborted(const MissionInput& in, Command& c, Output& out) {
  if (in.telemetry_heard && !in.armed) {
    airborne_ = false;
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
    move_to(config_.safety.leave_at_m, config_.move_speed_m_s, in);
  }
  left_ = left_ || may_be_left(in);
  if (!left_) {
    c.mode = Command::Mode::track;
  } else if (to_seconds(in.now - last_order_) >= kOrderEvery) {
    c.order = AutopilotOrder::land;
    last_order_ = in.now;
  }
}

// Set-points go on, so that the autopilot may be switched back to them; they ask for
// nothing but to fly on as the drone does. Nothing is ordered.
void Mission::pilot(const MissionInput& in, Command& c, Output& out) {
  if (in.telemetry_heard && !in.armed) {
    airborne_ = false;
    go(MissionState::complete, "the pilot stopped the motors", in, out);
    return;
  }
  if (in.link->lost(in.now)) {
    go(MissionState::lost_link, kUnheard, in, out);
    return;
  }
  const bool fresh = in_sight(in);
  if (in.mode == AutopilotMode::offboard) {
    if (fresh) {
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
  if (fresh != seen_by_pilot_ && to_seconds(in.now - told_) > kNotesApart) {
    seen_by_pilot_ = fresh;
    note(fresh ? "the pilot flies, the LEDs are in sight"
               : "the pilot flies, the LEDs are out of sight",
         in, out);
  }
  if (!in.estimate_valid) return;
  FlatState as_it_flies;
  as_it_flies.p_NB = in.x.p_NB;
  as_it_flies.v_NB = in.x.v_NB;
  as_it_flies.yaw = yaw_of(in.x.R_NB);
  maneuver_ = Maneuver::coast(as_it_flies, in.now);
  c.mode = Command::Mode::track;
}

}  // namespace alight
