#include "alight/mission/blind_climb.h"

#include <algorithm>
#include <cmath>

#include "alight/geometry/so3.h"

namespace alight {
namespace {

// m/s; more than a barometer tells of a drone that stands, mostly; and so slow, over
// this time, that it stands after all.
constexpr double kLifts = 0.3, kStands = 0.2;
constexpr Seconds kOver = 0.15;
// 1/s: how fast climb is steered, and how fast what is told is believed. Slower than
// what a radio of 100 ms leaves unknown.
constexpr double kSteers = 3, kBelieves = 5;
constexpr double kDamping = 0.8;
constexpr double kLightest = 0.6, kHeaviest = 1.35;  // of hover_
constexpr double kLeast = 0.8;  // Of what carries it: in a wind it needs its rotors.
constexpr Seconds kGap = 0.5;   // Longer, and its height is not known any more.

}  // namespace

void BlindClimb::begin(const Config& config, Time now) {
  *this = BlindClimb();
  config_ = config;
  share_ = config.from;
  last_ = now;
}

double BlindClimb::in_force(Time t) const {
  double share = config_.from;
  for (std::size_t k = count_ > kMost ? count_ - kMost : 0; k < count_; ++k) {
    const Sent& sent = sent_[k % kMost];
    if (sent.acts > t) break;
    share = sent.share;
  }
  return share;
}

double BlindClimb::carried(double v, Time from, Time until) const {
  double share = config_.from;
  for (std::size_t k = count_ > kMost ? count_ - kMost : 0; k <= count_; ++k) {
    const Time to = k < count_ ? std::min(sent_[k % kMost].acts, until) : until;
    if (to > from) {
      v += kGravity * (share / hover_ - 1) * to_seconds(to - from);
      from = to;
    }
    if (k < count_) share = sent_[k % kMost].share;
  }
  return v;
}

void BlindClimb::told(Time t, double climb) {
  if (!std::isfinite(climb) || t <= told_) return;
  const Seconds dt = told_ == 0 ? 0 : to_seconds(t - told_);
  if (!lifted_) {
    told_ = t;
    if (climb < kLifts) return;
    lifted_ = true;
    v_ = climb;
    smooth_ = climb;
    // While thrust grew evenly climb grew with the square of time.
    const Seconds since = std::sqrt(2 * climb / (kGravity * config_.rate));
    hover_ = std::clamp(in_force(t - from_seconds(since)), kLightest, kHeaviest);
    height_ = climb * since / 3;
    return;
  }
  v_ = carried(v_, told_, t);
  told_ = t;
  const Seconds counts = std::min(dt, 1 / (2 * kDamping * kBelieves));
  const double more = climb - v_;
  v_ += 2 * kDamping * kBelieves * counts * more;
  hover_ -= hover_ * kBelieves * kBelieves / kGravity * counts * more;
  hover_ = std::clamp(hover_, kLightest, kHeaviest);
  height_ += climb * std::min(dt, kGap);
  smooth_ += std::min(1.0, dt / kOver) * (climb - smooth_);
  lifted_ = smooth_ >= kStands;
}

double BlindClimb::share(Time now, Seconds acts_in) {
  const Time before = count_ == 0 ? now : sent_[(count_ - 1) % kMost].acts;
  const Time acts = std::max(before, now + from_seconds(acts_in));
  if (lifted_) {
    const double more = config_.speed_m_s - carried(v_, told_, acts);
    share_ = std::max(hover_ * (1 + kSteers * more / kGravity), kLeast * hover_);
  } else {
    share_ += config_.rate * to_seconds(now - last_);
  }
  share_ = std::min(share_, config_.to);
  last_ = now;
  sent_[count_++ % kMost] = {acts, share_};
  return share_;
}

}  // namespace alight
