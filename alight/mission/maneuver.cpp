#include "alight/mission/maneuver.h"

#include <algorithm>
#include <cassert>

namespace alight {

Maneuver Maneuver::stay(const Vector3& p_NB, double yaw) {
  Maneuver m;
  m.rest_.p_NB = p_NB;
  m.rest_.yaw = yaw;
  return m;
}

Maneuver Maneuver::coast(const FlatState& from, Time start) {
  Maneuver m;
  m.kind_ = Kind::coast;
  m.rest_ = from;
  m.start_ = start;
  return m;
}

Maneuver Maneuver::move(const PointToPoint& move) {
  Maneuver m;
  m.kind_ = Kind::move;
  m.move_ = move;
  return m;
}

Maneuver Maneuver::landing(const Trajectory& trajectory, Time start, double sink_m) {
  Maneuver m;
  m.kind_ = Kind::landing;
  m.trajectory_ = trajectory;
  m.start_ = start;
  m.pace_ = Pace(start);
  m.sink_m_ = sink_m;
  return m;
}

FlatState Maneuver::at(Time t) const {
  switch (kind_) {
    case Kind::stay:
      return rest_;
    case Kind::coast: {
      FlatState state = rest_;
      const Seconds s = to_seconds(t - start_);
      state.p_NB += s * rest_.v_NB + 0.5 * s * s * rest_.a_NB;
      state.v_NB += s * rest_.a_NB;
      state.yaw += s * rest_.yaw_rate;
      return state;
    }
    case Kind::move:
      return move_.at(t);
    case Kind::landing:
      break;
  }
  const Pace::Reading pace = pace_.at(t);
  const Seconds s = pace.s;
  FlatState state = trajectory_.at(s);
  if (s < 0) {
    // Not yet in force: where it begins, standing.
    state.v_NB.setZero();
    state.a_NB.setZero();
    state.j_NB.setZero();
  } else if (s > trajectory_.duration()) {
    const double sink = state.v_NB.z() * (s - trajectory_.duration());
    state.p_NB.z() += std::max(sink, -sink_m_);
    state.a_NB.setZero();
    state.j_NB.setZero();
    if (sink <= -sink_m_) state.v_NB.setZero();
  }
  flare_.add_to(state, trajectory_.duration() + flare_delay_ - s);
  // d/dt of p(s(t)).
  const double rate = pace.rate, slope = pace.slope;
  state.j_NB = rate * rate * rate * state.j_NB + 3 * rate * slope * state.a_NB +
               pace.curve * state.v_NB;
  state.a_NB = rate * rate * state.a_NB + slope * state.v_NB;
  state.v_NB *= rate;
  state.yaw_rate *= rate;
  return state;
}

double Maneuver::stops_at_z(Time t) const {
  assert(kind_ == Kind::landing);
  const Pace::Reading pace = pace_.at(t);
  return trajectory_.at(pace.s + pace.stops).p_NB.z();
}

Seconds Maneuver::past_end(Time t) const {
  switch (kind_) {
    case Kind::stay:
    case Kind::coast:
      return to_seconds(t);
    case Kind::move:
      return to_seconds(t - move_.end());
    case Kind::landing:
      break;
  }
  return pace_.at(t).s - trajectory_.duration();
}

}  // namespace alight
