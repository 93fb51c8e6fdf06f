#include "alight/mission/mission.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "alight/mission/mission_common.h"

namespace alight {
namespace {

// Around a block corners come more often than that: longer it does not ask for more
// rest than at first.
constexpr Seconds kPatientFor = 8;
// s. Nothing heard of it and seen to stray for so long, set-points do not arrive; a
// gust, or a pad that stops, is over by then.
constexpr Seconds kDisobeys = 1;
// How long a refused drone that is armed all the same is told to disarm, s.
constexpr Seconds kDisarmFor = 1;
// So late it is heard at the latest that an order to arm has come through.
constexpr Seconds kArmsYet = 0.5;
// m from the reference: something has thrown it off its way, and what is asked for from
// there on must be flyable from where it is. It brakes within the other.
constexpr double kStrayed = 0.6;
constexpr double kBrakeWithin = 0.15;
constexpr double kRoomTaken = 0.5;   // of that below it: it lags behind what it is told
constexpr double kHardestBrake = 4;  // m/s^2
// Longer than that, s, the way to where the user wants it left is not waited for.
constexpr Seconds kLongestWay = 30;
// A platform that is faster than the limit for so long, s, stays so.
constexpr Seconds kTooFastFor = 0.5;
// So many sd of an expected miss may come to the one at which commit is refused: what
// is known less well, and for longer, s, than it takes to be known again, is not landed
// by.
constexpr double kVagueSds = 2;
constexpr double kVagueLeast = 0.1;  // m; or of that, from afar, where it is more
constexpr Seconds kVagueFor = 0.1;
constexpr const char* kActsAlone = "set-points do not arrive: the autopilot acts alone";

/// Level direction from the lens to the pad.
Vector3 level_from_lens(const Rig& rig) {
  Vector3 v = -rig.camera.X_NC.translation();
  v.z() = 0;
  return v.norm() > 1e-3 ? Vector3(v.normalized()) : Vector3(Vector3::Zero());
}

}  // namespace

Mission::Mission(const MissionConfig& config, const Rig& rig)
    : config_(places_for(config, rig)),
      outline_(rig),
      gear_height_(rig.drone.gear_height_m),
      arm_(rig.drone.arm_m),
      pad_half_(0.5 * rig.pad.size_m),
      above_floor_(rig.pad.above_floor_m),
      from_lens_(level_from_lens(rig)),
      speed_max_(rig.limits.speed_m_s),
      unseen_lifting_(1e-3 * rig.timing.frame_to_use_ms + 2.5 / rig.timing.rate_hz),
      tilt_max_(rig.drone.tilt_max_deg * kDegree),
      into_view_(rig, config_.search_point),
      way_down_(rig),
      leaves_where_told_(!config.safety.leave_at_m.isZero()),
      leave_places_(way_down_.places(config_.safety.leave_at_m)),
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
      search_goal_ = search_from(in);
      move_to(search_goal_, config_.search_speed_m_s, in);
      break;
    case MissionState::aborted:
      leave_place_ = config_.safety.leave_at_m;
      leave_by_ = in.now + from_seconds(config_.leave_max_s);
      if (leaves_where_told_) {
        const double way = (leave_place_ - in.x.p_NB).norm();
        leave_by_ += from_seconds(std::min(way / config_.move_speed_m_s, kLongestWay));
      }
      chose_place_ = 0;
      not_clear_ = in.now;
      move_to(leave_place_, config_.move_speed_m_s, in);
      break;
    case MissionState::rendezvous:
      move_to(config_.rendezvous_point, config_.move_speed_m_s, in);
      break;
    default:
      break;
  }
}

void Mission::note(const char* reason, const MissionInput& in, Output& out) {
  mention(reason, in, out);
  status_.reason = reason;
}

void Mission::mention(const char* what, const MissionInput& in, Output& out) {
  out.transitions.push_back({in.now, status_.state, status_.state, what});
  told_ = in.now;
}

void Mission::move_to(const Vector3& p_NB, double speed, const MissionInput& in) {
  stops_here_ = false;
  // From the reference where it is being followed, so that nothing jumps; from the
  // drone itself where it is not.
  MoveLimits limits;
  limits.speed_m_s = speed;
  limits.acceleration_m_s2 =
      config_.move_acceleration_m_s2 * speed / config_.move_speed_m_s;
  const FlatState from = maneuver_.at(in.now);
  if ((from.p_NB - in.x.p_NB).norm() > config_.go_around_error_m) {
    move_from_here(p_NB, limits, in);
  } else {
    begin_move(from, p_NB, limits, in);
  }
}

void Mission::begin_move(const FlatState& from, const Vector3& p_NB, MoveLimits limits,
                         const MissionInput& in) {
  limits.dip_m = room_below(from.p_NB);
  maneuver_ = Maneuver::move(PointToPoint(in.now, from, p_NB, 0, limits));
  has_next_ = false;
}

double Mission::room_below(const Vector3& p_NB) const {
  const double above_pad = p_NB.z() - gear_height_;
  return kRoomTaken * (above_pad > 0 ? above_pad : above_pad + above_floor_);
}

void Mission::move_from_here(const Vector3& p_NB, MoveLimits limits,
                             const MissionInput& in) {
  const FlatState from = as_it_flies(in.x);
  const double room = std::clamp(room_below(from.p_NB), 0.03, kBrakeWithin);
  const double within = from.v_NB.z() < 0 ? room : kBrakeWithin;
  const double brake = std::min(in.x.v_NB.squaredNorm() / (2 * within), kHardestBrake);
  limits.acceleration_m_s2 = std::max(limits.acceleration_m_s2, brake);
  begin_move(from, p_NB, limits, in);
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
  if (kVagueSds * in.miss_sd_m <= std::max(config_.commit_error_m, kVagueLeast)) {
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
    const Seconds strays = to_seconds(in.now - as_told_till_);
    if (state != MissionState::land || strays > kDisobeys) {
      go(MissionState::lost_link, kUnheard, in, out);
      return true;
    }
  }
  // A burst of losses puts the autopilot into its failsafe until set-points come again.
  if (in.mode != AutopilotMode::failsafe) {
    // Why it holds, if it does, stays the reason.
    if (failsafe_ && status_.reason == kActsAlone) status_.reason = reason_before_;
    failsafe_ = false;
  } else {
    if (!failsafe_) {
      failsafe_since_ = in.now;
      reason_before_ = status_.reason;
      note(kActsAlone, in, out);
    }
    failsafe_ = true;
    failsafe_till_ = in.now;
  }
  // Back on the pad after that, a drone that never left it is asked to be elsewhere.
  const Seconds failsafe_s = leaves_ground(in) ? 0 : config_.failsafe_s;
  if (in.mode == AutopilotMode::land ||
      (failsafe_ && to_seconds(in.now - failsafe_since_) >= failsafe_s)) {
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

bool Mission::battery_empty(const MissionInput& in) const {
  return battery_low_ && in.battery < config_.safety.battery_empty;
}

MissionCommand Mission::step(const MissionInput& in, Output& out) {
  assert(in.link != nullptr);
  MissionCommand c;
  const bool as_told = obeys(in);
  if (as_told) as_told_till_ = in.now;
  c.tilt_limit = status_.state == MissionState::land && as_told
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
  if (in.armed && in.mode == AutopilotMode::offboard && in.link->healthy(in.now)) {
    obeyed_till_ = in.now;
  }
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
      if (status_.state == MissionState::go_around) set_down(in, c, out);
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
  keep_off_ground(in, c);
  c.platform_speed_wish = platform_wish(in);
  c.on_ground = !airborne_;
  out.mission = status_;
  return c;
}

bool Mission::obeys(const MissionInput& in) const {
  return in_sight(in) && (in.x.v_NB - reference(in.now).v_NB).norm() < kObeys;
}

bool Mission::keep_ordering(AutopilotOrder order, const MissionInput& in, Command& c) {
  if (to_seconds(in.now - last_order_) < kOrderEvery) return false;
  c.order = order;
  last_order_ = in.now;
  return true;
}

bool Mission::alone_within(Seconds s, Time t) const {
  return failsafe_till_ > 0 && to_seconds(t - failsafe_till_) < s;
}

void Mission::stop_motors(const MissionInput& in, Command& c) {
  c.order = AutopilotOrder::disarm;
  c.mode = Command::Mode::silent;
  last_order_ = in.now;
  disarms_ = true;
}

// Later whoever arms has a reason for it.
void Mission::disarm(const MissionInput& in, Command& c) {
  const bool runs = in.armed || to_seconds(in.now - arm_told_) < kArmsYet;
  disarms_ = disarms_ && in.telemetry_heard && runs && !pilot_flies(in) &&
             in_state(in) < kDisarmFor;
  if (disarms_) keep_ordering(AutopilotOrder::disarm, in, c);
}

}  // namespace alight
