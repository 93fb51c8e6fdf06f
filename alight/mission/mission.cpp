#include "alight/mission/mission.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace alight {
namespace {

constexpr Seconds kOrderEvery = 0.1;
// Longer than any gap that a healthy camera and radio leave.
constexpr Seconds kFreshSight = 0.15;
// m within touch_settled_s: a third of what a landing sinks in that time.
constexpr double kStillSinking = 0.005;
// m above gear height, an LED rig's error; m/s.
constexpr double kTouchHighest = 0.1;
constexpr double kStanding = 0.05;
// Error of speed counts for as long as the rest of a landing takes from the commit on.
constexpr double kFootSpread = 0.7;  // of the feet from the middle, of the arm
// At least so far ahead of now control looks at the reference.
constexpr Seconds kControlAhead = 0.25;
constexpr Seconds kMissAhead = 0.25;

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

Seconds unseen(const MissionInput& in) { return to_seconds(in.now - in.seen); }

bool in_sight(const MissionInput& in) {
  return in.estimate_valid && unseen(in) < kFreshSight;
}

}  // namespace

Mission::Mission(const MissionConfig& config, const Rig& rig)
    : config_(places_for(config, rig)),
      gear_height_(rig.drone.gear_height_m),
      arm_(rig.drone.arm_m),
      from_lens_(level_from_lens(rig)),
      tilt_max_(rig.drone.tilt_max_deg * kDegree) {}

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
  out.transitions.push_back({in.now, status_.state, to, reason});
  status_.state = to;
  status_.reason = reason;
  status_.since = in.now;
  settling_ = false;
  plan_pending_ = false;
  plan_tries_ = 0;
  low_ = false;
  switch (to) {
    case MissionState::follow:
      move_to(config_.follow_point, config_.move_speed_m_s, in);
      break;
    case MissionState::go_around:
    case MissionState::lost_target:
    case MissionState::hold:
      move_to(config_.follow_point, config_.move_speed_m_s, in);
      break;
    case MissionState::rendezvous:
      move_to(config_.rendezvous_point, config_.move_speed_m_s, in);
      break;
    default:
      break;
  }
}

void Mission::move_to(const Vector3& p_NB, double speed, const MissionInput& in) {
  // From the reference where it is being followed, so that nothing jumps; from the
  // drone itself where it is not.
  FlatState from = maneuver_.at(in.now);
  if ((from.p_NB - in.x.p_NB).norm() > config_.go_around_error_m) {
    from = FlatState{};
    from.p_NB = in.x.p_NB;
    from.v_NB = in.x.v_NB;
    from.yaw = yaw_of(in.x.R_NB);
  }
  MoveLimits limits;
  limits.speed_m_s = speed;
  limits.acceleration_m_s2 = config_.move_acceleration_m_s2;
  maneuver_ = Maneuver::move(PointToPoint(in.now, from, p_NB, 0, limits));
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
  return to_seconds(in.now - settled_since_) >=
         config_.settle_s + config_.settle_more_s * status_.attempts;
}

bool Mission::overruled(const MissionInput& in, Output& out) {
  const MissionState state = status_.state;
  if (abort_wanted_) {
    go(MissionState::aborted, "the operator aborted: the autopilot lands", in, out);
    return true;
  }
  if (in.link->lost(in.now)) {
    go(MissionState::lost_link,
       "nothing heard from the drone: its autopilot acts alone", in, out);
    return true;
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
    go(MissionState::lost_link, "the autopilot's failsafe has taken over", in, out);
    return true;
  }
  if (in.telemetry_heard && !in.armed && state != MissionState::land) {
    go(MissionState::aborted, "the autopilot stopped its motors", in, out);
    return true;
  }
  if (hold_wanted_ && state != MissionState::hold && state != MissionState::land &&
      state != MissionState::lost_target) {
    go(MissionState::hold, "the operator holds", in, out);
    return true;
  }
  return false;
}

MissionCommand Mission::step(const MissionInput& in, Output& out) {
  assert(in.link != nullptr);
  MissionCommand c;
  c.tilt_limit = in.link->tilt_limit(in.now, tilt_max_);
  // What the operator said stands until he says otherwise, whatever comes between.
  if (in.wish == OperatorWish::go) {
    wanted_ = true;
    hold_wanted_ = false;
  }
  hold_wanted_ = hold_wanted_ || in.wish == OperatorWish::hold;
  abort_wanted_ = abort_wanted_ || in.wish == OperatorWish::abort;
  switch (status_.state) {
    case MissionState::idle:
      idle(in, out);
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
    case MissionState::complete:
    case MissionState::refused:
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
  // A platform that can wait does so until it can be followed.
  const bool on_its_way = status_.state == MissionState::idle ||
                          status_.state == MissionState::armed ||
                          status_.state == MissionState::taken_off;
  c.platform_speed_wish = config_.start_on_floor && on_its_way ? 0 : 1;
  c.on_ground = !airborne_;
  out.mission = status_;
  return c;
}

void Mission::idle(const MissionInput& in, Output& out) {
  if (in.estimate_valid) {
    p_rest_ = in.x_seen.p_NB;
    R_rest_ = in.x_seen.R_NB;
  }
  if (abort_wanted_) {
    go(MissionState::refused, "the operator aborted before the start", in, out);
    return;
  }
  if (!wanted_) {
    status_.since = in.now;
    return;
  }
  const char* missing = nullptr;
  if (!in.link->ever_heard() || !in.link->healthy(in.now)) {
    missing = "the radio link is not healthy";
  } else if (!in.telemetry_heard) {
    missing = "the autopilot sends no telemetry";
  } else if (!in.platform_ready) {
    missing = "there is no platform odometry";
  } else if (!config_.start_on_floor &&
             (!in.estimate_valid || unseen(in) > kFreshSight)) {
    missing = "the LEDs are not seen on the pad";
  }
  if (missing == nullptr && in.battery < config_.battery_min) {
    go(MissionState::refused, "the battery is too low to start", in, out);
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
    go(MissionState::refused, "the operator aborted before the start", in, out);
  } else if (in.armed && in.link->healthy(in.now)) {
    go(MissionState::taken_off, "armed: taking off", in, out);
  } else if (in_state(in) > config_.arm_timeout_s) {
    c.order = AutopilotOrder::disarm;
    c.mode = Command::Mode::silent;
    go(MissionState::refused, "the autopilot does not arm", in, out);
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
    if (!fresh && unseen(in) > config_.sight_lost_s) {
      go(MissionState::lost_target, "the LEDs are out of sight", in, out);
      return;
    }
    const bool there = (in.x.p_NB - maneuver_.at(in.now).p_NB).norm() < 0.12;
    if (maneuver_.done(in.now) && (there || maneuver_.past_end(in.now) > 1.5)) {
      go(MissionState::follow, "clear of the pad: to the follow point", in, out);
    }
    return;
  }

  c.mode = Command::Mode::ramp;
  const double rate =
      config_.start_on_floor ? config_.blind_ramp_rate : config_.ramp_rate;
  const double most = config_.start_on_floor ? config_.blind_ramp_to : config_.ramp_to;
  c.ramp_share = std::min(config_.ramp_from + rate * in_state(in), most);
  const Seconds limit =
      config_.start_on_floor ? config_.blind_max_s : config_.ramp_timeout_s;
  if (abort_wanted_ || in.link->lost(in.now) || !in.armed || in_state(in) > limit) {
    // From the floor it may fly unseen: only the autopilot can bring it down.
    c.order = config_.start_on_floor ? AutopilotOrder::land : AutopilotOrder::disarm;
    c.mode = Command::Mode::silent;
    airborne_ = config_.start_on_floor;
    const char* reason = config_.start_on_floor
                             ? "never came into sight: the autopilot lands"
                             : "did not leave the ground";
    if (abort_wanted_) reason = "the operator aborted during take-off";
    go(config_.start_on_floor ? MissionState::aborted : MissionState::refused, reason,
       in, out);
    return;
  }
  const Vector3 way = in.x_seen.p_NB - p_rest_;
  const double tipped =
      angle_between(Vector3(in.x_seen.R_NB.col(2)), Vector3(R_rest_.col(2)));
  // Tipping over a foot lifts the middle, too.
  const bool rose = way.z() - arm_ * std::sin(tipped) > config_.lift_m;
  // Light on its feet it slides and tips before it flies; thrust must go on growing, or
  // it stays there.
  const bool slipped =
      horizontal(way) > config_.slip_m || tipped > config_.slip_tilt_deg * kDegree;
  const bool lifted = fresh && (config_.start_on_floor || rose || slipped);
  if (!lifted) return;
  airborne_ = true;
  c.lifted = true;
  // Thrust grows evenly, so the rise goes with the third power of time.
  c.lifted_since = config_.start_on_floor || !rose
                       ? 0
                       : std::cbrt(6 * config_.lift_m / (config_.ramp_rate * kGravity));
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

void Mission::follow(const MissionInput& in, Output& out) {
  if (overruled(in, out)) return;
  if (unseen(in) > config_.sight_lost_s) {
    go(MissionState::lost_target, "the LEDs are out of sight", in, out);
    return;
  }
  const bool there = settled(in);
  if (status_.state == MissionState::hold) {
    if (in.wish == OperatorWish::go) {
      status_.attempts = 0;
      go(MissionState::follow, "the operator goes on", in, out);
    }
    return;
  }
  if (!there) return;
  if (status_.attempts >= config_.attempts_max) {
    go(MissionState::hold, "too many landings have failed", in, out);
  } else {
    go(MissionState::rendezvous, "following well: to the rendezvous", in, out);
  }
}

void Mission::request_plan(const MissionInput& in, Output& out) {
  PlanRequest& request = out.plan_request;
  request = PlanRequest{};
  request.id = ++plan_id_;
  request.start = in.now + from_seconds(config_.plan_ahead_s);
  request.from = maneuver_.at(request.start);
  request.platform = predict(in.platform, config_.plan_ahead_s);
  request.platform.t = request.start;
  out.has_plan_request = true;
  plan_pending_ = true;
  plan_asked_ = in.now;
  ++plan_tries_;
}

void Mission::rendezvous(const MissionInput& in, Output& out) {
  if (overruled(in, out)) return;
  if (unseen(in) > config_.sight_lost_s) {
    go(MissionState::lost_target, "the LEDs are out of sight", in, out);
    return;
  }
  if (in.plan != nullptr && plan_pending_ && in.plan->result.id == plan_id_) {
    plan_pending_ = false;
    const PlanResult& plan = in.plan->result;
    if (!plan.ok()) {
      plan_trouble_ = plan.reason;
    } else if (in.now > plan.start) {
      plan_trouble_ = "the plan came too late";
    } else {
      ++status_.attempts;
      go(MissionState::land, "the landing is planned", in, out);
      maneuver_ = Maneuver::landing(plan.trajectory, plan.start, config_.sink_m);
      committed_ = false;
      flared_ = false;
      settling_down_ = false;
      return;
    }
  }
  if (!settled(in)) return;
  const bool waited = to_seconds(in.now - plan_asked_) > config_.plan_retry_s;
  if (plan_tries_ > 0 && !waited) return;
  if (plan_tries_ >= config_.plan_tries) {
    ++status_.attempts;
    go(MissionState::follow,
       plan_pending_ ? "the planner does not answer" : plan_trouble_, in, out);
    return;
  }
  request_plan(in, out);
}

bool Mission::may_touch(const MissionInput& in) const {
  if (!committed_) return false;
  // Past the commit height there is no way back: unseen, it trusts the prediction.
  if (unseen(in) > config_.sight_lost_s) {
    return maneuver_.past_end(in.now) > config_.blind_sink_s;
  }
  const double above = in.x_seen.p_NB.z() - gear_height_;
  if (maneuver_.at(in.now).p_NB.z() > gear_height_) return false;
  if (above < config_.touch_height_m) return true;
  // Pushed down for a while it does not sink: something carries it, and the rig is not
  // quite what the file says.
  return maneuver_.past_end(in.now) > config_.blind_sink_s && above < kTouchHighest &&
         std::abs(in.x.v_NB.z()) < kStanding;
}

bool Mission::touched_down(const MissionInput& in) {
  const double z = in.x_seen.p_NB.z();
  if (!settling_down_) {
    if (!may_touch(in)) return false;
    settling_down_ = true;
    settle_since_ = in.now;
    low_ = false;
  }
  if (unseen(in) > config_.sight_lost_s) {
    return to_seconds(in.now - settle_since_) >= config_.settle_down_s;
  }
  // Still sinking, if slowly: not yet.
  if (!low_ || z < low_z_ - kStillSinking) {
    low_ = true;
    low_since_ = in.now;
    low_z_ = z;
  }
  return to_seconds(in.now - low_since_) >= config_.touch_settled_s ||
         to_seconds(in.now - settle_since_) >= config_.settle_down_s;
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
  if (touched_down(in)) {
    go(MissionState::shut_down, "stands on the pad", in, out);
    return;
  }
  if (settling_down_) {
    c.mode = Command::Mode::settle;
    const double passed = to_seconds(in.now - settle_since_) / config_.settle_down_s;
    c.ramp_share = config_.settle_share * std::max(0.0, 1 - passed);
    return;
  }
  flare(in);
  if (!committed_) {
    // Where it would touch, off the middle of the pad.
    const double miss = horizontal(error + kMissAhead * (in.x.v_NB - ref.v_NB));
    const double commit_height = gear_height_ + config_.commit_height_m;
    if (config_.wait_error_m > 0 &&
        ref.p_NB.z() < commit_height + config_.wait_room_m) {
      // Gusts pass: better to wait above the pad than to touch beside its middle.
      const double patience = maneuver_.lag(in.now) < config_.wait_max_s ? miss : 0;
      maneuver_.aim_pace(in.now,
                         std::clamp(2 - patience / config_.wait_error_m, 0.0, 1.0));
    }
    if (hold_wanted_) {
      go(MissionState::hold, "the operator holds", in, out);
    } else if (unseen(in) > config_.sight_lost_s) {
      go(MissionState::lost_target, "the LEDs are out of sight", in, out);
    } else if (error.norm() > config_.go_around_error_m) {
      go(MissionState::go_around, "too far from the trajectory", in, out);
    } else if (in.x.p_NB.z() < commit_height && ref.p_NB.z() < commit_height &&
               horizontal(ref.p_NB) < 0.5 * config_.go_around_error_m) {
      if (miss > config_.commit_error_m) {
        go(MissionState::go_around, "not over the pad at the commit height", in, out);
      } else {
        committed_ = true;
        maneuver_.aim_pace(in.now, 1);
      }
    }
    return;
  }
  if (maneuver_.past_end(in.now) > config_.landing_overtime_s) {
    go(MissionState::go_around, "no touch-down where the pad should be", in, out);
  }
}

void Mission::flare(const MissionInput& in) {
  const Seconds ahead = config_.flare_s + 0.1 + kControlAhead;
  if (flared_ || config_.flare_s <= 0 || maneuver_.past_end(in.now) < -ahead) return;
  flared_ = true;
  // Upright on the pad, whatever wind and turns would have it lean.
  Vector3 a_N = -config_.flare_share * in.f_touch_N;
  a_N.z() = 0;
  if (const double a = a_N.norm(); a > config_.flare_max_m_s2) {
    a_N *= config_.flare_max_m_s2 / a;
  }
  const double left = horizontal(in.f_touch_N + a_N) / kGravity;
  const double sink = std::max(-maneuver_.end().v_NB.z(), 0.1);
  const Seconds early = std::min(kFootSpread * arm_ * left / sink, 0.1);
  maneuver_.end_with(Flare(a_N, config_.flare_s, early));
}

void Mission::shut_down(const MissionInput& in, Command& c, Output& out) {
  c.mode = Command::Mode::idle;
  if (in.telemetry_heard && !in.armed) {
    airborne_ = false;
    c.mode = Command::Mode::silent;
    go(MissionState::complete, "motors stopped", in, out);
    return;
  }
  if (to_seconds(in.now - last_order_) >= kOrderEvery) {
    c.order = AutopilotOrder::disarm;
    last_order_ = in.now;
  }
}

void Mission::lost_target(const MissionInput& in, Output& out) {
  if (overruled(in, out)) return;
  if (unseen(in) < kFreshSight) {
    go(MissionState::go_around, "the LEDs are in sight again", in, out);
  } else if (in_state(in) > config_.give_up_s || !in.estimate_valid) {
    go(MissionState::aborted, "the LEDs stay out of sight: the autopilot lands", in,
       out);
  }
}

void Mission::lost_link(const MissionInput& in, Command& c, Output& out) {
  const bool autopilot_acts =
      in.mode == AutopilotMode::land || in.mode == AutopilotMode::failsafe;
  if (in.link->healthy(in.now)) {
    if (in.telemetry_heard && !in.armed) {
      airborne_ = false;
      go(MissionState::complete, "the autopilot landed by itself", in, out);
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
}

void Mission::aborted(const MissionInput& in, Command& c, Output&) {
  if (in.telemetry_heard && !in.armed) {
    airborne_ = false;
    return;
  }
  if (to_seconds(in.now - last_order_) >= kOrderEvery) {
    c.order = AutopilotOrder::land;
    last_order_ = in.now;
  }
}

}  // namespace alight
