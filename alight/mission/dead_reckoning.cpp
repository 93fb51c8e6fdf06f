#include "alight/mission/dead_reckoning.h"

namespace alight {
namespace {

// Of the newest difference, at 50 reports a second: what is off changes within seconds,
// the noise of the velocity within tenths.
constexpr double kNewest = 0.05;
// m/s; what differs by more is no estimate of this drone's speed in this frame: axes
// taken for others, an estimator that has just begun anew.
constexpr double kBelieved = 0.6;

}  // namespace

void DeadReckoning::forget() {
  known_ = false;
  off_.setZero();
  waiting_.clear();
}

void DeadReckoning::in_sight(const AutopilotTelemetry& told, const Vector3& seen_v_IB) {
  waiting_.clear();
  if (!told.v_IB.allFinite()) return;
  const Vector3 off = told.v_IB - seen_v_IB;
  if (!(off.norm() < kBelieved)) {
    known_ = false;
    return;
  }
  off_ += (known_ ? kNewest : 1) * (off - off_);
  known_ = true;
}

void DeadReckoning::out_of_sight(const AutopilotTelemetry& told) {
  if (!known_ || !told.v_IB.allFinite()) return;
  if (waiting_.full()) waiting_.erase(0);
  waiting_.push_back({told.captured, told.v_IB - off_});
}

bool DeadReckoning::next(Time until, Velocity& out) {
  if (waiting_.empty() || waiting_.front().captured > until) return false;
  out = waiting_.front();
  waiting_.erase(0);
  return true;
}

}  // namespace alight
