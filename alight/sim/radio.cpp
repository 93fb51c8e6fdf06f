#include "alight/sim/radio.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kWanderTau = 0.05;   // s
constexpr double kLossBurst = 0.04;   // s, mean
constexpr double kStallsEvery = 1.0;  // s, mean from one stall's end to the next
constexpr double kShortest = 0.25;    // of the mean latency

double exponential(Rng& rng, double mean) {
  return -mean * std::log(1 - rng.uniform());
}

}  // namespace

Radio::Radio(const RadioScenario& config, Rng rng) : config_(config), rng_(rng) {
  wander_ = rng_.normal();
  bad_ = rng_.chance(config_.loss);
  until_ = 0;
  if (config_.burst_ms > 0) {
    stall_begin_ = from_seconds(exponential(rng_, kStallsEvery));
    stall_end_ = stall_begin_ + from_seconds(config_.burst_ms * 1e-3);
  }
}

void Radio::advance(Time now) {
  const double dt = to_seconds(now - now_);
  now_ = now;
  if (dt > 0) {
    const double keep = std::exp(-dt / kWanderTau);
    wander_ = keep * wander_ + std::sqrt(1 - keep * keep) * rng_.normal();
  }
  if (config_.loss >= 1) {
    bad_ = true;
  } else if (config_.loss > 0) {
    const double good = kLossBurst * (1 - config_.loss) / config_.loss;
    while (until_ <= now) {
      if (until_ > 0) bad_ = !bad_;
      until_ +=
          std::max<Time>(1, from_seconds(exponential(rng_, bad_ ? kLossBurst : good)));
    }
  }
  while (config_.burst_ms > 0 && stall_end_ <= now) {
    stall_begin_ = stall_end_ + from_seconds(exponential(rng_, kStallsEvery));
    stall_end_ = stall_begin_ + from_seconds(config_.burst_ms * 1e-3);
  }
}

void Radio::send(const RadioMessage& message, RadioEnd to, Time now, bool dead) {
  advance(now);
  if (bad_ || dead) return;
  const double mean = config_.latency_ms * 1e-3;
  const double delay =
      std::max(kShortest * mean, mean + config_.jitter_ms * 1e-3 * wander_);
  Time arrives = std::max(now + from_seconds(delay), last_arrival_);
  if (config_.burst_ms > 0 && arrives > stall_begin_) {
    arrives = std::max(arrives, stall_end_);
  }
  arrives = std::max(arrives, held_until_);
  if (queue_.size() >= static_cast<std::size_t>(config_.queue)) {
    auto victim = std::find_if(queue_.begin(), queue_.end(), [&](const Packet& p) {
      return p.arrival.message.index() == message.index() && p.to == to;
    });
    queue_.erase(victim == queue_.end() ? queue_.begin() : victim);
  }
  queue_.push_back({{message, now, arrives}, to});
  last_arrival_ = arrives;
}

void Radio::hold(Time until) {
  held_until_ = std::max(held_until_, until);
  for (Packet& packet : queue_) {
    packet.arrival.received = std::max(packet.arrival.received, held_until_);
  }
}

std::optional<Radio::Arrival> Radio::receive(RadioEnd end, Time now) {
  const auto next = std::find_if(queue_.begin(), queue_.end(),
                                 [&](const Packet& p) { return p.to == end; });
  if (next == queue_.end() || next->arrival.received > now) return std::nullopt;
  const Arrival arrival = next->arrival;
  queue_.erase(next);
  return arrival;
}

}  // namespace alight
