#pragma once
#include <algorithm>

#include "alight/geometry/sensor_events.h"
#include "alight/geometry/so3.h"

namespace alight {

struct LinkMonitorConfig {
  double delay_ms = 40;                ///< One way, until it has been measured.
  double delay_max_ms = 150;           ///< Longer measurements count as this.
  double smoothing = 0.1;              ///< Share of the newest measurement.
  double tilt_shrinks_after_s = 0.2;   ///< Silence after which the tilt that may be
  double tilt_smallest_after_s = 0.5;  ///< commanded shrinks, and when it is smallest,
  double tilt_smallest_deg = 3;        ///< so that what is held then does little harm.
  double lost_after_s = 1.0;
  double stall_s = 0.35;  ///< A silence in which an autopilot gives set-points up
                          ///< (PX4: COM_OF_LOSS_T, 0.3 s or less).
};

/// How late and how alive the radio is, from what comes back over it.
class LinkMonitor {
 public:
  explicit LinkMonitor(const LinkMonitorConfig& config = {})
      : config_(config), delay_ms_(config.delay_ms) {}

  void add(const LinkStatus& status) {
    if (status.round_trip_ms > 0) {
      const double one_way = std::min(0.5 * status.round_trip_ms, config_.delay_max_ms);
      delay_ms_ += config_.smoothing * (one_way - delay_ms_);
    }
    heard(status.last_answer);
  }
  /// Anything that came from the drone.
  void heard(Time t) {
    if (ever_ && to_seconds(t - last_heard_) > config_.stall_s) {
      stall_before_ = last_stall_;
      last_stall_ = t;
    }
    last_heard_ = std::max(last_heard_, t);
    ever_ = true;
  }

  bool ever_heard() const { return ever_; }
  Seconds silence(Time now) const {
    return ever_ ? to_seconds(now - last_heard_) : 1e9;
  }
  bool lost(Time now) const { return silence(now) > config_.lost_after_s; }
  bool healthy(Time now) const { return silence(now) < config_.tilt_shrinks_after_s; }
  /// A stall has ended within the last so many seconds.
  bool stalled(Time now, Seconds within) const {
    return lies(last_stall_, now, within);
  }
  /// More than one has.
  bool stalls_often(Time now, Seconds within) const {
    return lies(stall_before_, now, within);
  }
  double delay_ms() const { return delay_ms_; }
  Time delay() const { return from_seconds(delay_ms_ * 1e-3); }

  /// Largest tilt that may be commanded now, rad.
  double tilt_limit(Time now, double tilt_max) const {
    const double share =
        std::clamp((silence(now) - config_.tilt_shrinks_after_s) /
                       (config_.tilt_smallest_after_s - config_.tilt_shrinks_after_s),
                   0.0, 1.0);
    const double smallest = std::min(tilt_max, config_.tilt_smallest_deg * kDegree);
    return tilt_max + share * (smallest - tilt_max);
  }

 private:
  static bool lies(Time stall, Time now, Seconds within) {
    return stall != 0 && to_seconds(now - stall) < within;
  }

  LinkMonitorConfig config_;
  double delay_ms_;
  Time last_heard_ = 0;
  Time last_stall_ = 0, stall_before_ = 0;  // when they ended; 0: none
  bool ever_ = false;
};

}  // namespace alight
