#pragma once
#include "alight/mission/maneuver.h"
#include "alight/mission/mission_config.h"
#include "alight/mission/mission_input.h"

namespace alight {

/// Over a deck that swings the drone waits, low, until it will be touched level and in
/// the middle. The longer it has waited, the less it asks for.
class QuietDeck {
 public:
  QuietDeck(const MissionConfig& config, const Rig& rig);

  /// A landing begins.
  void begin();
  /// The deck swings more than wind and turns have a drone lean: worth waiting for.
  bool swings(const MissionInput& in) const;
  /// When a landing that goes on now would touch, within what is foreseen of decks, s.
  Seconds touches_in(const MissionInput& in, const Maneuver& maneuver) const;
  /// Each step in which it could wait. `miss`: where it would touch, m off the middle;
  /// `may_stop`: it has not sunk too low to stop yet.
  bool waits(const MissionInput& in, const Maneuver& maneuver, double miss,
             bool may_stop);
  bool waiting() const { return waiting_; }

 private:
  double quiet_ = 0;  // rad
  Seconds quiet_more_ = 0;
  double miss_ = 0;  // m
  double gear_height_ = 0;
  bool waiting_ = false;
  Seconds waited_ = 0;
  Seconds last_lag_ = 0;
};

}  // namespace alight
