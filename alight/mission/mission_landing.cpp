// From the follow point to motors that have stopped.
#include <algorithm>
#include <cmath>

#include "alight/mission/miss.h"
#include "alight/mission/mission.h"
#include "alight/mission/mission_common.h"
#include "alight/planning/replan.h"

namespace alight {
namespace {

// Without a word from the drone after touch-down its motors are its own, s.
constexpr Seconds kShutDownUnheard = 3;
constexpr double kWaitsAt = 1.0 / 3;  // above the miss that slows it, as a share
// m above gear height when thrust that is sent now acts: enough to stop sinking in.
constexpr double kRoomToLeave = 0.015;
// m, of a foot from the edge of the pad: what the estimate may be off by.
constexpr double kEdgeOff = 0.02;
// Of the drone's own speed limit: nearer to it, a platform leaves no room for a
// landing.
constexpr double kLeastRoom = 0.85;
// So often nothing but failed plans at the rendezvous: more will not help.
constexpr int kPlanlessMax = 3;
// s; a landing that has waited is flown by another clock than it was planned for.
constexpr Seconds kNoLag = 1e-6;
// Above the commit height a descent still stops.
constexpr double kStopsWithin = 0.03;  // m
// One that comes to rest so far below it waits there; further down the end of a landing
// has begun, which no longer stops.
constexpr double kWaitsDownTo = 0.03;  // m
// A gust that pushes a waiting drone through the commit height passes again. So a miss
// is refused only this far below, where it still can leave, or where it sinks there in
// the time that thrust needs to answer.
constexpr double kRefusesBelow = 0.045;  // m
constexpr Seconds kSinksOn = 0.25;
// m above gear height: a deck that swings beneath a drone that waits lower down reaches
// its feet.
constexpr double kFeetClear = 0.04;
// So long after its autopilot has acted alone, s, a drone may be where that left it.
constexpr Seconds kAloneLately = 0.5;
// A drone on the pad is in sight of the camera. One that a computer which stood still
// past the commit does not see again within this time is not there any more.
constexpr Seconds kStandsInSight = 0.15;
// Two stalls of the radio within this time announce a third, s.
constexpr Seconds kStallsWithin = 8;
constexpr const char* kSetDown =
    "set-points did not arrive: its autopilot has set it down on the pad";
constexpr const char* kNoOdometry = "no platform odometry comes";

/// Pictures that come late are seen by, others that do not come may be the last.
bool sight_fails(const MissionInput& in) {
  return !in_sight(in) && in.blindness != Blindness::late;
}

double height_soon(const MissionInput& in) {
  return in.x.p_NB.z() + kSinksOn * std::min(0.0, in.x.v_NB.z());
}

}  // namespace

void Mission::follow(const MissionInput& in, Output& out) {
  if (overruled(in, out)) return;
  if (unseen(in) > config_.sight_lost_s) {
    go(MissionState::lost_target, words_for(in.blindness).lost, in, out);
    return;
  }
  if (strayed(in)) {
    move_to(config_.follow_point, config_.move_speed_m_s, in);
    // Why it holds stays told.
    if (status_.state == MissionState::hold) {
      mention(kOffItsWay, in, out);
    } else {
      note(kOffItsWay, in, out);
    }
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
    usual_miss_.begin();
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
  usual_miss_.see(expected_miss(in.x, maneuver_.at(in.now)), in.now);
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
  const bool stalls = in.link->stalls_often(in.now, kStallsWithin) && !battery_low_;
  if (!settled(in) || (stalls && !plan_pending_)) {
    if (in_state(in) > config_.unsettled_max_s) {
      go(MissionState::hold,
         stalls ? kLinkStalls : "it does not come to rest at the rendezvous", in, out);
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

bool Mission::wait_low(const MissionInput& in, const FlatState& ref, double miss,
                       double commit_height) {
  // A change of pace before what is sent acts could only be missed.
  const Time acts = in.now + from_seconds(in.acts_in);
  if (battery_low_) quiet_deck_.begin();  // it waits no more
  const bool low = ref.p_NB.z() < commit_height + config_.wait_room_m;
  double pace = 1;  // planned anew while it waited it may stand higher than it would
  if (config_.wait_error_m > 0 && low) {
    if (sight_fails(in)) {
      pace = 0;
    } else if (!battery_low_ && (quiet_deck_.swings(in) || quiet_deck_.waiting())) {
      const bool may_stop = in.x.p_NB.z() > commit_height + kStopsWithin &&
                            maneuver_.stops_at_z(acts) > gear_height_ + kFeetClear;
      pace = quiet_deck_.waits(in, maneuver_, miss, may_stop) ? 0 : 1;
    } else if (maneuver_.stops_at_z(acts) > commit_height - kWaitsDownTo) {
      const double tired = std::exp2(maneuver_.lag(in.now) / config_.wait_more_s);
      const double small = std::min(
          std::max(config_.wait_share * usual_miss_.rms(), config_.wait_least_m),
          config_.wait_error_m);
      const double off = miss / (tired * small);
      pace = std::clamp(1 - (off - 1) / kWaitsAt, 0.0, 1.0);
    }
  }
  maneuver_.aim_pace(acts, pace);
  return pace == 0 && in.x.p_NB.z() > commit_height - kWaitsDownTo;
}

// To go on flying from where its autopilot has set it down, light on its feet, threw
// drones off the pad.
bool Mission::set_down(const MissionInput& in, Command& c, Output& out) {
  if (!alone_within(kAloneLately, in.now) || !touch_down_.was_set_down(in))
    return false;
  c.mode = Command::Mode::idle;
  go(MissionState::shut_down, kSetDown, in, out);
  return true;
}

// Its thrust was not gone, as was supposed: from where it is seen, what that had made
// of the wind forgotten.
void Mission::leave_pad(const MissionInput& in, Command& c, Output& out) {
  FlatState from = as_it_flies(in.x_seen);
  from.v_NB.z() = std::max(from.v_NB.z(), 0.0);
  maneuver_ = Maneuver::coast(from, in.now);
  go(MissionState::go_around, "not heard as it touched, it slides off the pad", in,
     out);
  c.lifted = true;
}

// Its autopilot acted alone and left it there, however high its reference waits. (Where
// it only is the pad that moves, both meet again sooner than the drone gets away.)
bool Mission::sinks_beside(const MissionInput& in) const {
  const bool obeys = alone_within(kAloneLately, in.now) && in.link->healthy(in.now) &&
                     in.mode == AutopilotMode::offboard;
  const Vector3 soon = in.x.p_NB + kSinksOn * in.x.v_NB;
  return obeys && in_sight(in) && off_middle(soon) > pad_half_ &&
         height_soon(in) < gear_height_ + config_.commit_height_m - kRefusesBelow;
}

bool Mission::gone_meanwhile(const MissionInput& in) const {
  if (!in.computer_was_late || config_.start_on_floor) return false;
  return in.seen < in.woke && to_seconds(in.now - in.woke) > kStandsInSight;
}

void Mission::land(const MissionInput& in, Command& c, Output& out) {
  if (overruled(in, out)) return;
  if (!committed_ && set_down(in, c, out)) return;
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
  if (committed_ && gone_meanwhile(in)) {
    go(MissionState::lost_target, words_for(Blindness::computer).lost, in, out);
    return;
  }
  if (committed_) touch_down_.feel(in, maneuver_);
  if (touch_down_.stands(in)) {
    go(MissionState::shut_down, "stands on the pad", in, out);
    return;
  }
  if (touch_down_.settling() && touch_down_.slides_off(in)) {
    leave_pad(in, c, out);
    return;
  }
  if (touch_down_.settling()) {
    if (const char* told = touch_down_.moved(in)) note(told, in, out);
    c.mode = Command::Mode::settle;
    c.ramp_share = touch_down_.thrust_share(in.now);
    c.f_rest_N = touch_down_.leans_against_N();
    return;
  }
  const double miss = expected_miss(in.x, ref);
  usual_miss_.see(miss, in.now);
  if (committed_) c.square_up = touch_down_.square_up(in, miss);
  if (!committed_) replan(in, out);
  if (!has_next_) touch_down_.flare(in, maneuver_);
  if (!committed_) {
    // Below it there is no certified way back. Over a deck that swings it stops lower
    // down, and a way up begins from rest.
    const bool way_back =
        config_.way_back && plan_.escape.exists && !quiet_deck_.swings(in);
    const double commit_height = std::max(gear_height_ + config_.commit_height_m,
                                          way_back ? plan_.escape.height_m : 0);
    const bool waits = wait_low(in, ref, miss, commit_height);
    if (hold_wanted_ && !battery_low_) {
      go(MissionState::hold, "the operator holds", in, out);
    } else if (unseen(in) > config_.sight_lost_s) {
      go(MissionState::lost_target, words_for(in.blindness).lost, in, out);
    } else if (too_vague(in) && unseen(in) < kFreshSight && config_.cut_height_m <= 0 &&
               !battery_empty(in)) {
      go(MissionState::go_around, "too few LEDs are seen to land by", in, out);
    } else if (error.norm() > config_.go_around_error_m) {
      go(MissionState::go_around,
         in.computer_was_late ? words_for(Blindness::computer).lost
         : !in.platform_ready ? kNoOdometry
                              : "too far from the trajectory",
         in, out);
    } else if (sinks_beside(in)) {
      go(MissionState::go_around, "the pad is not beneath it", in, out);
    } else if (!waits && !quiet_deck_.waiting() && !sight_fails(in) &&
               in.x.p_NB.z() < commit_height && ref.p_NB.z() < commit_height &&
               horizontal(ref.p_NB) < 0.5 * config_.go_around_error_m) {
      if (miss > config_.commit_error_m) {
        if (height_soon(in) < commit_height - kRefusesBelow) {
          go(MissionState::go_around,
             in.platform_ready ? "not over the pad at the commit height" : kNoOdometry,
             in, out);
        }
      } else {
        committed_ = true;
        maneuver_.aim_pace(in.now + from_seconds(in.acts_in), 1);
        note("past the commit height: it lands", in, out);
      }
    }
    return;
  }
  // A pad that starts or stops beneath it, or from which it is blown, is left as long
  // as there is room to: not all feet would be on it.
  const bool room = in.z_acted > gear_height_ + kRoomToLeave;
  const Seconds ahead = room ? touch_down_.touches_within(in) : 0;
  const Vector3 soon = in.x.p_NB + ahead * in.x.v_NB;
  const double half = pad_half_ - (room ? touch_down_.foot_spread() + kEdgeOff : 0);
  if (in_sight(in, config_.sight_lost_s) && off_middle(soon) > half) {
    go(MissionState::go_around, "the pad is not beneath it", in, out);
  } else if (maneuver_.past_end(in.now) > config_.landing_overtime_s) {
    go(MissionState::go_around, "no touch-down where the pad should be", in, out);
  }
}

// It has come no farther than its take-off, and stands where that began.
bool Mission::may_start_anew() const {
  return status_.reason == kSetDown && status_.attempts == 0 &&
         starts_ < config_.starts_max;
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
    const bool anew = may_start_anew();
    go(anew ? MissionState::idle : MissionState::complete,
       anew ? kSetDown : touch_down_.how_it_stands(in), in, out);
    return;
  }
  if (in.link->silence(in.now) > kShutDownUnheard) {
    c.mode = Command::Mode::silent;
    go(MissionState::lost_link,
       "nothing heard since touch-down: the autopilot stops its motors", in, out);
    return;
  }
  if (const char* told = touch_down_.moved(in)) note(told, in, out);
  keep_ordering(AutopilotOrder::disarm, in, c);
}

}  // namespace alight
