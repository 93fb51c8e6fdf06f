#include "alight/mission/touch_down.h"

#include <algorithm>
#include <cmath>

#include "alight/mission/mission_common.h"

namespace alight {
namespace {

// m within touch_settled_s: a third of what a landing sinks in that time; and what it
// moves along the pad when it slides faster than its feet forgive.
constexpr double kStillSinking = 0.005;
constexpr double kStillSliding = 0.008;
// m above gear height, an LED rig's error; m/s.
constexpr double kTouchHighest = 0.1;
constexpr double kStanding = 0.05;
// m from where the feet took the weight: more than the error of a standing drone's
// pose.
constexpr double kBounce = 0.03;
constexpr double kSlide = 0.03;
constexpr double kFootSpread = 0.7;  // of the feet from the middle, of the arm
// At least so far ahead of now control looks at the reference.
constexpr Seconds kControlAhead = 0.25;

// Height above the feet's at which thrust goes, m: dropped too soon the drone falls
// hard, and too late it is blown off. In calm air it may rather be late.
constexpr double kDropCalm = -0.02;
constexpr double kDropPerPush = 0.008;  // and more by this per m/s^2 of lean,
constexpr double kDropMost = 0.005;     // at most. Falls of 5 mm are harmless.
constexpr double kDropSeen = 0.06;      // From no higher than this, by what is seen.
// A gust that presses it down has it touch before its reference does. No higher than
// this, m, and not sinking for so long, s, it is carried; at full thrust it would
// slide.
constexpr double kCarried = 0.012;
constexpr Seconds kCarriedFor = 0.08;

// Set down by its autopilot it rests, m/s: what slides trips once its motors stop.
constexpr double kAtRest = 0.1;
constexpr double kRestsLevelDeg = 7;  // with the pad; on two of its feet it falls over

constexpr Seconds kFlareIsSet = 0.4;  // before the end,
constexpr double kWaits = 0.1;        // unless it waits: at a pace below this
// m/s^2; a wider swing takes longer, that its jerk grows by as much as itself only.
constexpr double kFlareWide = 1.5;
// A strong push is leant against down to the pad, but for so much, m/s^2: set-points
// are lost for 0.3 s now and then, and a drone that was told to be upright before is
// blown off as long, and trips over its feet. From what push on, and how much more with
// each m/s^2 of it; a deck that swings presses otherwise soon:
constexpr double kLeansFrom = 1.3, kLeansMore = 2, kLeansLess = 0.5;
// When the feet come down is not known better than this, s. Upright for as long it
// gains speed, m/s, at most:
constexpr Seconds kUprightFor = 0.03;
constexpr double kFlareGains = 0.045;
constexpr Seconds kFlareEarly = 0.1;  // at most, for a foot that is lower
// The flare waits for a drone that is above its reference, s, and hurries before.
constexpr Seconds kFlareEarliest = -0.1, kFlareLatest = 0.35;
constexpr double kFlareSlew = 0.8;    // s/s: the reference does not jump.
constexpr Seconds kFlareStep = 0.01;  // between the brain's steps
// While its rotors run down a push slides it over the pad: a stronger one than this,
// m/s^2, by so many m per m/s^2 more. (In 130 landings 3.5 slid it by 3.0 cm with 0.9
// of sd, 1.6 by 5 mm, 0.9 by 2.) It touches as far ahead of the middle, at most:
constexpr double kSlidesFrom = 1.3, kSlidesPerPush = 0.0136, kAheadMost = 0.05;
constexpr double kSquareUpWithin =
    0.05;                            // m, of a miss; by half as much at 1.5 times it
constexpr double kSinkLeast = 0.05;  // m/s, of a drone that comes down
// m/s, or there is nothing to wait for; unless it is still so high above its feet, m:
// held up by a gust, or by what is left of a step back up to its reference.
constexpr double kSinking = 0.05, kStillFlies = 0.02;
// s; of how much faster than its reference it climbs or sinks so much will last.
constexpr Seconds kFlareLead = 0.25;
// Held down by the last thrust for so much longer, s, it will not get more upright.
constexpr Seconds kTiltedLonger = 0.15;
// Where it slides its feet would trip it: what is left of thrust keeps it upright, and
// weight on the feet. A radio that was silent as thrust was to go has it slide most.
constexpr double kUprightBy = 0.15;
constexpr Seconds kSlidesLonger = 0.35;
// Nothing heard of it for so long, s, it may not hear either.
constexpr Seconds kMayBeDeaf = 0.1;
// Heard again it has its thrust for so long, s, besides what is sent needs to act; and
// what is left of it takes as long to hold the drone where it slides.
constexpr Seconds kHeardAgain = 0.05, kSlidesOn = 0.15;
constexpr double kFootOver = 0.5;  // the edge, by this share of its way from the middle

/// By how much less it may lean than a push asks for, m/s^2, as it touches.
double leans_less(double push, double deck_swing) {
  const double from = kLeansFrom + deck_swing;
  const double more = std::max(push - from, 0.0);
  return std::max(std::min(push, from) - kLeansMore * more, kLeansLess);
}

}  // namespace

TouchDown::TouchDown(const MissionConfig& config, const Rig& rig)
    : config_(config),
      gear_height_(rig.drone.gear_height_m),
      arm_(rig.drone.arm_m),
      pad_half_(0.5 * rig.pad.size_m) {}

void TouchDown::begin() {
  flared_ = squares_up_ = settling_ = low_ = false;
  bounced_ = slid_ = false;
  deaf_ = 0;
}

Seconds TouchDown::begins_before_end() const {
  return flare_lasts(config_.flare_max_m_s2) + kFlareEarly + kUprightFor +
         kControlAhead;
}

double TouchDown::flare_most(const MissionInput& in) const {
  const double push = horizontal(in.f_touch_N);
  return std::min({config_.flare_share * push, config_.flare_max_m_s2,
                   leans_less(push, in.deck_swing)});
}

Seconds TouchDown::flare_lasts(double a) const {
  return config_.flare_s * std::sqrt(std::max(a / kFlareWide, 1.0));
}

void TouchDown::flare(const MissionInput& in, Maneuver& maneuver) {
  if (config_.flare_s <= 0) return;
  const double sink = std::max(-maneuver.end().v_NB.z(), 0.1);
  const Seconds to_end = -maneuver.past_end(in.now);
  // Wind and turns change while it waits above the pad.
  const bool open = to_end > kFlareIsSet || maneuver.rate(in.now) < kWaits;
  if (flared_ ? open : to_end <= begins_before_end()) {
    flared_ = true;
    // Upright on the pad, whatever wind and turns would have it lean, as far as may be.
    Vector3 a_N = -config_.flare_share * in.f_touch_N;
    a_N.z() = 0;
    const double a = flare_most(in);
    a_N = a * a_N.stableNormalized();
    const double left = horizontal(in.f_touch_N + a_N) / kGravity;
    const Seconds lower = std::min(foot_spread() * left / sink, kFlareEarly);
    const Seconds unsure = std::min(kUprightFor, kFlareGains / std::max(a, 0.1));
    Vector3 ahead_N = in.f_touch_N;
    ahead_N.z() = 0;
    const double more = std::max(ahead_N.norm() - kSlidesFrom, 0.0);
    ahead_N = std::min(kSlidesPerPush * more, kAheadMost) * ahead_N.stableNormalized();
    maneuver.end_with(Flare(a_N, flare_lasts(a), lower + unsure, ahead_N));
  }
  const bool flies = in.x.p_NB.z() > gear_height_ + kStillFlies;
  if (flared_ && (-in.x.v_NB.z() > kSinking || flies)) {
    const FlatState ref = maneuver.at(in.now);
    const double above =
        in.x.p_NB.z() - ref.p_NB.z() + kFlareLead * (in.x.v_NB.z() - ref.v_NB.z());
    const Seconds late = std::clamp(above / sink, kFlareEarliest, kFlareLatest);
    const Seconds step =
        kFlareSlew * std::clamp(to_seconds(in.now - flare_aimed_), 0.0, kFlareStep);
    const Seconds was = maneuver.flare_delay();
    maneuver.delay_flare(was + std::clamp(late - was, -step, step));
  }
  flare_aimed_ = in.now;
}

bool TouchDown::may_touch(const MissionInput& in, const Maneuver& maneuver) const {
  // Past the commit height there is no way back: unseen, it trusts the prediction.
  if (unseen(in) > config_.sight_lost_s) {
    return maneuver.past_end(in.now) > config_.blind_sink_s;
  }
  const double above = in.x_seen.p_NB.z() - gear_height_;
  const double push = horizontal(in.f_touch_N);
  const double drop = std::min(kDropCalm + kDropPerPush * push, kDropMost);
  if (in_sight(in) && above < kDropSeen && in.z_acted < gear_height_ + drop) {
    return true;
  }
  if (maneuver.at(in.now).p_NB.z() > gear_height_) return false;
  if (above < config_.touch_height_m) return true;
  // Pushed down for a while it does not sink: something carries it, and the rig is not
  // quite what the file says.
  return maneuver.past_end(in.now) > config_.blind_sink_s && above < kTouchHighest &&
         std::abs(in.x.v_NB.z()) < kStanding;
}

double TouchDown::foot_spread() const { return kFootSpread * arm_; }

Seconds TouchDown::touches_within(const MissionInput& in) const {
  const double sink = std::max(-in.x.v_NB.z(), kSinkLeast);
  return std::clamp((in.x.p_NB.z() - gear_height_) / sink, 0.0, kTouchAhead);
}

double TouchDown::square_up(const MissionInput& in, double miss) {
  if (config_.square_up_s <= 0 || !in_sight(in)) return 0;
  const double share =
      std::clamp(2 * (1 - touches_within(in) / config_.square_up_s), 0.0, 1.0);
  if (share <= 0) return 0;
  if (!squares_up_) {
    squares_up_ = true;
    // Once: it drifts for squaring up, too.
    square_up_most_ = std::clamp(2 - miss / kSquareUpWithin, 0.0, 1.0);
  }
  const double push = horizontal(in.f_touch_N);
  const double flared = flare_most(in);
  const double leans = push - flared;
  const double gives = leans_less(push, in.deck_swing) - flared;
  const double most = leans > gives ? gives / leans : 1.0;
  return std::min({share, square_up_most_, most});
}

Seconds TouchDown::still_for(const MissionInput& in) {
  const Vector3& p = in.x_seen.p_NB;
  const bool sank = p.z() < low_p_.z() - kStillSinking;
  // Its motors stopped while it slides, a drone trips over its own feet.
  const bool slid = settling_ && horizontal(p - low_p_) > kStillSliding;
  if (!low_ || sank || slid) {
    low_ = true;
    low_since_ = in.now;
    low_p_ = p;
  }
  return to_seconds(in.now - low_since_);
}

bool TouchDown::carried(const MissionInput& in) {
  if (!in_sight(in) || in.x_seen.p_NB.z() > gear_height_ + kCarried) {
    low_ = false;
    return false;
  }
  return still_for(in) >= kCarriedFor;
}

void TouchDown::feel(const MissionInput& in, const Maneuver& maneuver) {
  if (settling_) return;
  if (!carried(in) && !may_touch(in, maneuver)) return;
  settling_ = true;
  settle_since_ = in.now;
  p_touch_ = in.x_seen.p_NB;
  f_touch_N_ = in.f_touch_N;
  low_ = false;
}

double TouchDown::thrust_share(Time now) const {
  const double passed = to_seconds(now - settle_since_) / config_.settle_down_s;
  return std::max(config_.settle_share * (1 - passed), kUprightBy);
}

bool TouchDown::was_set_down(const MissionInput& in) {
  const RelativeState& x = in.x_seen;
  const double reach = off_middle(x.p_NB) + foot_spread();
  const bool level = x.R_NB(2, 2) > std::cos(kRestsLevelDeg * kDegree);
  if (!carried(in) || reach > pad_half_ || x.v_NB.norm() > kAtRest || !level) {
    return false;
  }
  p_touch_ = x.p_NB;
  return true;
}

bool TouchDown::slides_off(const MissionInput& in) {
  deaf_ = std::max(deaf_, in.woke);
  if (in.link->silence(in.now) > kMayBeDeaf) {
    deaf_ = in.now;
    return false;
  }
  if (deaf_ == 0 || to_seconds(in.now - deaf_) > kHeardAgain || !in_sight(in)) {
    return false;
  }
  const RelativeState& x = in.x_seen;
  const Vector3 soon = x.p_NB + (in.acts_in + kSlidesOn) * x.v_NB;
  return off_middle(soon) > pad_half_ - kFootOver * foot_spread();
}

bool TouchDown::stands(const MissionInput& in) {
  if (!settling_) return false;
  const Seconds settling = to_seconds(in.now - settle_since_);
  if (unseen(in) > config_.sight_lost_s) return settling >= config_.settle_down_s;
  // Seen before its thrust went, it may have been held up by that.
  const bool early = to_seconds(in.seen - settle_since_) < in.acts_in;
  if (early || in.link->silence(in.now) > kMayBeDeaf) low_ = false;
  const Seconds still = still_for(in);
  const bool upright = in.x.R_NB(2, 2) > std::cos(config_.upright_deg * kDegree);
  const Seconds over = settling - config_.settle_down_s;
  if (still < config_.touch_settled_s) return over >= kSlidesLonger;
  return upright || over >= kTiltedLonger;
}

const char* TouchDown::moved(const MissionInput& in) {
  if (!in_sight(in)) return nullptr;
  const Vector3 way = in.x_seen.p_NB - p_touch_;
  if (!bounced_ && way.z() > kBounce) {
    bounced_ = true;
    return "it bounced";
  }
  if (!slid_ && horizontal(way) > kSlide) {
    slid_ = true;
    return "it slides on the pad";
  }
  return nullptr;
}

const char* TouchDown::how_it_stands(const MissionInput& in) const {
  // The middle between the feet is at the origin of B to within the LED frame's error.
  const double off = off_middle(in.x_seen.p_NB);
  if (in_sight(in) && off >= pad_half_) return "motors stopped, not on the pad";
  if (in_sight(in) && off + foot_spread() > pad_half_) {
    return "motors stopped, a foot over the pad's edge";
  }
  if (slid_) return "motors stopped, after a slide";
  return bounced_ ? "motors stopped, after a bounce" : "motors stopped";
}

}  // namespace alight
