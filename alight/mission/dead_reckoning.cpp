#include "alight/mission/dead_reckoning.h"

namespace alight {
namespace {

// Of the newest difference, at 50 reports a second: what is off changes within seconds,
// the noise of the velocity within tenths.
constexpr double kNewest = 0.05;
// m/s; what differs by more is no estimate of this drone's speed in this frame: axes
// taken for others, an estimator that has just begun anew.
constexpr double kBelieved = 0.6;
// Until it has lasted so long, the pictures may be what is wrong.
constexpr Seconds kMayBeWrong = 0.5;
// From one report to the next no drone's velocity changes by more than this, m/s, for
// the noise, and m/s^2. Those that lie farther apart, s, or are one, tell of no jump.
constexpr double kNoise = 0.15, kHardest = 10;
constexpr Seconds kApartMost = 0.1, kApartLeast = 0.005;

}  // namespace

void DeadReckoning::forget() {
  known_ = false;
  off_.setZero();
  waiting_.clear();
}

void DeadReckoning::in_sight(const Velocity& told, const Vector3& seen_v_IB) {
  waiting_.clear();
  if (!told.v_IB.allFinite()) return;
  last_ = told;
  const Vector3 off = told.v_IB - seen_v_IB;
  if (!(off.norm() < kBelieved)) {
    // Just before it is lost from sight, that may be what is wrong.
    known_ = known_ && to_seconds(told.captured - agreed_) < kMayBeWrong;
    return;
  }
  agreed_ = told.captured;
  off_ += (known_ ? kNewest : 1) * (off - off_);
  known_ = true;
}

void DeadReckoning::out_of_sight(const Velocity& told) {
  if (!known_ || !told.v_IB.allFinite()) return;
  watch_for_jump(told);
  if (waiting_.full()) waiting_.erase(0);
  waiting_.push_back({told.captured, told.v_IB - off_});
}

void DeadReckoning::watch_for_jump(const Velocity& told) {
  const Seconds apart = to_seconds(told.captured - last_.captured);
  const Vector3 jump = told.v_IB - last_.v_IB;
  last_ = told;
  if (apart < kApartLeast || apart > kApartMost) return;
  if (jump.norm() > kNoise + kHardest * apart) off_ += jump;
}

bool DeadReckoning::next(Time until, Velocity& out) {
  if (waiting_.empty() || waiting_.front().captured > until) return false;
  out = waiting_.front();
  waiting_.erase(0);
  return true;
}

}  // namespace alight
