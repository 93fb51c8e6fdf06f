#pragma once
#include <cstdint>
#include <deque>
#include <optional>
#include <variant>

#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/sensor_events.h"
#include "alight/sim/scenario.h"

namespace alight {

struct Ping {
  Time sent = 0;
};
struct Pong {
  Time ping_sent = 0;
};
using RadioMessage = std::variant<Setpoint, ExternalPose, AutopilotOrder, Ping,
                                  AutopilotTelemetry, Pong>;
enum class RadioEnd : std::uint8_t { drone, ground };

/// A packet radio as telemetry links are: one first-in first-out channel for both
/// directions. Latency wanders (its sd is the jitter, correlated over 50 ms); losses
/// come in bursts of 40 ms in the mean (Gilbert 1960, Elliott 1963, in continuous
/// time); now and then everything stalls and is let go in a clump, of which only what
/// fits the queue is left: the newest of its kind displaces the oldest.
class Radio {
 public:
  struct Arrival {
    RadioMessage message;
    Time sent = 0;
    Time received = 0;
  };

  Radio(const RadioScenario& config, Rng rng);

  /// `dead`: the air carries nothing now. @pre now does not run backwards.
  void send(const RadioMessage& message, RadioEnd to, Time now, bool dead = false);

  /// The next message that has reached `end` by `now`, oldest first.
  std::optional<Arrival> receive(RadioEnd end, Time now);

  /// Nothing arrives before `until`, sent or yet to be sent.
  void hold(Time until);

  /// Loses everything under way.
  void clear() { queue_.clear(); }

 private:
  struct Packet {
    Arrival arrival;
    RadioEnd to;
  };
  void advance(Time now);

  RadioScenario config_;
  Rng rng_;
  std::deque<Packet> queue_;
  Time now_ = 0;
  Time last_arrival_ = 0;
  double wander_ = 0;  ///< Latency beside its mean, in sd.
  bool bad_ = false;   ///< Within a burst of losses
  Time until_ = 0;     ///< or between two: till then.
  Time stall_begin_ = 0;
  Time stall_end_ = 0;
  Time held_until_ = 0;
};

}  // namespace alight
