// From the operator's go to the LEDs in sight.
#include <algorithm>
#include <cmath>

#include "alight/mission/mission.h"
#include "alight/mission/mission_common.h"

namespace alight {
namespace {

constexpr const char* kUnseenOnPad =
    "the LEDs are not seen on the pad, or not where the rig file has them";

// Share of the nominal hover thrust with which a drone that is a tenth lighter than the
// rig says comes down before the wind has it off the pad, and one that is as much
// heavier not too hard; and how long it takes from 3 cm and 0.3 m/s upwards, s.
constexpr double kComingDown = 0.6;
constexpr Seconds kComingDownFor = 0.45;
constexpr double kHardlyRises = 0.2;
constexpr double kSurelyFlies = 0.06;  // m above where it stood
// Likewise: with no more than this it has not left the ground yet.
constexpr double kStillStands = 0.85;
// What its autopilot has done by itself within this time, s, has not lifted it off.
constexpr Seconds kJustTookOver = 0.4;
constexpr Seconds kComesToRest = 0.2;
constexpr Seconds kFirstPicture = 0.2;  // after a stall, at the latest
// A drone that slides is about to lift. Its thrust grows by this share of the ramp's
// rate from there on: what is on its way as it lifts throws it up, and is all that it
// has, should set-points end then.
constexpr double kStillGrows = 0.5;
constexpr double kLeft = 0.02;       // m above where it stood: no foot touches,
constexpr double kLeftSeen = 0.005;  // told by a picture, which is older,
constexpr Seconds kLeavesIn = 0.8;   // which is never far off.
// So near above the ground, m, it keeps this much of the nominal hover thrust.
constexpr double kNearGround = 0.3, kKeepsUp = 0.9;
// Of the nominal hover thrust: it moves even a drone that is a fifth heavier than the
// rig says, and pictures that show nothing of that show the past.
constexpr double kMovesIt = 1.25;
constexpr double kStandNoise = 0.001;  // m; a rise that standing drones show
constexpr double kStands = 0.002;      // m; higher it may have left the ground
constexpr double kOffTheFloor = 0.15;  // m; what a mount that is off feigns is less.
constexpr double kMaySlide = 0.75;     // With less of the hover thrust wind moves none.
constexpr Seconds kRampActsIn = 0.1;  // Later, the take-off's thrust grows more slowly.
// A drone that stands: so near to its feet's height, m, so level, as slow as this, m/s,
// for so long. Before its first start a rig that is not as written down feigns more,
// and any speed as LEDs flicker.
constexpr double kFeetDown = 0.04, kLevelDeg = 12, kStill = 0.15;
constexpr double kBeforeTheFirst = 2.5;
constexpr Seconds kStoodFor = 0.2;
constexpr Seconds kCalmLink = 3;  // without a stall of the radio, before a start
constexpr const char* kUnhealthy = "the radio link is not healthy";
constexpr const char* kOffItsFeet =
    "it stands, but is seen higher or lower than its gear height: the camera's mount "
    "or the gear height is not as the rig file has it";

double angle_between(const Vector3& a, const Vector3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

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
  } else if (in.armed && starts_ > 0) {
    missing = "the autopilot does not stop its motors";
    const bool stands = in_sight(in) && stood(in);
    if (stands && !pilot_flies(in)) keep_ordering(AutopilotOrder::disarm, in, c);
  } else if (!in.platform_ready) {
    missing = "there is no platform odometry";
  } else if (!config_.start_on_floor &&
             (!in.estimate_valid || unseen(in) > kFreshSight)) {
    missing =
        in.blindness == Blindness::leds ? kUnseenOnPad : words_for(in.blindness).lost;
  } else if (!config_.start_on_floor && !stood(in)) {
    missing = "the drone does not stand on the pad";
  } else if (in.link->stalled(in.now, kCalmLink)) {
    missing = kLinkStalls;
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

bool Mission::at_gear_height(const MissionInput& in, double slack) const {
  return std::abs(in.x_seen.p_NB.z() - gear_height_) < slack * kFeetDown;
}

// A start that failed may have thrown it over or off the pad.
bool Mission::stood(const MissionInput& in) {
  const RelativeState& x = in.x_seen;
  const double slack = starts_ == 0 ? kBeforeTheFirst : 1;
  const bool stands = at_gear_height(in, slack) &&
                      off_middle(x.p_NB) < pad_half_ + (slack - 1) * kFeetDown &&
                      angle_between(Vector3(x.R_NB.col(2)), Vector3(Vector3::UnitZ())) <
                          slack * kLevelDeg * kDegree &&
                      (starts_ == 0 || x.v_NB.norm() < kStill);
  if (!stands) stood_since_ = in.now;
  return to_seconds(in.now - stood_since_) >= kStoodFor;
}

void Mission::armed(const MissionInput& in, Command& c, Output& out) {
  if (in.estimate_valid) {
    p_rest_ = in.x_seen.p_NB;
    R_rest_ = in.x_seen.R_NB;
  }
  c.mode = Command::Mode::idle;
  if (abort_wanted_) {
    stop_motors(in, c);
    go(MissionState::refused, "the operator aborted before the start", in, out);
  } else if (hold_wanted_) {
    stop_motors(in, c);
    go(MissionState::idle, "the operator holds", in, out);
  } else if (!config_.start_on_floor && in.estimate_valid && !at_gear_height(in, 1) &&
             !pilot_flies(in)) {
    // By now the rig has been measured by how it stands, if that could be done. Coming
    // back it would meet the pad still sinking, or end above it.
    stop_motors(in, c);
    go(MissionState::refused, kOffItsFeet, in, out);
  } else if (in.armed && in.link->healthy(in.now)) {
    ++starts_;
    coming_down_ = false;
    ramp_most_ = config_.ramp_from;
    blind_climb_.begin({config_.ramp_from, config_.blind_ramp_rate,
                        config_.blind_ramp_to, config_.blind_climb_m_s},
                       in.now);
    go(MissionState::taken_off, "armed: taking off", in, out);
  } else if (in_state(in) > config_.arm_timeout_s) {
    stop_motors(in, c);
    go(MissionState::refused,
       in.link->healthy(in.now) ? "the autopilot does not arm" : kUnhealthy, in, out);
  } else {
    if (keep_ordering(AutopilotOrder::arm, in, c)) arm_told_ = in.now;
  }
}

void Mission::taken_off(const MissionInput& in, Command& c, Output& out) {
  const bool fresh = in_sight(in);
  if (airborne_ && fresh) highest_ = std::max(highest_, in.x_seen.p_NB.z());
  if (lost_as_it_lifts(in)) {
    airborne_ = false;  // It has shown what thrust makes of it in no picture yet.
    come_down(false, in);
  }
  if (airborne_) {
    if (overruled(in, out)) return;
    c.mode = Command::Mode::track;
    if (still_stands(in)) {
      c.ramp_share = share_lifted_;
      lift(false, 0, in, c, out);
    }
    const bool slept = in.woke > climbs_since_ && in.seen > in.woke;
    if (slept || (failsafe_ && fresh)) {
      // Meanwhile its autopilot sank, over a pad that drove on. Behind that it climbs
      // where it comes to rest, lest it meet the edge.
      climbs_since_ = in.now;
      Vector3 up = above_pad();
      const Vector3 rests = in.x.p_NB + kComesToRest * in.x.v_NB;
      if ((rests - up).dot(from_lens_) > 0) up.head<2>() = rests.head<2>();
      move_from_here(up, climb(), in);
    }
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
  const double share = ramp_share(in);
  if (obeyed_ &&
      (in.mode == AutopilotMode::failsafe || in.mode == AutopilotMode::land)) {
    taken_over_on_ramp(share, in, c, out);
    return;
  }
  c.mode = Command::Mode::ramp;
  c.ramp_share = std::min(share, config_.ramp_to);
  const Seconds limit =
      config_.start_on_floor ? blind_for_at_most() : config_.ramp_timeout_s;
  // Unseen, it would climb and climb. It may be off the ground by a few centimetres:
  // with less thrust than carries it, it comes down softly.
  const bool stale =
      misses_pictures(in) || (in.picture_repeats && c.ramp_share > kMovesIt);
  const bool unheard = !in.link->healthy(in.now);
  if (!config_.start_on_floor && !coming_down_ && (stale || unheard)) {
    come_down(!stale, in);
  }
  if (coming_down_) c.ramp_share = std::min(c.ramp_share, kComingDown);
  ramp_most_ = std::max(ramp_most_, c.ramp_share);
  const Vector3 way = in.x_seen.p_NB - p_rest_;
  const double tipped =
      angle_between(Vector3(in.x_seen.R_NB.col(2)), Vector3(R_rest_.col(2)));
  // Tipping over a foot lifts the middle, too.
  const double rise = way.z() - arm_ * std::sin(tipped);
  // With little weight on its feet the wind pushes it along the pad.
  const bool stands = !stale && rise < kStands;
  const bool blind =
      coming_down_ &&
      (stands || to_seconds(in.now - coming_down_since_) > kComingDownFor);
  const bool given_up = abort_wanted_ || blind || in.link->lost(in.now) || !in.armed ||
                        in_state(in) > limit;
  if (given_up && slept_unseen(in)) {
    c.mode = Command::Mode::silent;
    if (to_seconds(in.now - in.woke) < kFirstPicture) return;
    airborne_ = true;  // for all that is known
    go(MissionState::aborted, kStoodStill, in, out);
    left_ = true;
    return;
  }
  if (given_up) {
    stop_motors(in, c);
    if (config_.start_on_floor) {
      // It may fly unseen: only the autopilot can bring it down.
      c.order = AutopilotOrder::land;
      disarms_ = false;
      airborne_ = true;
    }
    const char* reason = !config_.start_on_floor ? "did not leave the ground"
                         : in.link->lost(in.now) ? kUnheard
                         : in.blindness == Blindness::leds
                             ? "the LEDs never came into sight: the autopilot lands"
                             : words_for(in.blindness).given_up;
    if (blind) reason = for_the_link_ ? kUnhealthy : words_for(in.blindness).lost;
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
  const bool rose = rise > config_.lift_m;
  // Light on its feet it slides and tips before it flies; thrust must go on growing, or
  // it stays there. The sooner a slide is answered the less the wind makes of it.
  const bool slides = horizontal(way) > kStandNoise && share > kMaySlide &&
                      horizontal(in.x_seen.v_NB) > config_.slip_m_s;
  const bool slipped = slides || horizontal(way) > config_.slip_m ||
                       tipped > config_.slip_tilt_deg * kDegree;
  const bool flies = config_.start_on_floor ? left_floor(in) : rose || slipped;
  const bool lifted = fresh && !coming_down_ && flies;
  if (!lifted) return;
  lift(rose, std::max(rise - kStandNoise, 0.0), in, c, out);
}

// Meanwhile it may have been thrown off the pad, or flown by its autopilot: motors that
// are stopped on what was known before may carry it in the air.
bool Mission::slept_unseen(const MissionInput& in) const {
  return in.woke > status_.since && in.seen < in.woke;
}

// Its autopilot acts by itself before it was seen to lift.
void Mission::taken_over_on_ramp(double share, const MissionInput& in, Command& c,
                                 Output& out) {
  const char* reason = in.computer_was_late ? kStoodStill : kFailsafe;
  // With what thrust was asked for at most, unless that has long been the
  // autopilot's.
  const Seconds unsure = to_seconds(in.now - obeyed_till_);
  const double most = unsure < kJustTookOver ? std::min(ramp_most_, share) : share;
  if (most < kStillStands && starts_ < config_.starts_max && !slept_unseen(in)) {
    stop_motors(in, c);
    go(MissionState::idle, reason, in, out);
    return;
  }
  // In sight and heard again it only waits for set-points. The first picture after
  // the stall is yet to come.
  if (in.computer_was_late && in.mode == AutopilotMode::failsafe &&
      in.link->healthy(in.now)) {
    if (in_sight(in)) {
      c.ramp_share = std::min(ramp_most_, share);
      lift(false, 0, in, c, out);
      return;
    }
    if (to_seconds(in.now - in.woke) < kFirstPicture) {
      c.mode = Command::Mode::silent;
      return;
    }
  }
  airborne_ = true;  // for all that is known
  go(MissionState::lost_link, reason, in, out);
}

void Mission::lift(bool carried, double flown, const MissionInput& in, Command& c,
                   Output& out) {
  airborne_ = true;
  lifted_at_ = climbs_since_ = in.now;
  highest_ = in.x_seen.p_NB.z();
  share_lifted_ = c.ramp_share;
  c.lifted = true;
  c.carried = carried;
  // Thrust grows evenly, so the rise goes with the third power of time.
  c.lifted_since =
      config_.start_on_floor ? 0 : std::cbrt(6 * flown / (ramp_rate(in) * kGravity));
  c.mode = Command::Mode::track;
  const FlatState from = as_it_flies(in.x);
  maneuver_ = Maneuver::stay(from.p_NB, from.yaw);
  if (config_.start_on_floor) {
    go(MissionState::follow, "in sight: to the follow point", in, out);
    return;
  }
  maneuver_ = Maneuver::move(PointToPoint(in.now, from, above_pad(), 0, climb()));
}

Vector3 Mission::above_pad() const {
  Vector3 up = p_rest_ + config_.take_off_back_m * from_lens_;
  up.z() = config_.take_off_height_m;
  return up;
}

MoveLimits Mission::climb() const {
  MoveLimits limits;
  limits.speed_m_s = config_.climb_speed_m_s;
  limits.acceleration_m_s2 = config_.move_acceleration_m_s2;
  return limits;
}

double Mission::ramp_share(const MissionInput& in) {
  if (!config_.start_on_floor) {
    return config_.ramp_from + ramp_rate(in) * in_state(in);
  }
  blind_climb_.told(in.told, in.climb);
  return blind_climb_.share(in.now, in.thrust_acts_in);
}

// Where the camera sees the floor the drone is in sight before it flies.
bool Mission::left_floor(const MissionInput& in) const {
  const double height = in.x_seen.p_NB.z() + above_floor_ - gear_height_;
  return blind_climb_.lifted() || height > kOffTheFloor;
}

Seconds Mission::blind_for_at_most() const {
  const double height = above_floor_ + std::max(0.0, config_.follow_point.z());
  return config_.blind_max_s + height / config_.blind_climb_m_s;
}

// Until lift-off is known and answered thrust goes on growing: over a late link it
// would throw the drone up, off to where the wind drives it, faster than it is seen.
double Mission::ramp_rate(const MissionInput& in) const {
  return config_.ramp_rate * std::min(1.0, kRampActsIn / std::max(in.acts_in, 1e-3));
}

void Mission::come_down(bool for_the_link, const MissionInput& in) {
  coming_down_ = true;
  for_the_link_ = for_the_link;
  coming_down_since_ = in.now;
}

bool Mission::lifts_off(const MissionInput& in) const {
  return status_.state == MissionState::taken_off && airborne_ &&
         !config_.start_on_floor && to_seconds(in.now - lifted_at_) <= kLeavesIn;
}

// While the computer stood still its autopilot set it down again, or it never left: the
// ground carries it, and thrust that is less than its weight moves nothing.
bool Mission::still_stands(const MissionInput& in) const {
  return !config_.start_on_floor && in.woke > lifted_at_ && in.seen > in.woke &&
         std::abs(in.x_seen.p_NB.z() - p_rest_.z()) <= kLeft &&
         off_middle(in.x_seen.p_NB) < pad_half_;
}

bool Mission::misses_pictures(const MissionInput& in) const {
  return unseen(in) > unseen_lifting_;
}

// No higher and no faster than what kComingDown brings down softly. One that was seen
// higher up flies, wherever images that were none of its LEDs have it by now.
bool Mission::lost_as_it_lifts(const MissionInput& in) const {
  return lifts_off(in) && misses_pictures(in) && in.z_acted - p_rest_.z() <= kLeft &&
         highest_ - p_rest_.z() <= kSurelyFlies && in.x.v_NB.z() <= kHardlyRises;
}

// What thrust makes of it is known once it is seen: a drone heavier than the rig says
// is told to rise while it slides in the wind, and would slide on with less thrust.
bool Mission::leaves_ground(const MissionInput& in) const {
  // Leaning, its lower feet stay there longer.
  const double leans =
      angle_between(Vector3(in.x.R_NB.col(2)), Vector3(R_rest_.col(2)));
  const double least = p_rest_.z() + arm_ * std::sin(leans);
  const bool seen_low = !misses_pictures(in) && in.x_seen.p_NB.z() - least <= kLeftSeen;
  return lifts_off(in) && (in.z_acted - least <= kLeft || seen_low);
}

// Light on its feet it may still stand when it is seen to slide: what the ground
// carries is no wind from below. (To limit its tilt has it slide off in a wind.) What
// is on its way to it counts: waiting to see all of its rise throws it up.
void Mission::leave_ground(const MissionInput& in, Command& c) const {
  if (leaves_ground(in)) {
    const Seconds since = to_seconds(in.now - lifted_at_);
    c.thrust_least =
        std::min(share_lifted_ + kStillGrows * ramp_rate(in) * since, config_.ramp_to);
  } else if (lifts_off(in) && in.z_acted - p_rest_.z() < kNearGround) {
    c.thrust_least = kKeepsUp;
  }
}

}  // namespace alight
