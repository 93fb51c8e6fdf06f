#pragma once
#include <array>
#include <cstddef>

#include "alight/base/time.h"

namespace alight {

/// Thrust for a drone that nobody sees yet, so that it climbs at one speed: from the
/// floor beside the platform, until it comes into the picture.
///
/// What thrust carries it is not known (mass, battery, ground effect), and a few
/// percent more have it come into sight at 2 m/s, too fast to be stopped before it
/// leaves the picture above. Its autopilot tells its climb, from barometer and
/// accelerometers, which need no pose (MAVLink: VFR_HUD.climb). By that an observer of
/// climb and hovering thrust is corrected, and carried on over the thrust that was sent
/// and does not act yet (Smith 1957). Told nothing, thrust only grows. No clock, no
/// allocation.
class BlindClimb {
 public:
  struct Config {
    double from = 0.7;       ///< Thrust to begin with, share of the nominal hover,
    double rate = 1.1;       ///< its growth until it lifts, 1/s,
    double to = 1.35;        ///< and its most.
    double speed_m_s = 0.8;  ///< To climb at.
  };

  void begin(const Config& config, Time now);

  /// Told to climb by `climb` m/s, captured at `t`. NaN, and what is older than the
  /// last, changes nothing.
  void told(Time t, double climb);

  /// What to send now, which acts `acts_in` s later; in steps of time that grows.
  double share(Time now, Seconds acts_in);

  /// It tells that it climbs.
  bool lifted() const { return lifted_; }
  /// m above where it stood, as told.
  double height_m() const { return height_; }

 private:
  struct Sent {
    Time acts = 0;
    double share = 0;
  };
  static constexpr std::size_t kMost = 256;

  double in_force(Time t) const;
  /// Climb at `until`, of `v` at `from`, by what was sent.
  double carried(double v, Time from, Time until) const;

  Config config_;
  Time last_ = 0;     // step,
  double share_ = 0;  // and what it sent
  std::array<Sent, kMost> sent_{};
  std::size_t count_ = 0;
  Time told_ = 0;  // 0: not yet
  bool lifted_ = false;
  double v_ = 0;       // m/s at told_
  double smooth_ = 0;  // likewise, as told alone
  double hover_ = 1;   // the share that carries it
  double height_ = 0;
};

}  // namespace alight
