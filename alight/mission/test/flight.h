#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "alight/mission/mission.h"
#include "alight/planning/planner.h"

namespace alight {

inline constexpr Time kStep = 10'000'000;  // 100 Hz

/// A mission, and a drone that does at once what it is asked to do; everything that
/// may go wrong is a switch.
class Flight {
 public:
  explicit Flight(const MissionConfig& config = {}, const Rig& rig = alan_rig())
      : rig_(rig), mission_(config, rig) {
    x_.p_NB = Vector3(0, 0, rig.drone.gear_height_m);
  }

  // What may go wrong.
  bool link_up = true, telemetry = true, platform = true, sight = true;
  bool estimate = true;  ///< There is one, once it has been seen.
  bool arms = true;      ///< Does as ordered.
  bool motors_stop = false;
  bool lifts = true;                 ///< Rises when thrust is enough.
  const Planner* planner = nullptr;  // else straight ways
  bool planner_answers = true;
  bool plans_feasible = true;
  std::uint32_t plan_age = 0;  ///< It answers this many questions ago.
  Time planner_delay = 2 * kStep;
  double battery = 1;
  double platform_speed = 0.9;  ///< m/s
  double platform_turn = 0;     ///< rad/s
  double platform_slip = 0;     ///< to the left, by an odometry that drifts, m/s
  Blindness blindness = Blindness::leds;
  bool computer_was_late = false;
  bool picture_repeats = false;
  bool told_of = false;    ///< Unseen, its autopilot tells how it moves.
  double seen_higher = 0;  ///< m, than it is.
  double miss_sd_m = 0.02;
  double deck_swing = 0, deck_lean = 0;  ///< m/s^2; rad, at the touch
  Vector3 push_N = Vector3::Zero();      ///< m/s^2, of the wind
  bool stands_on_floor = false;          ///< By what it tells.
  double climb = std::numeric_limits<double>::quiet_NaN();  ///< m/s, likewise.
  AutopilotMode mode = AutopilotMode::offboard;
  Vector3 off = Vector3::Zero();           ///< From the reference, where it flies.
  Vector3 off_m_s = Vector3::Zero();       ///< Likewise, its velocity.
  Vector3 slid = Vector3::Zero();          ///< On the ground, when the motors run.
  Vector3 slides = Vector3::Zero();        ///< m/s, likewise,
  double tip = 0;                          ///< rad, likewise.
  OperatorWish wish = OperatorWish::none;  ///< Once.

  // What came of it.
  std::vector<MissionTransition> transitions;
  std::vector<PlanRequest> requests;
  MissionCommand c;
  double reference_jump_m = 0;  ///< Largest from one step to the next, while flying.
  int orders_land = 0, orders_disarm = 0, orders_arm = 0;

  const Mission& mission() const { return mission_; }
  MissionState state() const { return mission_.status().state; }
  std::string reason() const { return mission_.status().reason; }
  Time now() const { return now_; }
  RelativeState& x() { return x_; }
  const Rig& rig() const { return rig_; }
  bool armed() const { return armed_; }
  void arm_late() { armed_ = true; }

  /// The radio, too, for so long; then it is up again.
  void stall(Seconds s) {
    link_up = false;
    run(s);
    link_up = true;
  }
  /// The computer stands still.
  void miss(Seconds s) {
    now_ += from_seconds(s);
    stood_still_ = true;
  }
  void step() {
    now_ += kStep;
    LinkStatus status;
    status.captured = status.received = status.last_answer = now_;
    status.round_trip_ms = 80;
    if (link_up) link_.add(status);

    MissionInput in;
    in.now = now_;
    in.wish = wish;
    wish = OperatorWish::none;
    in.telemetry_heard = telemetry_ = telemetry_ || (telemetry && link_up);
    if (link_up) {
      armed_heard_ = armed_;
      mode_heard_ = mode;
    }
    in.armed = armed_heard_;
    in.mode = mode_heard_;
    in.battery = battery;
    in.link = &link_;
    in.platform_ready = platform;
    if (sight) {
      seen_ = now_;
      x_seen_ = x_;
      x_seen_.p_NB.z() += seen_higher;
      ever_seen_ = true;
    }
    in.estimate_valid = ever_seen_ && estimate;
    in.x = x_;
    in.x_seen = x_seen_;
    in.z_acted = in.x.p_NB.z() + 0.1 * in.x.v_NB.z();
    in.seen = seen_;
    in.motion_known = told_of ? now_ : seen_;
    in.blindness = blindness;
    in.computer_was_late = computer_was_late;
    if (std::exchange(stood_still_, false)) woke_ = now_;
    in.woke = woke_;
    in.picture_repeats = picture_repeats;
    in.miss_sd_m = miss_sd_m;
    in.platform.v_IN_N = Vector3(platform_speed, platform_slip, 0);
    in.platform.w_IN_N.z() = platform_turn;
    in.push_N = push_N;
    in.stands_on_floor = stands_on_floor;
    in.told = now_;
    in.climb = climb;
    in.thrust_acts_in = 0.1;
    in.deck_swing = deck_swing;
    in.f_end_N = kGravity * Vector3(0, std::tan(deck_lean), 1);
    PlanArrival arrival;
    if (asked_ && planner_answers && now_ >= answer_at_) {
      asked_ = false;
      arrival.received = now_;
      arrival.result = answer_;
      in.plan = &arrival;
    }

    Output out;
    const bool flew = mission_.flying();
    const Vector3 p_before = mission_.reference(now_).p_NB;
    c = mission_.step(in, out);
    if (flew && mission_.flying() && off.isZero()) {
      const Vector3 p_after = mission_.reference(now_).p_NB;
      reference_jump_m = std::max(reference_jump_m, (p_after - p_before).norm());
    }
    for (const MissionTransition& t : out.transitions) transitions.push_back(t);
    EXPECT_EQ(out.mission.state, mission_.status().state);
    if (out.has_plan_request) {
      requests.push_back(out.plan_request);
      asked_ = true;
      answer_at_ = now_ + planner_delay;
      answer_ = answer(out.plan_request);
    }
    orders_arm += c.order == AutopilotOrder::arm;
    orders_disarm += c.order == AutopilotOrder::disarm;
    orders_land += c.order == AutopilotOrder::land;
    move();
  }

  void run(Seconds s) {
    for (const Time end = now_ + from_seconds(s); now_ < end;) step();
  }
  /// Steps until `state`; false if that takes longer than `limit_s`.
  bool until(MissionState state, Seconds limit_s = 30) {
    for (const Time end = now_ + from_seconds(limit_s); now_ < end;) {
      step();
      if (mission_.status().state == state) return true;
    }
    return false;
  }
  /// From idle to `state`, nothing going wrong.
  bool reach(MissionState state) {
    wish = OperatorWish::go;
    return until(state, 60);
  }
  /// A start in which it does not lift, until it is asked for so much thrust.
  bool ramp_up_to(double share) {
    lifts = false;
    if (!reach(MissionState::taken_off)) return false;
    while (c.ramp_share < share && state() == MissionState::taken_off) step();
    return c.ramp_share >= share;
  }
  /// Within a landing, to a reference below `height`.
  bool until_below(double height) {
    for (int i = 0; i < 1000 && state() == MissionState::land; ++i) {
      if (x_.p_NB.z() < height) return true;
      step();
    }
    return false;
  }

 private:
  void move() {
    if (c.order == AutopilotOrder::arm && arms && link_up) armed_ = true;
    if (c.order == AutopilotOrder::disarm && link_up) armed_ = false;
    if (motors_stop) armed_ = false;
    switch (c.mode) {
      case MissionCommand::Mode::ramp:
        // More thrust than weight lifts it by as much as matters.
        if (lifts && c.ramp_share > 1) x_.p_NB.z() += 0.005;
        if (c.ramp_share > 0.9) {
          x_.p_NB += slid;
          slid.setZero();
          if (!slides.isZero()) x_.v_NB = slides;
          if (tip != 0) x_.R_NB = so3_exp(Vector3(0, tip, 0));
        }
        break;
      case MissionCommand::Mode::track:
      case MissionCommand::Mode::settle: {
        const FlatState ref = mission_.reference(now_ + kStep);
        x_.p_NB = ref.p_NB + off;
        x_.v_NB = ref.v_NB + off_m_s;
        x_.R_NB.setIdentity();
        break;
      }
      default:
        break;
    }
    // The pad holds it, or the floor.
    const bool over_pad = x_.p_NB.head<2>().cwiseAbs().maxCoeff() < 0.3;
    const double ground = over_pad ? 0 : -rig_.pad.above_floor_m;
    x_.p_NB.z() = std::max(x_.p_NB.z(), ground + rig_.drone.gear_height_m);
  }

  /// A straight way from where it begins to the pad.
  PlanResult answer(const PlanRequest& request) const {
    if (planner != nullptr) return planner->plan(request);
    PlanResult plan;
    plan.id = request.id - plan_age;
    plan.start = request.start;
    if (!plans_feasible) {
      plan.reason = "no trajectory keeps the view";
      return plan;
    }
    plan.status = PlanStatus::solved;
    const Vector3 a = request.from.p_NB;
    const Vector3 pad(0, 0, rig_.drone.gear_height_m), b(0, 0, 0.3);
    plan.trajectory.durations = {1.5, 1.0};
    for (std::size_t i = 0; i < kControlPoints; ++i) {
      const double u = static_cast<double>(i) / (kControlPoints - 1);
      plan.trajectory.c[0][i] = a + u * (b - a);
      plan.trajectory.c[1][i] = b + u * (pad - b);
    }
    return plan;
  }

  Rig rig_;
  Mission mission_;
  LinkMonitor link_;
  Time now_ = 1'000'000'000;
  RelativeState x_, x_seen_;
  Time seen_ = 0;
  bool ever_seen_ = false, telemetry_ = false;
  bool armed_ = false, armed_heard_ = false;
  AutopilotMode mode_heard_ = AutopilotMode::manual;
  bool stood_still_ = false;
  Time woke_ = 0;
  bool asked_ = false;
  Time answer_at_ = 0;
  PlanResult answer_;
};

using State = MissionState;

inline void expect_last(const Flight& f, State from, State to, const char* reason) {
  ASSERT_FALSE(f.transitions.empty());
  const MissionTransition& last = f.transitions.back();
  EXPECT_EQ(last.from, from) << to_string(last.from);
  EXPECT_EQ(last.to, to) << to_string(last.to);
  EXPECT_STREQ(last.reason, reason);
  EXPECT_EQ(f.state(), to);
}

/// Brings a mission into any state of its normal life or of the exceptions.
inline bool bring(Flight& f, State state) {
  switch (state) {
    case State::idle:
      f.run(0.5);
      return f.state() == State::idle;
    case State::hold:
      if (!f.reach(State::follow)) return false;
      f.wish = OperatorWish::hold;
      f.step();
      return f.state() == State::hold;
    case State::go_around:
      if (!f.reach(State::land)) return false;
      f.run(0.3);
      f.off = Vector3(0.4, 0, 0);
      if (!f.until(State::go_around, 1)) return false;
      f.off.setZero();
      f.step();
      return true;
    case State::lost_target:
      if (!f.reach(State::follow)) return false;
      f.sight = false;
      return f.until(State::lost_target, 1);
    case State::lost_link:
      if (!f.reach(State::follow)) return false;
      f.link_up = false;
      return f.until(State::lost_link, 2);
    case State::armed:
    case State::shut_down:
      // Is left at once where all goes well.
      return f.reach(state);
    default:
      return f.reach(state);
  }
}

inline constexpr const char* kTooFastSaid =
    "the platform is too fast for the drone's speed limit: no landing";

}  // namespace alight
