#include "alight/sim/recorded_drive.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

namespace alight {
namespace {

constexpr double kRampAcceleration = 0.6;      // m/s^2, as the simulated UGV's
constexpr double kRampTurning = 3;             // rad/s^2
constexpr double kAtRest = 0.05;               // m/s and rad/s
constexpr double kFastest = 20;                // m/s and m/s^2
constexpr double kSteepest = 45 * kDegree;     // of roll and of pitch
constexpr double kWidest = 1000, kHigh = 100;  // m
constexpr int kTracks = 6;

std::array<double, kTracks> tracks_of(const Pose& X_IN) {
  const Vector3 p = X_IN.translation();
  const Matrix3 R = X_IN.linear();
  const double pitch = std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0)));
  return {p.x(), p.y(), p.z(), std::atan2(R(2, 1), R(2, 2)), pitch, yaw_of(R)};
}

Result<void> wrong_at(double t, const std::string& what) {
  std::ostringstream text;
  text << "at t = " << t << " s " << what;
  return fail(Fault::invalid_config, text.str());
}

/// Each pose alone, and time.
Result<void> check_poses(const PoseLog& log) {
  if (log.size() < 2) {
    return fail(Fault::invalid_config, "a drive needs at least two poses");
  }
  for (std::size_t i = 0; i < log.size(); ++i) {
    const double t = to_seconds(log[i].first);
    if (i > 0 && log[i].first <= log[i - 1].first) {
      return wrong_at(t, "time does not advance");
    }
    const auto x = tracks_of(log[i].second);
    if (!(std::abs(x[0]) <= kWidest && std::abs(x[1]) <= kWidest)) {
      return wrong_at(t, "the pad is more than 1000 m from the origin of I");
    }
    if (!(x[2] >= 0 && x[2] <= kHigh)) {
      return wrong_at(t, "the pad is not within 0 to 100 m above the floor (z = 0)");
    }
    if (!(std::abs(x[3]) <= kSteepest && std::abs(x[4]) <= kSteepest)) {
      return wrong_at(t, "the pad is tilted by more than 45 deg");
    }
  }
  return {};
}

bool rests(const PoseLog& log, std::size_t i) {
  const auto& [t0, X0] = log[i];
  const auto& [t1, X1] = log[i + 1];
  const double least = kAtRest * to_seconds(t1 - t0);
  return (X1.translation() - X0.translation()).norm() <= least &&
         angle_between(X0.linear(), X1.linear()) <= least;
}

}  // namespace

Result<RecordedDrive> RecordedDrive::create(const PoseLog& log) {
  if (auto good = check_poses(log); !good) return fail(good.error());
  const RecordedDrive drive(log);
  for (std::size_t i = 0; i + 1 < log.size(); ++i) {
    const double begin = to_seconds(log[i].first - log.front().first);
    const double end = to_seconds(log[i + 1].first - log.front().first);
    for (const double s : {begin, (begin + end) / 2, end}) {
      const PlatformState state = drive.state({s, 1, 0});
      const char* const what = state.v_IN_N.norm() > kFastest     ? "20 m/s"
                               : state.a_IN_N.norm() > kFastest   ? "20 m/s^2"
                               : state.w_IN_N.norm() > kFastest   ? "20 rad/s"
                               : state.alpha_IN_N.norm() > 1000.0 ? "1000 rad/s^2"
                                                                  : nullptr;
      if (what == nullptr) continue;
      auto wrong = wrong_at(s + to_seconds(log.front().first),
                            std::string("the pad would move at more than ") + what +
                                ": smooth the recording, or check its units");
      return fail(wrong.error());
    }
  }
  return drive;
}

RecordedDrive::RecordedDrive(const PoseLog& log) {
  using End = CubicSpline::End;
  std::vector<double> t;
  std::array<std::vector<double>, kTracks> values;
  for (const auto& [time, X_IN] : log) {
    t.push_back(to_seconds(time - log.front().first));
    const auto x = tracks_of(X_IN);
    for (int k = 0; k < kTracks; ++k) {
      auto& track = values[static_cast<std::size_t>(k)];
      const double now = x[static_cast<std::size_t>(k)];
      const bool turns = k >= 3 && !track.empty();
      track.push_back(turns ? track.back() + wrap_angle(now - track.back()) : now);
    }
  }
  length_ = t.back();
  const End first = rests(log, 0) ? End::resting : End::free;
  const End last = rests(log, log.size() - 2) ? End::resting : End::free;
  for (auto& track : values) tracks_.emplace_back(t, std::move(track), first, last);

  const auto ramp = [&](double s) {
    const PlatformState state = this->state({s, 1, 0});
    return std::min(length_, std::max(state.v_IN_N.norm() / kRampAcceleration,
                                      state.w_IN_N.norm() / kRampTurning));
  };
  if (first == End::free) run_up_ = ramp(0);
  if (last == End::free) run_down_ = ramp(length_);
}

Seconds RecordedDrive::duration() const { return length_ + (run_up_ + run_down_) / 2; }

RecordedDrive::Progress RecordedDrive::progress(Seconds t) const {
  const double left = duration() - t;
  if (t <= 0) return {0, 0, 0};
  if (left <= 0) return {length_, 0, 0};
  if (t < run_up_) return {t * t / (2 * run_up_), t / run_up_, 1 / run_up_};
  if (left < run_down_) {
    return {length_ - left * left / (2 * run_down_), left / run_down_, -1 / run_down_};
  }
  return {t - run_up_ / 2, 1, 0};
}

PlatformState RecordedDrive::at(Seconds t) const {
  PlatformState state = this->state(progress(t));
  state.t = from_seconds(t);
  return state;
}

PlatformState RecordedDrive::state(const Progress& at) const {
  std::array<double, kTracks> x, v, a;
  for (std::size_t k = 0; k < kTracks; ++k) {
    const CubicSpline::Sample sample = tracks_[k].at(at.s);
    x[k] = sample.value;
    v[k] = sample.rate * at.rate;
    a[k] = sample.acceleration * at.rate * at.rate + sample.rate * at.acceleration;
  }
  PlatformState state;
  const Matrix3 R = from_rpy(x[3], x[4], x[5]);
  state.X_IN = make_pose(R, Vector3(x[0], x[1], x[2]));
  state.v_IN_N = R.transpose() * Vector3(v[0], v[1], v[2]);
  state.a_IN_N = R.transpose() * Vector3(a[0], a[1], a[2]);

  // w = E(roll, pitch) (roll', pitch', yaw')
  const double sr = std::sin(x[3]), cr = std::cos(x[3]);
  const double sp = std::sin(x[4]), cp = std::cos(x[4]);
  Matrix3 E, dE;
  E << 1, 0, -sp,  //
      0, cr, cp * sr, 0, -sr, cp * cr;
  dE << 0, 0, -cp * v[4],                               //
      0, -sr * v[3], -sp * v[4] * sr + cp * cr * v[3],  //
      0, -cr * v[3], -sp * v[4] * cr - cp * sr * v[3];
  const Vector3 rates(v[3], v[4], v[5]);
  state.w_IN_N = E * rates;
  state.alpha_IN_N = E * Vector3(a[3], a[4], a[5]) + dE * rates;
  return state;
}

}  // namespace alight
