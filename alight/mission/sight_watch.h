#pragma once
#include <cstdint>

#include "alight/base/time.h"

namespace alight {

/// Why the LEDs have not been seen of late, as far as the brain can tell.
enum class Blindness : std::uint8_t {
  leds,      ///< Pictures come in time, the LEDs are not found in them.
  pictures,  ///< None come.
  late,      ///< They come too late to be of use.
  frozen,    ///< The camera repeats its last one.
  computer,  ///< The brain itself was not run.
  odometry   ///< As leds, but how the platform moves is not known either.
};
const char* to_string(Blindness why);

/// No new pictures come in which the LEDs might be seen.
bool dark(Blindness why);

/// What is said of it; static text.
struct BlindnessWords {
  const char* lost;      ///< When sight is lost.
  const char* given_up;  ///< When the search ends.
};
BlindnessWords words_for(Blindness why);

/// Watches how pictures arrive and whether the brain is run, to tell why sight is lost.
class SightWatch {
 public:
  /// `lateness_s`: from mid-exposure to reception when all is well.
  explicit SightWatch(Seconds lateness_s = 0.03) : lateness_(lateness_s) {}

  /// One that is not newer than the last says nothing.
  void picture(Time captured, Time received);
  /// Every step, before its pictures; `frozen`: what the estimator thinks of the last.
  void step(Time now);
  void frozen(bool on) { frozen_ = on; }

  Blindness why(Time now) const;
  /// The brain has not been run for a while, just before or a moment ago.
  bool computer_was_late(Time now) const;
  /// When it was run again after the last such gap; 0: there was none.
  Time woke() const { return stalled_ ? stalled_until_ : 0; }

 private:
  Seconds lateness_;
  Time last_step_ = 0;
  Time stalled_until_ = 0;
  Time captured_ = 0, received_ = 0;  // of the newest picture
  bool any_ = false, stepped_ = false, stalled_ = false, frozen_ = false;
};

}  // namespace alight
