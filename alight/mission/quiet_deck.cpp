#include "alight/mission/quiet_deck.h"

#include <algorithm>
#include <cmath>

#include "alight/platform/deck_motion.h"

namespace alight {
namespace {

// m/s^2 (sd), of a deck that rolls by 1.5 deg.
constexpr double kSwings = 0.26;
constexpr double kSinkLeast = 0.15;    // m/s, at the end of a landing
constexpr Seconds kStartsAgain = 0.3;  // that a descent from rest takes longer
constexpr Seconds kBegun = 1e-6;       // of lag: it has waited before
// What may have become worse since it went on: to stop again costs more.
constexpr double kWorse = 2 * kDegree;
constexpr double kMissWorse = 0.03;  // m

}  // namespace

QuietDeck::QuietDeck(const MissionConfig& config, const Rig& rig)
    : quiet_(config.quiet_deg * kDegree),
      quiet_more_(config.quiet_more_s),
      miss_(config.wait_error_m),
      gear_height_(rig.drone.gear_height_m) {}

void QuietDeck::begin() {
  waiting_ = false;
  waited_ = last_lag_ = 0;
}

bool QuietDeck::swings(const MissionInput& in) const {
  return quiet_ > 0 && in.deck_swing > kSwings;
}

Seconds QuietDeck::touches_in(const MissionInput& in, const Maneuver& maneuver) const {
  const double sink = std::max(-maneuver.end().v_NB.z(), kSinkLeast);
  const Seconds sinks = (in.x.p_NB.z() - gear_height_) / sink;
  const Seconds starts = (1 - maneuver.rate(in.now)) * kStartsAgain;
  return std::clamp(sinks + starts, kTouchAhead, DeckMotion::kFarthest);
}

bool QuietDeck::waits(const MissionInput& in, const Maneuver& maneuver, double miss,
                      bool may_stop) {
  const Seconds lag = maneuver.lag(in.now);
  if (waiting_) waited_ += lag - last_lag_;
  last_lag_ = lag;
  if (!waiting_ && !may_stop) return false;
  const double tired = 1 + waited_ / quiet_more_;
  const bool goes_on = !waiting_ && lag > kBegun;
  const double lean = std::atan2(in.f_end_N.head<2>().norm(), in.f_end_N.z());
  waiting_ = lean > quiet_ * tired + (goes_on ? kWorse : 0) ||
             miss > miss_ * tired + (goes_on ? kMissWorse : 0);
  return waiting_;
}

}  // namespace alight
