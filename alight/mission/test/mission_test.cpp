#include "alight/mission/mission.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "alight/mission/into_view.h"
#include "alight/planning/planner.h"

namespace alight {
namespace {

constexpr Time kStep = 10'000'000;  // 100 Hz

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
  bool arms = true;  ///< Does as ordered.
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
  bool told_of = false;  ///< Unseen, its autopilot tells how it moves.
  double miss_sd_m = 0.02;
  double deck_swing = 0, deck_lean = 0;  ///< m/s^2; rad, at the touch
  Vector3 push_N = Vector3::Zero();      ///< m/s^2, of the wind
  bool stands_on_floor = false;          ///< By what it tells.
  AutopilotMode mode = AutopilotMode::offboard;
  Vector3 off = Vector3::Zero();           ///< From the reference, where it flies.
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
      ever_seen_ = true;
    }
    in.estimate_valid = ever_seen_;
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
        x_.v_NB = ref.v_NB;
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

void expect_last(const Flight& f, State from, State to, const char* reason) {
  ASSERT_FALSE(f.transitions.empty());
  const MissionTransition& last = f.transitions.back();
  EXPECT_EQ(last.from, from) << to_string(last.from);
  EXPECT_EQ(last.to, to) << to_string(last.to);
  EXPECT_STREQ(last.reason, reason);
  EXPECT_EQ(f.state(), to);
}

TEST(Mission, NormalLife) {
  Flight f;
  f.run(1);
  EXPECT_EQ(f.state(), State::idle);
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
  EXPECT_EQ(f.orders_arm, 0);
  ASSERT_TRUE(f.reach(State::complete)) << to_string(f.state()) << f.reason();

  const struct {
    State from, to;
    const char* reason;
  } life[] = {
      {State::idle, State::armed, "all is ready: arming"},
      {State::armed, State::taken_off, "armed: taking off"},
      {State::taken_off, State::follow, "clear of the pad: to the follow point"},
      {State::follow, State::rendezvous, "following well: to the rendezvous"},
      {State::rendezvous, State::land, "the landing is planned"},
      {State::land, State::land, "past the commit height: it lands"},
      {State::land, State::shut_down, "stands on the pad"},
      {State::shut_down, State::complete, "motors stopped"},
  };
  ASSERT_EQ(f.transitions.size(), std::size(life));
  for (std::size_t i = 0; i < std::size(life); ++i) {
    EXPECT_EQ(f.transitions[i].from, life[i].from) << i;
    EXPECT_EQ(f.transitions[i].to, life[i].to) << i;
    EXPECT_STREQ(f.transitions[i].reason, life[i].reason) << i;
    if (i == 0) continue;
    EXPECT_GT(f.transitions[i].t, f.transitions[i - 1].t);
  }
  EXPECT_LT(f.reference_jump_m, 1e-6);
  EXPECT_EQ(f.mission().status().attempts, 1);
  ASSERT_GE(f.requests.size(), 1u);
  EXPECT_FALSE(f.requests[0].keep_jerk);
  EXPECT_FALSE(f.armed());
  EXPECT_FALSE(f.mission().flying());
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
  // Complete stays complete.
  f.wish = OperatorWish::go;
  f.run(2);
  f.wish = OperatorWish::abort;
  f.run(2);
  EXPECT_EQ(f.state(), State::complete);
  EXPECT_EQ(f.c.order, AutopilotOrder::none);
}

TEST(Mission, CommandsFollowTheState) {
  Flight f;
  f.wish = OperatorWish::go;
  bool lifted = false;
  double ramp = 0;
  for (int i = 0; i < 6000 && f.state() != State::complete; ++i) {
    f.step();
    SCOPED_TRACE(to_string(f.state()));
    switch (f.state()) {
      case State::idle:
      case State::complete:
        EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
        EXPECT_TRUE(f.c.on_ground);
        break;
      case State::taken_off:
        if (f.c.lifted) {
          EXPECT_FALSE(lifted) << "lifts off once";
          lifted = true;
          // Thrust at the weight, then a rise of lift_m with the third power of time.
          EXPECT_NEAR(f.c.lifted_since, 0.174, 0.01);
        } else if (f.c.mode == MissionCommand::Mode::ramp) {
          EXPECT_FALSE(lifted);
          EXPECT_GE(f.c.ramp_share, ramp);
          ramp = f.c.ramp_share;
        }
        if (!f.transitions.empty() && f.now() > f.transitions.back().t) {
          EXPECT_EQ(f.c.on_ground, !lifted);
        }
        break;
      case State::follow:
      case State::rendezvous:
        EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
        EXPECT_FALSE(f.c.on_ground);
        EXPECT_TRUE(f.mission().flying());
        break;
      default:
        break;
    }
    const bool leaves = f.c.thrust_least > 0;  // the ground
    EXPECT_TRUE(!leaves || f.state() == State::taken_off);
    EXPECT_GT(f.c.tilt_limit, 30 * kDegree);
    EXPECT_EQ(f.c.platform_speed_wish, 1);
  }
  EXPECT_TRUE(lifted);
  EXPECT_EQ(f.state(), State::complete);
}

TEST(Mission, TouchingDownThrustGoesToNothingBeforeTheMotorsStop) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  double share = 1;
  int settling = 0;
  while (f.state() == State::land) {
    f.step();
    if (f.c.mode != MissionCommand::Mode::settle) continue;
    ++settling;
    EXPECT_LE(f.c.ramp_share, share);
    share = f.c.ramp_share;
    EXPECT_LT(f.x().p_NB.z(), f.rig().drone.gear_height_m + 0.03);
    EXPECT_EQ(f.orders_disarm, 0);
  }
  EXPECT_GE(settling, 5);
  EXPECT_EQ(f.state(), State::shut_down);
}

// Refused before it has left the ground; nothing but a disarm is ever ordered.
struct Refusing {
  const char* name;
  void (*set)(Flight&);
  const char* reason;
};
class MissionRefuses : public testing::TestWithParam<Refusing> {};

TEST_P(MissionRefuses, AndSaysWhy) {
  Flight f;
  GetParam().set(f);
  ASSERT_TRUE(f.reach(State::refused)) << to_string(f.state());
  EXPECT_EQ(f.reason(), GetParam().reason);
  EXPECT_FALSE(f.mission().flying());
  EXPECT_EQ(f.orders_land, 0);
  // For good.
  f.link_up = f.telemetry = f.platform = f.sight = f.arms = f.lifts = true;
  f.battery = 1;
  const int arms_before = f.orders_arm;
  f.wish = OperatorWish::go;
  f.run(12);
  EXPECT_EQ(f.state(), State::refused);
  EXPECT_EQ(f.orders_arm, arms_before);
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
  EXPECT_FALSE(f.armed());
}
INSTANTIATE_TEST_SUITE_P(
    Cases, MissionRefuses,
    testing::Values(Refusing{"NoLink", [](Flight& f) { f.link_up = false; },
                             "the radio link is not healthy"},
                    Refusing{"NoTelemetry", [](Flight& f) { f.telemetry = false; },
                             "the autopilot sends no telemetry"},
                    Refusing{"NoOdometry", [](Flight& f) { f.platform = false; },
                             "there is no platform odometry"},
                    Refusing{"NoSight", [](Flight& f) { f.sight = false; },
                             "the LEDs are not seen on the pad"},
                    Refusing{"LowBattery", [](Flight& f) { f.battery = 0.1; },
                             "the battery is too low to start"},
                    Refusing{"DoesNotArm", [](Flight& f) { f.arms = false; },
                             "the autopilot does not arm"},
                    Refusing{"DoesNotLift", [](Flight& f) { f.lifts = false; },
                             "did not leave the ground"}),
    [](const auto& case_of) { return case_of.param.name; });

TEST(Mission, WaitsForWhatIsMissingAndThenStarts) {
  Flight f;
  f.sight = false;
  f.wish = OperatorWish::go;
  f.run(5);
  EXPECT_EQ(f.state(), State::idle);
  EXPECT_EQ(f.orders_arm, 0);
  f.sight = true;
  EXPECT_TRUE(f.until(State::follow));
}

TEST(Mission, AnOldSightIsNone) {
  Flight f;
  f.run(1);
  f.sight = false;
  f.run(1);
  f.wish = OperatorWish::go;
  ASSERT_TRUE(f.until(State::refused));
  EXPECT_EQ(f.reason(), "the LEDs are not seen on the pad");
}

/// Brings a mission into any state of its normal life or of the exceptions.
bool bring(Flight& f, State state) {
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

constexpr State kInTheAir[] = {State::follow, State::rendezvous, State::land,
                               State::hold,   State::go_around,  State::lost_target};

TEST(Mission, AbortBeforeTheStartIsARefusal) {
  for (const State state : {State::idle, State::armed, State::taken_off}) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    ASSERT_FALSE(f.mission().flying());
    f.wish = OperatorWish::abort;
    f.step();
    EXPECT_EQ(f.state(), State::refused);
    if (state != State::taken_off) {
      EXPECT_EQ(f.reason(), "the operator aborted before the start");
    }
    EXPECT_EQ(f.c.order,
              state == State::idle ? AutopilotOrder::none : AutopilotOrder::disarm);
    EXPECT_EQ(f.orders_land, 0);
    f.run(1);
    EXPECT_FALSE(f.armed());
  }
}

// The order to arm is still on its way, and the first one to disarm lost.
TEST(Mission, WhatArmsAfterItWasToldToDisarmIsToldAgain) {
  for (const OperatorWish wish : {OperatorWish::abort, OperatorWish::hold}) {
    Flight f;
    f.arms = false;
    ASSERT_TRUE(bring(f, State::armed));
    f.step();
    ASSERT_EQ(f.orders_arm, 1);
    f.wish = wish;
    f.run(0.2);
    f.arm_late();
    f.run(0.5);
    EXPECT_FALSE(f.armed());
    const int orders = f.orders_disarm;
    f.run(2);
    EXPECT_EQ(f.orders_disarm, orders);
    EXPECT_EQ(f.state(), wish == OperatorWish::hold ? State::idle : State::refused);
  }
}

TEST(Mission, AbortInTheAirLandsByTheAutopilot) {
  for (const State state : kInTheAir) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.wish = OperatorWish::abort;
    f.step();
    expect_last(f, state, State::aborted, "the operator aborted: the autopilot lands");
    // Clear of the platform and, unseen, at rest over the ground; then ordered again
    // and again, until the motors stand; never a disarm in the air.
    f.run(3);
    EXPECT_GE(f.orders_land, 8);
    EXPECT_EQ(f.orders_disarm, 0);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
    f.mode = AutopilotMode::land;
    EXPECT_TRUE(f.mission().flying());
    f.motors_stop = true;
    f.run(0.1);
    EXPECT_FALSE(f.mission().flying());
    const int ordered = f.orders_land;
    f.run(1);
    EXPECT_EQ(f.orders_land, ordered);
    EXPECT_EQ(f.state(), State::aborted);
  }
}

TEST(Mission, AbortWhileClimbingLandsByTheAutopilot) {
  Flight f;
  ASSERT_TRUE(f.reach(State::taken_off));
  while (!f.mission().flying() && f.state() == State::taken_off) f.step();
  ASSERT_TRUE(f.mission().flying());
  f.wish = OperatorWish::abort;
  f.step();
  expect_last(f, State::taken_off, State::aborted,
              "the operator aborted: the autopilot lands");
}

TEST(Mission, ALostTargetThatReturnsGoesAround) {
  for (const State state :
       {State::follow, State::rendezvous, State::land, State::go_around}) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.sight = false;
    f.run(0.2);
    EXPECT_EQ(f.state(), state) << "a few pictures are no loss";
    f.run(0.1);
    expect_last(f, state, State::lost_target, "the LEDs are out of sight");
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::track) << "flies on by the prediction";
    EXPECT_TRUE(f.mission().flying());
    f.run(1);
    EXPECT_EQ(f.state(), State::lost_target);
    f.sight = true;
    f.step();
    expect_last(f, State::lost_target, State::go_around, "the LEDs are in sight again");
    EXPECT_TRUE(f.until(State::complete)) << to_string(f.state());
    EXPECT_LT(f.reference_jump_m, 1e-6);
  }
}

TEST(Mission, TheSearchGetsFromAboveThePadToWhereItSearchesInTime) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.25));
  f.sight = false;
  ASSERT_TRUE(f.until(State::lost_target, 1));
  f.run(MissionConfig{}.give_up_s - 0.1);
  ASSERT_EQ(f.state(), State::lost_target);
  const Vector3 goal = places_for({}, f.rig()).search_point;
  EXPECT_LT((f.x().p_NB - goal).norm(), 0.02);
}

TEST(Mission, ADroneThatIsGivenUpIsTakenBackWhenItIsSeenBeforeItIsLeft) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_target));
  ASSERT_TRUE(f.until(State::aborted, 8));
  ASSERT_EQ(f.orders_land, 0);
  f.sight = true;
  f.run(0.1);
  expect_last(f, State::aborted, State::go_around, "the LEDs are in sight again");
  EXPECT_TRUE(f.until(State::land, 20));
  EXPECT_EQ(f.orders_land, 0);

  Flight told;
  ASSERT_TRUE(bring(told, State::lost_target));
  ASSERT_TRUE(told.until(State::aborted, 8));
  told.wish = OperatorWish::abort;
  told.sight = true;
  told.run(1);
  EXPECT_EQ(told.state(), State::aborted);
}

// The wind takes it to the lens, where a climb would pass over the picture's edge.
TEST(Mission, ADroneLostBesideTheLensGoesBackIntoThePictureBeforeItClimbs) {
  MissionConfig config;
  config.give_up_s = 6;
  Flight f(config);
  ASSERT_TRUE(f.reach(State::taken_off));
  while (f.state() == State::taken_off && f.x().p_NB.z() < 0.2) f.step();
  ASSERT_EQ(f.state(), State::taken_off);
  const Rig& rig = f.rig();
  f.off = Vector3(0.4, 0.2, 0);
  f.sight = false;
  ASSERT_TRUE(f.until(State::lost_target, 1));
  f.off.setZero();
  const Vector3 from = f.x().p_NB;
  ASSERT_FALSE(in_view(rig.camera, rig.leds, from));
  while (!in_view(rig.camera, rig.leds, f.x().p_NB) &&
         f.state() == State::lost_target) {
    f.step();
  }
  ASSERT_EQ(f.state(), State::lost_target);
  EXPECT_LT(f.x().p_NB.z(), from.z() + 0.15);
  f.run(4);
  EXPECT_TRUE(f.x().p_NB.isApprox(places_for({}, rig).search_point, 1e-6));
}

TEST(Mission, ALostTargetThatStaysAwayIsLeftToTheAutopilot) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_target));
  const Time since = f.now();
  ASSERT_TRUE(f.until(State::aborted, 8));
  EXPECT_EQ(f.reason(), "the LEDs stay out of sight: the autopilot lands");
  EXPECT_NEAR(to_seconds(f.now() - since), MissionConfig{}.give_up_s, 0.05);
  while (f.orders_land == 0 && f.state() == State::aborted) f.step();
  f.sight = true;
  f.run(1);
  EXPECT_EQ(f.state(), State::aborted);
  EXPECT_GE(f.orders_land, 5);
}

TEST(Mission, ALostLinkLeavesTheAutopilotAlone) {
  for (const State state : kInTheAir) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.link_up = false;
    double limit = f.c.tilt_limit;
    bool silent_too_soon = false;
    const Time since = f.now();
    while (f.state() != State::lost_link && f.now() - since < 2'000'000'000) {
      f.x().v_NB.z() -= 1;  // What it is told does not reach it.
      f.step();
      // As the link ages the tilt that may be commanded shrinks.
      EXPECT_LE(f.c.tilt_limit, limit);
      limit = f.c.tilt_limit;
      silent_too_soon |=
          f.state() != State::lost_link && f.c.mode == MissionCommand::Mode::silent;
    }
    ASSERT_EQ(f.state(), State::lost_link);
    EXPECT_EQ(f.reason(), "nothing heard from the drone: its autopilot acts alone");
    EXPECT_FALSE(silent_too_soon);
    EXPECT_LE(limit, 3.01 * kDegree);
    f.run(3);
    EXPECT_EQ(f.state(), State::lost_link);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
    EXPECT_TRUE(f.mission().flying());
  }
}

TEST(Mission, UnheardButSeenToObeyALandingGoesOn) {
  Flight f;
  ASSERT_TRUE(bring(f, State::land));
  f.link_up = false;
  const double limit = f.c.tilt_limit;
  while (f.state() == State::land) {
    f.step();
    EXPECT_EQ(f.c.tilt_limit, limit) << "a landing needs its tilt";
    EXPECT_EQ(f.c.platform_speed_wish, 1);
  }
  EXPECT_EQ(f.state(), State::shut_down);
  ASSERT_TRUE(f.until(State::lost_link, 10));
  EXPECT_EQ(f.reason(),
            "nothing heard since touch-down: the autopilot stops its motors");
}

TEST(Mission, ALinkThatReturnsGoesAround) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_link));
  f.sight = false;
  f.run(0.5);
  f.sight = true;
  f.link_up = true;
  f.step();
  expect_last(f, State::lost_link, State::go_around, "the link is back");
  EXPECT_TRUE(f.until(State::complete));
}

TEST(Mission, ALinkThatReturnsToABlindDroneGivesUpInTime) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_link));
  f.sight = false;
  f.run(0.5);
  f.link_up = true;
  f.step();
  expect_last(f, State::lost_link, State::lost_target,
              "the link is back, the LEDs are out of sight");
  EXPECT_TRUE(f.until(State::aborted, 8));
  f.run(2);
  EXPECT_GT(f.orders_land, 0);
}

TEST(Mission, WhatTheOperatorSaidStandsWhateverComesBetween) {
  for (const bool link : {false, true}) {
    Flight f;
    ASSERT_TRUE(f.reach(State::rendezvous));
    f.wish = OperatorWish::hold;
    f.step();
    ASSERT_EQ(f.state(), State::hold);
    (link ? f.link_up : f.sight) = false;
    f.run(link ? 1.5 : 0.5);
    EXPECT_EQ(f.state(), link ? State::lost_link : State::lost_target);
    (link ? f.link_up : f.sight) = true;
    f.run(20);
    EXPECT_EQ(f.state(), State::hold) << link;
    f.wish = OperatorWish::go;
    EXPECT_TRUE(f.until(State::complete, 60));
  }
  Flight early;
  ASSERT_TRUE(early.reach(State::taken_off));
  early.wish = OperatorWish::hold;
  early.run(20);
  EXPECT_EQ(early.state(), State::hold);

  Flight abort;
  ASSERT_TRUE(bring(abort, State::lost_link));
  abort.mode = AutopilotMode::failsafe;
  abort.link_up = true;
  abort.step();
  abort.wish = OperatorWish::abort;
  abort.step();
  abort.mode = AutopilotMode::offboard;
  abort.run(5);
  EXPECT_EQ(abort.state(), State::aborted);
  EXPECT_GT(abort.orders_land, 0);
}

TEST(Mission, WaitsAboveThePadForAGustToPass) {
  const MissionConfig config;
  const double commit = alan_rig().drone.gear_height_m + config.commit_height_m;
  Flight f(config);
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(commit + config.wait_room_m));
  f.off = Vector3(2.5 * config.wait_error_m, 0, 0);
  f.run(0.5 * config.wait_more_s);
  EXPECT_EQ(f.state(), State::land);
  EXPECT_GT(f.x().p_NB.z(), commit);
  f.off.setZero();
  EXPECT_TRUE(f.until(State::complete, 3));

  // A miss that stays: the longer it waits, the less it asks for.
  Flight stays(config);
  ASSERT_TRUE(stays.reach(State::land));
  ASSERT_TRUE(stays.until_below(commit + config.wait_room_m));
  stays.off = Vector3(2.5 * config.wait_error_m, 0, 0);
  EXPECT_TRUE(stays.until(State::complete, 2 * config.wait_more_s));
}

TEST(Mission, OneThatStopsToWaitIsNotCommittedToLandWhereItComesToRest) {
  const MissionConfig config;
  const double commit = alan_rig().drone.gear_height_m + config.commit_height_m;
  Flight f(config);
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(commit + 0.055));
  f.off = Vector3(2.5 * config.wait_error_m, 0, 0);
  f.run(0.5 * config.wait_more_s);
  EXPECT_EQ(f.state(), State::land);
  EXPECT_NE(f.reason(), "past the commit height: it lands");
  EXPECT_LT(f.x().p_NB.z(), commit);
  f.off.setZero();
  EXPECT_TRUE(f.until(State::complete, 3));
}

TEST(Mission, ADroneThatSeldomMissesWaitsForLess) {
  const MissionConfig config;
  const double commit = alan_rig().drone.gear_height_m + config.commit_height_m;
  const double off = 0.5 * (4.0 / 3 * config.wait_least_m + config.wait_error_m);
  for (const double swing : {0.0, 8 * config.wait_error_m}) {
    Flight f(config);
    ASSERT_TRUE(f.reach(State::land));
    for (int i = 0; f.x().p_NB.z() > commit + config.wait_room_m; ++i) {
      f.off.x() = swing * std::sin(2 * kPi * i / 100);
      f.step();
      ASSERT_LT(i, 1000);
    }
    f.off = Vector3(off, 0, 0);
    const bool lands = f.until(State::shut_down, 1.5);
    EXPECT_EQ(lands, swing > 0) << f.x().p_NB.transpose();
    EXPECT_TRUE(lands || f.until(State::complete, 2 * config.wait_more_s));
  }
}

TEST(Mission, WhatFailsToBeSeenAboveTheCommitHeightIsNotCommittedTo) {
  for (const Blindness why : {Blindness::leds, Blindness::pictures, Blindness::late}) {
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    ASSERT_TRUE(f.until_below(f.rig().drone.gear_height_m + 0.115));
    ASSERT_NE(f.reason(), "past the commit height: it lands");
    f.sight = false;
    f.blindness = why;
    while (f.state() == State::land && f.now() < 60'000'000'000) f.step();
    // Pictures that come late are landed by, if only just.
    const bool lands = why == Blindness::late;
    EXPECT_EQ(f.state(), lands ? State::shut_down : State::lost_target);
    EXPECT_EQ(f.x().p_NB.z() > f.rig().drone.gear_height_m + 0.05, !lands);
  }
}

TEST(Mission, CommittedAndUnseenItSettlesByThePrediction) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(f.rig().drone.gear_height_m + 0.05));
  f.sight = false;
  double share = 2;
  bool settled = false;
  while (f.state() == State::land && f.now() < 60'000'000'000) {
    f.step();
    if (f.c.mode != MissionCommand::Mode::settle) continue;
    settled = true;
    EXPECT_LE(f.c.ramp_share, share);
    share = f.c.ramp_share;
  }
  EXPECT_TRUE(settled);
  expect_last(f, State::land, State::shut_down, "stands on the pad");
  EXPECT_LT(share, 0.2);
}

TEST(Mission, ALinkThatReturnsAfterTheLandingTellsSo) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_link));
  f.mode = AutopilotMode::land;
  f.run(3);
  const std::size_t transitions = f.transitions.size();
  f.link_up = true;
  f.run(1);
  EXPECT_EQ(f.state(), State::lost_link) << "the autopilot lands: nothing interferes";
  EXPECT_EQ(f.transitions.size(), transitions);
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
  f.motors_stop = true;
  ASSERT_TRUE(f.until(State::complete, 1));
  EXPECT_EQ(f.reason(), "the link was lost: the autopilot landed by itself");
  EXPECT_FALSE(f.mission().flying());
}

TEST(Mission, TheAutopilotsFailsafeTakesOver) {
  for (const State state : kInTheAir) {
    SCOPED_TRACE(to_string(state));
    Flight landing;
    ASSERT_TRUE(bring(landing, state));
    landing.mode = AutopilotMode::land;
    landing.step();
    expect_last(landing, state, State::lost_link,
                "the autopilot's failsafe has taken over");
  }
  // A burst of losses passes.
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.mode = AutopilotMode::failsafe;
  f.run(0.9);
  f.mode = AutopilotMode::offboard;
  f.run(0.2);
  f.mode = AutopilotMode::failsafe;
  f.run(0.9);
  for (const auto& t : f.transitions) EXPECT_NE(t.to, State::lost_link);
  f.run(0.3);
  EXPECT_EQ(f.state(), State::lost_link);
  EXPECT_EQ(f.reason(), "the autopilot's failsafe has taken over");
}

// Without set-points its autopilot came down on the pad; when they arrived again they
// asked it to fly on, light on its feet, and the pad went from under it.
TEST(Mission, WhatItsAutopilotHasSetDownOnThePadStaysThere) {
  const struct {
    double from, x, speed;
    AutopilotMode mode;
    bool stays;
    double leans_deg = 0;
  } cases[] = {
      {0.2, 0.05, 0, AutopilotMode::failsafe, true, 4},
      {0.5, 0.05, 0, AutopilotMode::failsafe, true},       // it goes around meanwhile
      {0.2, 0.19, 0, AutopilotMode::failsafe, false},      // a foot off the pad's edge
      {0.2, 0.05, 0.4, AutopilotMode::failsafe, false},    // stopped it would trip
      {0.2, 0.05, 0, AutopilotMode::failsafe, false, 11},  // or fall over
      {0.2, 0.05, 0, AutopilotMode::offboard, false},      // it is there as told
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(testing::Message() << c.from << " " << c.x << " " << c.speed);
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    ASSERT_TRUE(f.until_below(f.rig().drone.gear_height_m + c.from));
    f.mode = c.mode;
    for (int i = 0; i < 20 && f.state() != State::complete; ++i) {
      f.x().p_NB = Vector3(c.x, 0, f.rig().drone.gear_height_m + 0.004);
      f.x().v_NB = Vector3(-c.speed, 0, 0);
      f.x().R_NB = so3_exp(Vector3(0, c.leans_deg * kDegree, 0));
      f.step();
      if (i == 5) {
        EXPECT_EQ(f.orders_disarm, 0) << "it may be passing by";
      }
    }
    EXPECT_EQ(f.orders_disarm > 0, c.stays);
    EXPECT_EQ(f.state() == State::complete, c.stays);
    if (c.stays) {
      EXPECT_EQ(f.reason(), "motors stopped");
    }
  }
}

// One that has hardly lifted has not been to where it landed.
TEST(Mission, WhatItsAutopilotHasSetDownAtTheTakeOffStartsAnew) {
  for (const bool abort : {false, true}) {
    SCOPED_TRACE(abort);
    Flight f;
    ASSERT_TRUE(f.reach(State::taken_off));
    for (int i = 0; i < 500 && !f.mission().flying(); ++i) f.step();
    ASSERT_TRUE(f.mission().flying());
    f.mode = AutopilotMode::failsafe;
    f.run(0.2);
    ASSERT_EQ(f.state(), State::lost_link) << f.reason();
    f.mode = AutopilotMode::offboard;
    const auto on_pad = [&] {
      f.x().p_NB = Vector3(0.02, 0, f.rig().drone.gear_height_m + 0.004);
      f.x().v_NB.setZero();
      f.x().R_NB.setIdentity();
      f.step();
    };
    for (int i = 0; i < 40 && f.armed(); ++i) on_pad();
    EXPECT_FALSE(f.armed());
    if (abort) f.wish = OperatorWish::abort;
    for (int i = 0; i < 60 && f.state() != State::refused; ++i) {
      if (f.state() == State::taken_off) break;
      on_pad();
    }
    if (abort) {
      EXPECT_EQ(f.state(), State::refused);
      EXPECT_EQ(f.reason(), "the operator aborted before the start");
      continue;
    }
    EXPECT_EQ(f.state(), State::taken_off);
    ASSERT_TRUE(f.until(State::complete)) << f.reason();
    EXPECT_EQ(f.mission().status().attempts, 1);
  }
}

TEST(Mission, AnInfeasiblePlanIsTriedAgainAndThenFollowed) {
  Flight f;
  f.plans_feasible = false;
  ASSERT_TRUE(f.reach(State::rendezvous));
  ASSERT_TRUE(f.until(State::follow, 20));
  EXPECT_EQ(f.reason(), "no trajectory keeps the view");
  EXPECT_EQ(static_cast<int>(f.requests.size()), MissionConfig{}.plan_tries);
  EXPECT_EQ(f.mission().status().attempts, 1);
  for (std::size_t i = 1; i < f.requests.size(); ++i) {
    EXPECT_GT(f.requests[i].id, f.requests[i - 1].id);
    EXPECT_NEAR(to_seconds(f.requests[i].start - f.requests[i - 1].start),
                MissionConfig{}.plan_retry_s, 0.03);
  }
  ASSERT_TRUE(f.until(State::rendezvous, 20));
  f.plans_feasible = true;
  ASSERT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 2);
}

TEST(Mission, APlanIsAskedFromWhereTheReferenceWillBe) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_EQ(f.requests.size(), 1u);
  const PlanRequest& request = f.requests[0];
  const MissionConfig placed = places_for({}, f.rig());
  EXPECT_TRUE(request.from.p_NB.isApprox(placed.rendezvous_point, 1e-9));
  EXPECT_EQ(request.platform.t, request.start);
  EXPECT_TRUE(request.platform.v_IN_N.isApprox(Vector3(0.9, 0, 0), 1e-9));
  // It ends, later, on the pad.
  const Vector3 end = f.mission().reference(f.now() + from_seconds(10)).p_NB;
  EXPECT_LT(end.head<2>().norm(), 1e-9);
}

TEST(Mission, APlannerThatIsLateOrSilentIsNamed) {
  Flight late;
  late.planner_delay = from_seconds(0.2);  // in force after 0.12 s
  ASSERT_TRUE(late.reach(State::rendezvous));
  ASSERT_TRUE(late.until(State::follow, 20));
  EXPECT_EQ(late.reason(), "the plan came too late");

  Flight silent;
  silent.planner_answers = false;
  ASSERT_TRUE(silent.reach(State::rendezvous));
  ASSERT_TRUE(silent.until(State::follow, 20));
  EXPECT_EQ(silent.reason(), "the planner does not answer");
}

// The answer to a question that is no longer asked.
TEST(Mission, AnAnswerToAnOlderQuestionIsNone) {
  Flight f;
  f.plan_age = 1;
  ASSERT_TRUE(f.reach(State::rendezvous));
  ASSERT_TRUE(f.until(State::follow, 20)) << to_string(f.state());
  EXPECT_EQ(f.reason(), "the planner does not answer");
}

TEST(Mission, AnOldPlanIsNotFlown) {
  Flight f;
  f.planner_delay = from_seconds(0.08);
  ASSERT_TRUE(f.reach(State::rendezvous));
  while (f.requests.empty()) f.step();
  f.wish = OperatorWish::hold;
  f.run(1);
  EXPECT_EQ(f.state(), State::hold);
  const Vector3 end = f.mission().reference(f.now() + from_seconds(10)).p_NB;
  EXPECT_TRUE(end.isApprox(places_for({}, f.rig()).follow_point, 1e-9));
}

TEST(Mission, TooFarFromTheTrajectoryGoesAround) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  f.run(0.3);
  f.off = Vector3(0.3, 0, 0);
  f.run(0.3);
  EXPECT_EQ(f.state(), State::land);
  f.off = Vector3(0.36, 0, 0);
  f.run(0.02);
  expect_last(f, State::land, State::go_around, "too far from the trajectory");
  f.off.setZero();
  ASSERT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 2);
}

TEST(Mission, NotOverThePadAtTheCommitHeightGoesAround) {
  for (const double way : {0.0, 1.0, 2.5, 4.0}) {
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    f.run(0.3);
    f.off = 0.13 * Vector3(std::cos(way), std::sin(way), 0);
    ASSERT_TRUE(f.until(State::go_around, 15)) << to_string(f.state());
    expect_last(f, State::land, State::go_around,
                "not over the pad at the commit height");
    EXPECT_GT(f.x().p_NB.z(), f.rig().drone.gear_height_m + 0.03);
    f.off.setZero();
    EXPECT_TRUE(f.until(State::complete));
  }
}

TEST(Mission, AMissThatPassesJustBelowTheCommitHeightIsNoReasonToLeave) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  f.run(0.3);
  // It waits, tires of waiting, and sinks.
  f.off = Vector3(0.13, 0, 0);
  const double below = f.rig().drone.gear_height_m + MissionConfig().commit_height_m;
  for (int i = 0; i < 3000 && f.x().p_NB.z() > below - 0.005; ++i) f.step();
  ASSERT_LT(f.x().p_NB.z(), below);
  EXPECT_EQ(f.state(), State::land);
  f.off.setZero();
  EXPECT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 1);
}

TEST(Mission, BelowTheCommitHeightItLandsWhateverComes) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.wish = OperatorWish::hold;
  f.off = Vector3(0.12, 0, 0);
  f.run(0.1);
  EXPECT_EQ(f.state(), State::land);
  EXPECT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 1);
}

TEST(Mission, PastTheCommitHeightBlownOffThePadItLeavesWhileThereIsRoom) {
  for (const bool room : {true, false}) {
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    ASSERT_TRUE(f.until_below(f.rig().drone.gear_height_m + (room ? 0.05 : 0.012)));
    // One pair of its feet would be off.
    f.off = Vector3(0.18, 0, 0);
    f.run(0.05);
    if (room) {
      EXPECT_EQ(f.state(), State::go_around);
      EXPECT_EQ(f.reason(), "the pad is not beneath it");
    } else {
      EXPECT_NE(f.state(), State::go_around);
    }
  }
}

TEST(Mission, WhatIsKnownTooVaguelyIsNotLandedBy) {
  for (const double sd : {0.04, 0.06}) {
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    f.run(0.5);
    f.miss_sd_m = sd;
    f.run(0.3);
    EXPECT_EQ(f.state(), sd < 0.05 ? State::land : State::go_around) << sd;
    if (sd > 0.05) {
      EXPECT_EQ(f.reason(), "too few LEDs are seen to land by");
    }
    f.miss_sd_m = 0.02;
    EXPECT_TRUE(f.until(State::complete));
  }
}

// To go around with an empty battery is to be left to its autopilot over the platform.
TEST(Mission, WithAnEmptyBatteryAVagueLandingGoesOn) {
  for (const double battery : {0.1, 0.03}) {
    SCOPED_TRACE(battery);
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    f.battery = battery;
    f.run(0.5);
    ASSERT_EQ(f.reason(), "the battery is low: the landing goes on");
    f.miss_sd_m = 0.06;
    f.run(0.3);
    EXPECT_EQ(f.state(), battery < 0.05 ? State::land : State::go_around);
    if (battery < 0.05) {
      EXPECT_TRUE(f.until(State::complete));
    }
  }
}

TEST(Mission, ACommittedLandingGoesOnHoweverVague) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.miss_sd_m = 0.2;
  EXPECT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 1);
}

TEST(Mission, NoTouchDownWhereThePadShouldBeGoesAround) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.off = Vector3(0, 0, 0.2);
  ASSERT_TRUE(f.until(State::go_around, 10));
  EXPECT_EQ(f.reason(), "no touch-down where the pad should be");
  EXPECT_EQ(f.orders_disarm, 0) << "motors run as long as it flies";
}

TEST(Mission, CarriedByWhatTheRigHasTooLowItStands) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.off = Vector3(0, 0, 0.12);  // at rest 4 cm above gear height, though pushed down
  ASSERT_TRUE(f.until(State::shut_down, 3));
  EXPECT_EQ(f.reason(), "stands on the pad");
}

TEST(Mission, TooManyFailedLandingsHold) {
  MissionConfig config;
  config.safety.landings_max = 3;
  Flight f(config);
  f.plans_feasible = false;
  ASSERT_TRUE(f.reach(State::hold));
  EXPECT_EQ(f.reason(), "no trajectory keeps the view") << "more plans will not help";
  EXPECT_EQ(f.mission().status().attempts, 3);
  f.plans_feasible = true;
  f.run(10);
  EXPECT_EQ(f.state(), State::hold) << "until the operator says otherwise";
  EXPECT_TRUE(f.x().p_NB.isApprox(places_for(config, f.rig()).follow_point, 1e-6));
  f.wish = OperatorWish::go;
  f.step();
  expect_last(f, State::hold, State::follow, "the operator goes on");
  EXPECT_EQ(f.mission().status().attempts, 0);
  EXPECT_TRUE(f.until(State::complete));
}

constexpr const char* kTooFastSaid =
    "the platform is too fast for the drone's speed limit: no landing";

TEST(Mission, APlatformThatIsTooFastIsRefusedBeforeTheStart) {
  Flight f;
  f.platform_speed = 1.01 * f.rig().limits.speed_m_s;
  ASSERT_TRUE(f.reach(State::refused));
  EXPECT_EQ(f.reason(), kTooFastSaid);
  EXPECT_EQ(f.orders_arm, 0);
}

TEST(Mission, OnAPlatformThatBecomesTooFastItEndsSoonAsTheUserWants) {
  for (const WhenFailed wanted : {WhenFailed::hold, WhenFailed::leave}) {
    for (const State state : {State::follow, State::go_around, State::rendezvous}) {
      SCOPED_TRACE(to_string(state));
      MissionConfig config;
      config.safety.when_failed = wanted;
      Flight f(config);
      ASSERT_TRUE(bring(f, state));
      f.platform_speed = 1.01 * f.rig().limits.speed_m_s;
      const State end = wanted == WhenFailed::hold ? State::hold : State::aborted;
      ASSERT_TRUE(f.until(end, 1));
      EXPECT_EQ(f.reason(), kTooFastSaid);
    }
  }
}

TEST(Mission, APlatformThatIsTooFastForAMomentIsNone) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.platform_speed = 1.5 * f.rig().limits.speed_m_s;
  f.run(0.4);
  f.platform_speed = 0.9;
  EXPECT_TRUE(f.until(State::complete));
}

TEST(Mission, PlansThatFailOnAFastPlatformAreItsFault) {
  Flight f;
  f.plans_feasible = false;
  f.platform_speed = 0.9 * f.rig().limits.speed_m_s;
  ASSERT_TRUE(f.reach(State::hold));
  EXPECT_EQ(f.reason(), kTooFastSaid);
  EXPECT_EQ(f.mission().status().attempts, 1);
}

TEST(Mission, WithoutOdometryItHoldsUntilThereIsSomeAgain) {
  for (const State state : {State::follow, State::rendezvous}) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.platform = false;
    ASSERT_TRUE(f.until(State::hold, 10));
    EXPECT_EQ(f.reason(), "no platform odometry comes");
    f.run(30);
    EXPECT_EQ(f.state(), State::hold);
    // A burst of losses does not change why it holds.
    f.mode = AutopilotMode::failsafe;
    f.run(0.3);
    EXPECT_EQ(f.reason(), "set-points do not arrive: the autopilot acts alone");
    f.mode = AutopilotMode::offboard;
    f.step();
    EXPECT_EQ(f.state(), State::hold);
    EXPECT_EQ(f.reason(), "no platform odometry comes");
    f.platform = true;
    f.step();
    expect_last(f, State::hold, State::follow, "the platform odometry is back");
    EXPECT_TRUE(f.until(State::complete));
  }
}

TEST(Mission, OdometryThatComesBackDoesNotOverruleTheOperator) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.platform = false;
  ASSERT_TRUE(f.until(State::hold, 10));
  f.wish = OperatorWish::hold;
  f.step();
  f.platform = true;
  f.run(5);
  EXPECT_EQ(f.state(), State::hold);
  f.wish = OperatorWish::go;
  EXPECT_TRUE(f.until(State::complete));
}

// What it is thrown out of its way by, it goes on from where it is: a reference that
// has run away would be flown after through whatever is between.
TEST(Mission, FarOffItsWayTheReferenceComesToTheDrone) {
  for (const State state :
       {State::follow, State::go_around, State::hold, State::rendezvous}) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.off = Vector3(-0.5, 0.3, 0.4);
    f.run(0.03);
    EXPECT_LT((f.mission().reference(f.now()).p_NB - f.x().p_NB).norm(), 0.75);
    EXPECT_TRUE(std::any_of(f.transitions.begin(), f.transitions.end(), [](auto& t) {
      return std::string(t.reason) == "far off its way: it goes on from where it is";
    }));
    f.off.setZero();
    if (state == State::hold) f.wish = OperatorWish::go;
    EXPECT_TRUE(f.until(State::complete));
  }
}

// Blown back towards it, it is left after all.
TEST(Mission, APlatformThatWaitsBesideADroneDrivesOnFromOneThatIsBlownNear) {
  for (const bool blown : {false, true}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    f.wish = OperatorWish::abort;
    while (f.orders_land == 0) f.step();
    f.mode = AutopilotMode::land;
    f.run(0.5);
    ASSERT_EQ(f.state(), State::aborted);
    ASSERT_LT(f.c.platform_speed_wish, 1);
    for (int i = 0; i < 30; ++i) {
      if (blown) f.x().v_NB = Vector3(1, 0, 0);
      f.step();
    }
    EXPECT_EQ(f.c.platform_speed_wish == 1, blown);
  }
}

// The platform neither stops beneath a drone that lands by itself nor runs into it
// later.
TEST(Mission, ThePlatformWaitsForADroneThatLandsBesideIt) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  EXPECT_EQ(f.c.platform_speed_wish, 1);
  f.wish = OperatorWish::abort;
  f.run(10);
  ASSERT_EQ(f.state(), State::aborted);
  ASSERT_GT(f.orders_land, 0);
  EXPECT_EQ(f.c.platform_speed_wish, 0);
  f.motors_stop = true;
  f.run(5);
  EXPECT_EQ(f.c.platform_speed_wish, 0) << "it lies there";
}

// The wind blows a drone that its autopilot lands after a platform that stops in its
// lee: then the platform had better drive on.
TEST(Mission, ThePlatformDoesNotStopWhereTheWindBlowsTheDrone) {
  for (const double push : {0.0, -1.2, 1.2}) {
    SCOPED_TRACE(push);
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    f.push_N = Vector3(push, 0, 0);
    f.wish = OperatorWish::abort;
    f.run(0.5);
    ASSERT_TRUE(f.until(State::aborted, 1) || f.state() == State::aborted);
    for (int i = 0; i < 400 && f.orders_land == 0; ++i) f.step();
    ASSERT_GT(f.orders_land, 0);
    f.mode = AutopilotMode::land;
    f.run(1);
    if (push > 0) {
      EXPECT_EQ(f.c.platform_speed_wish, 1) << "blown after it";
    } else {
      EXPECT_LT(f.c.platform_speed_wish, 0.5) << "to be seen to the floor";
    }
  }
}

// Beside the platform the autopilot does not see that it stands, and leans until it
// tips over.
TEST(Mission, MotorsStopOnceADroneStandsOnTheFloor) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.wish = OperatorWish::abort;
  f.run(5);
  ASSERT_EQ(f.state(), State::aborted);
  ASSERT_GT(f.orders_land, 0);
  f.mode = AutopilotMode::land;
  EXPECT_EQ(f.orders_disarm, 0);
  f.stands_on_floor = true;
  f.run(0.3);
  EXPECT_GT(f.orders_disarm, 0);
  EXPECT_FALSE(f.armed());
  EXPECT_EQ(f.state(), State::aborted);
  EXPECT_EQ(f.reason(), "the operator aborted: the autopilot lands");
  EXPECT_EQ(std::count_if(f.transitions.begin(), f.transitions.end(),
                          [](const MissionTransition& t) {
                            return std::string(t.reason) ==
                                   "stands on the floor: its motors are stopped";
                          }),
            1);
}

TEST(Mission, MotorsStopOnTheFloorAlsoWhereTheLinkWasLostAndIsBack) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.mode = AutopilotMode::failsafe;
  ASSERT_TRUE(f.until(State::lost_link, 3));
  f.run(1);
  EXPECT_EQ(f.orders_disarm, 0);
  f.stands_on_floor = true;
  f.run(0.3);
  EXPECT_GT(f.orders_disarm, 0);
  EXPECT_EQ(f.state(), State::complete);
}

TEST(Mission, EachFailedLandingIsFollowedByALongerWait) {
  Flight f;
  f.plans_feasible = false;
  ASSERT_TRUE(f.reach(State::follow));
  Seconds last = 0;
  for (int i = 0; i < 2; ++i) {  // a third time without a plan is the last
    ASSERT_TRUE(f.until(State::rendezvous, 60));
    ASSERT_TRUE(f.until(State::follow, 60));
    const Time began = f.now();
    Flight copy = f;
    ASSERT_TRUE(copy.until(State::rendezvous, 60));
    const Seconds waited = to_seconds(copy.now() - began);
    if (i > 0) {
      EXPECT_NEAR(waited - last, MissionConfig{}.settle_more_s, 0.05);
    }
    last = waited;
  }
}

TEST(Mission, TheOperatorHoldsAndGoesOn) {
  for (const State state :
       {State::follow, State::rendezvous, State::land, State::go_around}) {
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.wish = OperatorWish::hold;
    f.step();
    expect_last(f, state, State::hold, "the operator holds");
    f.run(20);
    EXPECT_EQ(f.state(), State::hold);
    f.wish = OperatorWish::go;
    f.step();
    expect_last(f, State::hold, State::follow, "the operator goes on");
    EXPECT_TRUE(f.until(State::complete));
    EXPECT_LT(f.reference_jump_m, 1e-6);
  }
}

TEST(Mission, MotorsThatStopInTheAirEndIt) {
  for (const State state : kInTheAir) {
    if (state == State::land) continue;
    SCOPED_TRACE(to_string(state));
    Flight f;
    ASSERT_TRUE(bring(f, state));
    f.motors_stop = true;
    f.run(0.05);
    expect_last(f, state, State::aborted, "the autopilot stopped its motors");
    EXPECT_FALSE(f.mission().flying());
    EXPECT_EQ(f.orders_land, 0);
  }
}

TEST(Mission, MotorsThatStopDuringTheApproachEndItToo) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  f.run(0.3);
  f.motors_stop = true;
  for (int i = 0; i < 100 && f.state() != State::aborted; ++i) {
    f.off.z() = -0.5 * kGravity * i * i * 1e-4;
    f.step();
  }
  EXPECT_EQ(f.state(), State::aborted);
  EXPECT_EQ(f.reason(), "the autopilot stopped its motors");
}

// Light on its feet a drone slides or tips before it flies: feedback cannot wait.
TEST(Mission, SlippingOrTippingAtTakeOffCountsAsLifted) {
  struct Case {
    Vector3 slid;
    double tip_deg;
    bool lifts;
  };
  const MissionConfig config;
  const double slip = config.slip_m, tip = config.slip_tilt_deg;
  const Case cases[] = {{{1.1 * slip, 0, 0}, 0, true},
                        {{0, -1.1 * slip, 0}, 0, true},
                        {{0.9 * slip, 0, 0}, 0, false},
                        {{0, 0, 0}, 1.1 * tip, true},
                        {{0, 0, 0}, -1.1 * tip, true},
                        {{0, 0, 0}, 0.9 * tip, false},
                        {{0, 0, 0.014}, 0, true},
                        {{0, 0, 0.008}, 0, false},
                        // Over a foot: the middle rises, but it stands.
                        {{0, 0, 0.0155}, 0.8 * tip, false},
                        {{0, 0, 0.03}, 0.8 * tip, true}};
  for (const Case& c : cases) {
    SCOPED_TRACE(testing::Message() << c.slid.transpose() << " m, " << c.tip_deg);
    Flight f;
    f.lifts = false;
    f.slid = c.slid;
    f.tip = c.tip_deg * kDegree;
    ASSERT_TRUE(f.reach(State::taken_off));
    bool lifted = false;
    for (int i = 0; i < 1000 && f.state() == State::taken_off && !lifted; ++i) {
      f.step();
      lifted = f.c.lifted;
    }
    EXPECT_EQ(lifted, c.lifts);
    EXPECT_EQ(f.mission().flying(), c.lifts);
    if (!lifted) {
      EXPECT_EQ(f.state(), State::refused);
      EXPECT_EQ(f.reason(), "did not leave the ground");
      continue;
    }
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
    EXPECT_EQ(f.c.lifted_since > 0, c.slid.z() > 0) << "only a rise has a past";
    EXPECT_TRUE(f.until(State::complete));
  }
}

// How far it slid is told later than that it slides.
TEST(Mission, SlidingAtTakeOffIsAnsweredBeforeItHasComeFar) {
  const MissionConfig config;
  struct Case {
    double far, speed;
    bool lifts;
  };
  for (const Case& c : {Case{0.0015, 1.2 * config.slip_m_s, true},
                        Case{0.0015, 0.8 * config.slip_m_s, false},
                        Case{0.0005, 1.2 * config.slip_m_s, false}}) {
    SCOPED_TRACE(testing::Message() << c.far << " m, " << c.speed << " m/s");
    Flight f;
    f.lifts = false;
    ASSERT_TRUE(f.reach(State::taken_off));
    f.slid.y() = c.far;
    f.slides = Vector3(0, c.speed, 0);
    double share = 0;
    for (int i = 0; i < 1000 && f.state() == State::taken_off && !f.c.lifted; ++i) {
      f.step();
      share = f.c.ramp_share;
    }
    EXPECT_EQ(f.c.lifted, c.lifts);
    EXPECT_GT(share, 0.74) << "with its weight on its feet it cannot";
  }
}

// Seen to slide it may stand yet: leaning it would tip over, and what the ground
// carries must not keep thrust from growing.
TEST(Mission, WhatSlidesBeforeItLiftsGoesOnLeavingTheGround) {
  Flight f;
  f.lifts = false;
  f.slid = Vector3(1.1 * MissionConfig{}.slip_m, 0, 0);
  ASSERT_TRUE(f.reach(State::taken_off));
  while (!f.c.lifted && f.state() == State::taken_off) f.step();
  ASSERT_TRUE(f.c.lifted);
  const double gear = f.rig().drone.gear_height_m;
  double least = 0.8;
  for (int i = 0; i < 20; ++i) {
    f.x().p_NB.z() = gear;
    f.step();
    EXPECT_GT(f.c.thrust_least, least);
    least = f.c.thrust_least;
  }
  // Leaning, a foot of it stands there still.
  f.x().p_NB.z() = gear + 0.03;
  f.x().R_NB = from_rpy(0, 15 * kDegree, 0);
  f.step();
  EXPECT_GT(f.c.thrust_least, least);
  least = f.c.thrust_least;
  // Said to have left, it is not until a picture shows it.
  f.x().p_NB.z() = gear;
  f.x().R_NB = Matrix3::Identity();
  f.step();
  f.sight = false;
  f.x().p_NB.z() = gear + 0.1;
  f.step();
  EXPECT_GT(f.c.thrust_least, least);
  f.sight = true;
  f.x().p_NB.z() = gear + 0.03;
  f.step();
  EXPECT_LT(f.c.thrust_least, 1);
  EXPECT_GT(f.c.thrust_least, 0.85) << "or it comes down again";
  f.x().p_NB.z() = gear + 0.35;
  f.step();
  EXPECT_EQ(f.c.thrust_least, 0);
}

// What slides has not yet all its weight on its rotors: that says nothing of them.
TEST(Mission, OnlyARiseTellsWhatTheThrustIsWorth) {
  for (const bool slides : {true, false}) {
    SCOPED_TRACE(slides);
    Flight f;
    f.lifts = !slides;
    if (slides) f.slid = Vector3(1.1 * MissionConfig{}.slip_m, 0, 0);
    ASSERT_TRUE(f.reach(State::taken_off));
    while (!f.c.lifted && f.state() == State::taken_off) f.step();
    ASSERT_TRUE(f.c.lifted);
    EXPECT_EQ(f.c.carried, !slides);
  }
}

// Not seen, it may be lower than it is believed to be: low it had better climb, the
// more, the longer that lasts. High up there is room, and seen there is no doubt.
TEST(Mission, UnseenAndLowItIsFlownAsIfItHadSunk) {
  for (const double above : {0.1, 0.3, 0.8}) {
    SCOPED_TRACE(above);
    Flight f;
    ASSERT_TRUE(f.reach(State::taken_off));
    f.run(0.5);
    f.lifts = false;
    const double z = f.rig().drone.gear_height_m + above;
    f.x().p_NB.z() = z;
    f.step();
    EXPECT_EQ(f.c.raise_m, 0);
    f.sight = false;
    double raise = 0;
    for (int i = 0; i < 80; ++i) {
      f.x().p_NB.z() = z;
      f.step();
      ASSERT_EQ(f.c.mode, MissionCommand::Mode::track);
      EXPECT_GE(f.c.raise_m, raise);
      EXPECT_LE(f.c.raise_m - raise, 0.01) << "a jump";
      EXPECT_TRUE(f.c.raise_m_s == 0 || f.c.raise_m > 0);
      raise = f.c.raise_m;
    }
    EXPECT_EQ(f.state(), State::lost_target);
    EXPECT_NEAR(raise, std::clamp(0.3 - above + 0.15, 0.0, 0.3), 0.02);
    f.sight = true;
    f.step();
    EXPECT_EQ(f.c.raise_m, 0);
    EXPECT_EQ(f.c.raise_m_s, 0);
  }
}

// Blind, the autopilot leans on the floor until its motors stop.
TEST(Mission, ADroneThatIsAbortedInSightIsSeenToTheFloor) {
  for (const bool seen : {true, false}) {
    SCOPED_TRACE(seen);
    Flight f;
    ASSERT_TRUE(f.reach(State::rendezvous));
    f.wish = OperatorWish::abort;
    while (f.orders_land == 0) f.step();
    f.sight = seen;
    f.run(0.5);
    f.mode = AutopilotMode::land;
    f.step();
    f.run(1);
    EXPECT_NEAR(f.c.platform_speed_wish, seen ? std::exp(-1.0) : 1, 0.02);
    f.run(4);
    EXPECT_EQ(f.c.platform_speed_wish, 0) << "nor does it come round again";
  }
}

TEST(Mission, ADeckThatSwingsIsWaitedForUntilItIsLevelOrTheBatteryLow) {
  for (const bool battery_falls : {false, true}) {
    SCOPED_TRACE(battery_falls);
    Flight f;
    f.deck_swing = 1;
    f.deck_lean = 30 * kDegree;
    ASSERT_TRUE(f.reach(State::land));
    f.run(12);
    EXPECT_EQ(f.state(), State::land);
    EXPECT_NE(f.reason(), "past the commit height: it lands");
    EXPECT_GT(f.x().p_NB.z(), f.rig().drone.gear_height_m + 0.08);
    (battery_falls ? f.battery : f.deck_lean) = battery_falls ? 0.1 : 0;
    EXPECT_TRUE(f.until(State::complete, 5));
  }
}

TEST(Mission, UnseenItIsNotThoughtToHaveLifted) {
  Flight f;
  ASSERT_TRUE(f.reach(State::taken_off));
  f.sight = false;
  double share = 0;
  while (f.state() == State::taken_off) {
    f.step();
    share = std::max(share, f.c.ramp_share);
  }
  // Thrust has not exceeded the weight for long enough to climb.
  EXPECT_LT(share, 1.05);
  EXPECT_EQ(f.state(), State::idle);
  EXPECT_EQ(f.reason(), "the LEDs are out of sight");
  f.run(1);
  EXPECT_FALSE(f.armed());
  ASSERT_TRUE(f.until(State::refused, 10));
  EXPECT_EQ(f.reason(), "the LEDs are not seen on the pad");
  EXPECT_FALSE(f.mission().flying());
}

TEST(Mission, ADroneThatIsNoLongerSeenAsItLiftsComesDownSoftly) {
  for (const double lost_at : {0.8, 0.95, 1.0, 1.1, 1.2}) {
    SCOPED_TRACE(lost_at);
    Flight f;
    ASSERT_TRUE(f.ramp_up_to(lost_at));
    f.sight = false;
    const Time lost = f.now();
    // Two pictures are missing: less than carries it, and for long enough to come down.
    while (f.c.ramp_share > 0.75 && f.state() == State::taken_off) f.step();
    EXPECT_LT(to_seconds(f.now() - lost), 0.12);
    const Time down = f.now();
    double wish = 1;
    while (f.state() == State::taken_off) {
      wish = f.c.platform_speed_wish;  // the wind brakes it
      EXPECT_EQ(f.c.mode, MissionCommand::Mode::ramp);
      EXPECT_LE(f.c.ramp_share, 0.75);
      EXPECT_GT(f.c.ramp_share, 0.5) << "it falls";
      EXPECT_EQ(f.orders_disarm, 0);
      f.step();
    }
    EXPECT_GT(to_seconds(f.now() - down), 0.4);
    EXPECT_LT(wish, 0.6);
    EXPECT_EQ(f.orders_disarm, 1);
    // Seen again it starts anew.
    f.sight = f.lifts = true;
    EXPECT_TRUE(f.until(State::follow, 20));
  }
}

// Of the drone's place and thrust nothing is known then but what pictures show.
TEST(Mission, ALinkThatFailsAsItLiftsEndsTheStartAndThePlatformBrakes) {
  for (const double lost_at : {0.8, 0.95, 1.0, 1.1}) {
    SCOPED_TRACE(lost_at);
    Flight f;
    f.slid.z() = 0.006;  // it may have
    ASSERT_TRUE(f.ramp_up_to(lost_at));
    f.link_up = false;
    double most = 0, wish = 1;
    const Time lost = f.now();
    const auto step = [&] {
      f.step();
      EXPECT_LE(f.c.platform_speed_wish, wish);
      wish = f.c.platform_speed_wish;
    };
    while (f.state() == State::taken_off) {
      step();
      if (to_seconds(f.now() - lost) > 0.25) most = std::max(most, f.c.ramp_share);
    }
    EXPECT_LT(most, 0.75) << "less than carries it";
    EXPECT_EQ(f.reason(), "the radio link is not healthy");
    EXPECT_EQ(f.orders_disarm, 1);
    EXPECT_LT(wish, 0.6);
    for (int i = 0; i < 300; ++i) step();
    EXPECT_LT(wish, 0.01) << "its motors may turn still";
    // Heard again it is disarmed, and starts anew.
    f.link_up = f.lifts = true;
    EXPECT_TRUE(f.until(State::follow, 20));
  }
}

// With less than its weight on its feet the wind would push it over the pad's edge.
TEST(Mission, ALinkThatFailsWhileItStandsEndsTheStartAtOnce) {
  for (const double lost_at : {0.75, 0.9}) {
    SCOPED_TRACE(lost_at);
    Flight f;
    f.slid = Vector3(0.0009, 0, 0.0015);  // what a drone that stands shows
    ASSERT_TRUE(f.ramp_up_to(lost_at));
    f.link_up = false;
    const Time lost = f.now();
    while (f.state() == State::taken_off) f.step();
    EXPECT_LT(to_seconds(f.now() - lost), 0.25);
    EXPECT_EQ(f.reason(), "the radio link is not healthy");
    EXPECT_EQ(f.orders_disarm, 1);
    f.link_up = f.lifts = true;
    EXPECT_TRUE(f.until(State::follow, 20));
  }
}

TEST(Mission, ItStartsOnlyOnItsFeetOnThePad) {
  const auto starts = [](auto&& place, bool anew) {
    Flight f;
    if (anew) {
      // The first start ends before it lifts, and has it where `place` says.
      EXPECT_TRUE(f.reach(State::taken_off));
      f.sight = false;
      EXPECT_TRUE(f.until(State::idle, 5));
      f.sight = true;
    }
    f.wish = OperatorWish::go;
    for (int i = 0; i < 1000 && f.state() == State::idle; ++i) {
      place(f);
      f.step();
    }
    if (f.state() != State::armed) {
      EXPECT_EQ(f.state(), State::refused);
      EXPECT_EQ(f.reason(), "the drone does not stand on the pad");
    }
    return f.state() == State::armed;
  };
  for (const bool anew : {false, true}) {
    SCOPED_TRACE(anew);
    EXPECT_TRUE(starts([](Flight&) {}, anew));
    EXPECT_FALSE(
        starts([](Flight& f) { f.x().R_NB = so3_exp(Vector3(kPi, 0, 0)); }, anew))
        << "upside down";
    EXPECT_FALSE(starts([](Flight& f) { f.x().p_NB = Vector3(-0.3, 0, 0.06); }, anew))
        << "beside";
    EXPECT_FALSE(starts([](Flight& f) { f.x().p_NB.z() = -0.2; }, anew)) << "fallen";
    EXPECT_EQ(starts([](Flight& f) { f.x().v_NB = Vector3(0.2, 0, 0); }, anew), !anew)
        << "sliding";
  }
  // Leaning on something; or of a rig that is off, until it has been seen to stand.
  const auto leans = [](Flight& f) {
    f.x().p_NB = Vector3(0, 0, 0.02);
    f.x().R_NB = so3_exp(Vector3(0, 0.35, 0));
  };
  EXPECT_FALSE(starts(leans, true));
  EXPECT_TRUE(starts(leans, false));
}

TEST(Mission, AFailsafeWithFeetOnThePadIsTheEnd) {
  for (const bool seen : {false, true}) {
    SCOPED_TRACE(seen);
    Flight f;
    f.slid = Vector3(0.02, 0, 0);
    f.lifts = false;
    ASSERT_TRUE(f.reach(State::taken_off));
    while (!f.c.lifted) f.step();  // for it slides
    f.sight = seen;
    f.run(0.1);
    f.mode = AutopilotMode::failsafe;
    f.step();
    ASSERT_EQ(f.state(), State::lost_link);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
    f.run(1);
    // Seen to stand there it is told to stop its motors.
    EXPECT_EQ(f.orders_disarm > 0, seen);
    if (seen) {
      EXPECT_EQ(f.state(), State::complete);
    } else {
      EXPECT_LT(f.c.platform_speed_wish, 0.2);
    }
  }
  // In the air a burst of losses may end.
  Flight high;
  ASSERT_TRUE(high.reach(State::follow));
  high.mode = AutopilotMode::failsafe;
  high.run(0.9);
  EXPECT_EQ(high.state(), State::follow);
}

TEST(Mission, ThrustThatMovesItAndPicturesThatDoNotChangeEndTheStart) {
  Flight f;
  f.lifts = false;
  f.picture_repeats = true;
  f.blindness = Blindness::frozen;
  ASSERT_TRUE(f.reach(State::taken_off));
  double most = 0;
  while (f.state() == State::taken_off) {
    f.step();
    most = std::max(most, f.c.ramp_share);
  }
  EXPECT_LT(most, 1.27);
  EXPECT_GT(most, 1.2) << "a heavy drone under a camera without noise still starts";
  EXPECT_EQ(f.reason(), "the camera repeats its picture");
  // The same without an end: it is refused, and stands disarmed.
  ASSERT_TRUE(f.until(State::refused, 60));
  f.run(2);
  EXPECT_FALSE(f.armed());
}

/// The platform's wish, step by step, from when the link goes at a height of `z` above
/// the pad's middle.
std::vector<double> wishes_without_link(double z, double speed, Seconds silent_s) {
  Flight f;
  EXPECT_TRUE(bring(f, State::land));
  f.platform_speed = speed;
  f.x().p_NB = Vector3(0, 0, z);
  f.off = f.x().p_NB - f.mission().reference(f.now() + kStep).p_NB;
  f.link_up = false;
  std::vector<double> wishes;
  for (const Time end = f.now() + from_seconds(silent_s); f.now() < end;) {
    f.x().p_NB = Vector3(0, 0, z);
    f.x().v_NB = Vector3(0, 0, -1);  // not as it is told
    f.step();
    wishes.push_back(f.c.platform_speed_wish);
  }
  f.link_up = true;
  f.run(0.3);
  wishes.push_back(f.c.platform_speed_wish);
  return wishes;
}

TEST(Mission, APlatformThatStopsBeneathALandingIsAskedToStay) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  EXPECT_EQ(f.c.platform_speed_wish, 1);
  f.platform_speed = 0.5;  // slower, for a bend
  f.run(0.1);
  EXPECT_EQ(f.c.platform_speed_wish, 1);
  f.platform_speed = 0.1;
  f.run(0.1);
  EXPECT_EQ(f.c.platform_speed_wish, 0);
  f.platform_speed = 0.9;  // Whatever it does: it is not told to go.
  while (f.state() == State::land || f.state() == State::shut_down) {
    EXPECT_EQ(f.c.platform_speed_wish, 0);
    f.step();
  }
  ASSERT_EQ(f.state(), State::complete);
  EXPECT_EQ(f.c.platform_speed_wish, 1);

  Flight around;
  ASSERT_TRUE(around.reach(State::land));
  around.platform_speed = 0;
  around.run(0.1);
  EXPECT_EQ(around.c.platform_speed_wish, 0);
  around.off = Vector3(0.4, 0, 0);
  ASSERT_TRUE(around.until(State::go_around, 3));
  EXPECT_EQ(around.c.platform_speed_wish, 1);

  // Its odometry drifts meanwhile, which alone stops nothing.
  Flight drifts;
  ASSERT_TRUE(drifts.reach(State::land));
  drifts.platform_slip = 0.3;
  drifts.run(0.1);
  EXPECT_EQ(drifts.c.platform_speed_wish, 1);
  drifts.platform_speed = 0;
  drifts.run(0.1);
  EXPECT_EQ(drifts.c.platform_speed_wish, 0);

  Flight still;
  still.platform_speed = 0.15;
  ASSERT_TRUE(still.reach(State::land));
  still.platform_speed = 0;
  still.run(0.1);
  EXPECT_EQ(still.c.platform_speed_wish, 1) << "nothing has stopped";
}

TEST(Mission, LowOverThePadThePlatformBrakesAsTheSilentDroneDoes) {
  for (const double speed : {0.3, 0.9, 2.0}) {
    SCOPED_TRACE(speed);
    const auto wishes = wishes_without_link(0.1, speed, 2.5);
    double before = 1;
    for (std::size_t i = 0; i + 1 < wishes.size(); ++i) {
      EXPECT_LE(wishes[i], before);
      before = wishes[i];
      // Nothing for a gap that a healthy link may have, and then as PX4 brakes.
      const Seconds silent = 0.01 * static_cast<double>(i + 1);
      const double as_it_brakes = std::exp(-(silent - 0.2) / 0.55);
      EXPECT_NEAR(wishes[i], silent < 0.2 ? 1 : as_it_brakes, 0.03);
    }
    EXPECT_LT(before, 0.02);
    EXPECT_EQ(wishes.back(), 1) << "the link is back";
  }
}

// The first that is seen of an autopilot that brakes by itself.
TEST(Mission, BeneathASilentDroneThatFallsBehindThePlatformBrakes) {
  for (const double behind : {0.1, 0.2}) {
    SCOPED_TRACE(behind);
    Flight f;
    ASSERT_TRUE(bring(f, State::land));
    ASSERT_TRUE(f.until_below(0.3));
    f.link_up = false;
    for (int i = 0; i < 50; ++i) {
      f.x().v_NB = f.mission().reference(f.now() + kStep).v_NB - Vector3(behind, 0, 0);
      f.step();
    }
    if (behind < 0.15) {
      EXPECT_EQ(f.c.platform_speed_wish, 1) << "as told, if not exactly";
    } else {
      EXPECT_LT(f.c.platform_speed_wish, 0.7);
    }
    EXPECT_EQ(f.state(), State::land);
  }
}

TEST(Mission, ASilentDroneThatAGustCarriesAlongStopsNoPlatform) {
  for (const Vector3& gust : {Vector3(0.4, 0, 0), Vector3(0, 0.4, 0.1)}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::land));
    ASSERT_TRUE(f.until_below(0.3));
    f.link_up = false;
    for (int i = 0; i < 50; ++i) {
      f.x().v_NB = f.mission().reference(f.now() + kStep).v_NB + gust;
      f.step();
    }
    EXPECT_EQ(f.state(), State::land);
    EXPECT_EQ(f.c.platform_speed_wish, 1);
  }
}

// Only its words are lost: what throws it off its way for a moment does not have it
// left to its autopilot, over a pad that drives.
TEST(Mission, AGustIsNoReasonToLeaveALandingThatIsNotHeard) {
  for (const bool comes_back : {true, false}) {
    SCOPED_TRACE(comes_back);
    Flight f;
    ASSERT_TRUE(bring(f, State::land));
    ASSERT_TRUE(f.until_below(0.35));
    f.link_up = false;
    f.run(0.9);
    ASSERT_EQ(f.state(), State::land);
    for (int i = 0; i < 150 && f.state() == State::land; ++i) {
      const bool strays = !comes_back || i % 75 < 60;
      const Vector3 off = strays ? Vector3(0.3, 0, 0) : Vector3::Zero();
      f.x().p_NB = f.mission().reference(f.now() + kStep).p_NB;
      f.x().v_NB = f.mission().reference(f.now() + kStep).v_NB + off;
      f.step();
    }
    EXPECT_EQ(f.state() == State::lost_link, !comes_back) << f.reason();
  }
}

// Once it brakes along with the drone that falls behind no more.
TEST(Mission, APlatformThatBrakesBeneathASilentDroneGoesOnBraking) {
  Flight f;
  ASSERT_TRUE(bring(f, State::land));
  ASSERT_TRUE(f.until_below(0.3));
  f.link_up = false;
  const double drove = f.platform_speed;
  for (int i = 0; i < 45; ++i) {
    const double slower = i < 25 ? 0.2 : 0.05;
    if (i >= 25) f.platform_speed = drove - 0.15;
    f.x().v_NB = f.mission().reference(f.now() + kStep).v_NB - Vector3(slower, 0, 0);
    f.step();
  }
  EXPECT_EQ(f.state(), State::land);
  EXPECT_LT(f.c.platform_speed_wish, 0.85);
}

TEST(Mission, ThePadIsKeptBeneathASilentDroneThatBrakesHarder) {
  Flight f;
  ASSERT_TRUE(bring(f, State::land));
  ASSERT_TRUE(f.until_below(0.3));
  f.link_up = false;
  const auto fall_behind = [&](double slower, double behind, Seconds silent_s) {
    for (const Time end = f.now() + from_seconds(silent_s); f.now() < end;) {
      f.x().p_NB = f.mission().reference(f.now() + kStep).p_NB - Vector3(behind, 0, 0);
      f.x().v_NB = f.mission().reference(f.now() + kStep).v_NB - Vector3(slower, 0, 0);
      f.step();
    }
    return f.c.platform_speed_wish;
  };
  EXPECT_EQ(fall_behind(0.45, 0, 0.1), 1) << "a gap that a healthy link may have";
  const double kept = fall_behind(0.45, 0, 0.15);
  EXPECT_GT(kept, 0.3);
  EXPECT_LT(kept, 0.6) << "half as fast as the pad";
  EXPECT_LT(fall_behind(0.45, 0.1, 0.02), kept - 0.15) << "and behind its middle";
  f.sight = false;
  f.run(0.2);
  const double unseen = f.c.platform_speed_wish;
  EXPECT_GT(unseen, kept) << "as the autopilot is known to brake";
  f.run(0.1);
  EXPECT_LT(f.c.platform_speed_wish, unseen);
}

TEST(Mission, FromBeneathADroneThatIsHighItDrivesOn) {
  for (const double speed : {0.9, 2.0}) {
    for (const double wish : wishes_without_link(0.9, speed, 2.5)) EXPECT_EQ(wish, 1);
  }
  // A slow one does not get away in time.
  const auto slow = wishes_without_link(0.9, 0.1, 2.5);
  EXPECT_LT(slow[slow.size() - 2], 0.05);
}

TEST(Mission, APilotWhoTakesOverLowOverThePadIsNotRunInto) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.2));
  f.mode = AutopilotMode::hold;
  f.run(0.5);
  ASSERT_EQ(f.state(), State::pilot);
  EXPECT_LT(f.c.platform_speed_wish, 0.5);
  f.run(4);
  EXPECT_EQ(f.c.platform_speed_wish, 0) << "nor does it come round";
  f.mode = AutopilotMode::offboard;
  f.run(0.1);
  EXPECT_EQ(f.c.platform_speed_wish, 1);
}

TEST(Mission, LedsLostWhileTheComputerStoodStillStayItsFault) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.sight = false;
  f.computer_was_late = true;
  f.blindness = Blindness::computer;
  ASSERT_TRUE(f.until(State::lost_target, 2));
  f.run(1);
  f.computer_was_late = false;
  f.blindness = Blindness::leds;
  ASSERT_TRUE(f.until(State::aborted, 4));
  EXPECT_EQ(f.reason(),
            "the computer stood still, the LEDs are lost: the autopilot lands");
}

// Past the commit it may stand on the pad after a second without a computer, or have
// slid off: in the first case the next picture shows it.
TEST(Mission, NotSeenAfterTheComputerStoodStillItDoesNotStandOnThePad) {
  for (const bool seen : {true, false}) {
    SCOPED_TRACE(seen);
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    for (int i = 0; i < 3000 && f.reason() != "past the commit height: it lands"; ++i) {
      f.step();
    }
    ASSERT_EQ(f.reason(), "past the commit height: it lands");
    f.computer_was_late = true;
    f.blindness = Blindness::computer;
    f.miss(0.2);
    f.run(0.02);
    f.sight = false;
    f.miss(0.2);
    f.run(0.12);
    EXPECT_EQ(f.state(), State::land) << "stood still again";
    f.sight = seen;
    f.run(0.1);
    if (seen) {
      EXPECT_TRUE(f.until(State::complete));
      continue;
    }
    EXPECT_EQ(f.state(), State::lost_target);
    EXPECT_EQ(f.reason(), "the computer stood still");
    EXPECT_EQ(f.orders_disarm, 0);
  }
}

TEST(Mission, LedsLostAfterTheAutopilotActedAloneAreLostForWantOfSetPoints) {
  for (const Seconds until_lost : {0.4, 3.0}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    f.mode = AutopilotMode::failsafe;
    f.run(0.3);
    EXPECT_EQ(f.state(), State::follow);
    EXPECT_EQ(f.reason(), "set-points do not arrive: the autopilot acts alone");
    const std::size_t told = f.transitions.size();
    f.run(0.2);
    EXPECT_EQ(f.transitions.size(), told) << "once";
    f.mode = AutopilotMode::offboard;
    f.run(until_lost);
    f.sight = false;
    ASSERT_TRUE(f.until(State::aborted, 6));
    EXPECT_EQ(f.reason(),
              until_lost < 1
                  ? "set-points did not arrive, the LEDs are lost: the autopilot lands"
                  : "the LEDs stay out of sight: the autopilot lands");
  }
}

TEST(Mission, FromTheFloorTheClimbIsBlindAndEndsInSight) {
  MissionConfig config;
  config.start_on_floor = true;
  Flight f(config);
  f.sight = false;
  f.wish = OperatorWish::go;
  ASSERT_TRUE(f.until(State::taken_off));
  EXPECT_EQ(f.c.platform_speed_wish, 0) << "the platform waits";
  f.run(1);
  EXPECT_EQ(f.state(), State::taken_off);
  f.x().p_NB = Vector3(-1, 0, 0.5);
  f.sight = true;
  f.step();
  expect_last(f, State::taken_off, State::follow, "in sight: to the follow point");
  EXPECT_TRUE(f.c.lifted);
  EXPECT_EQ(f.c.platform_speed_wish, 1);
  EXPECT_LT((f.mission().reference(f.now()).p_NB - Vector3(-1, 0, 0.5)).norm(), 1e-9);
  EXPECT_TRUE(f.until(State::complete));
}

TEST(Mission, FromTheFloorNeverInSightIsLandedByTheAutopilot) {
  MissionConfig config;
  config.start_on_floor = true;
  Flight f(config);
  f.sight = false;
  f.wish = OperatorWish::go;
  ASSERT_TRUE(f.until(State::aborted));
  EXPECT_EQ(f.reason(), "never came into sight: the autopilot lands");
  EXPECT_TRUE(f.mission().flying()) << "it may, unseen";
  EXPECT_EQ(f.orders_disarm, 0);
  EXPECT_GE(f.orders_land, 1);
}

TEST(Mission, ThePaperCutsThrustAtTheEndOfTheTrajectory) {
  MissionConfig config;
  config.cut_height_m = 0.14;
  Flight f(config);
  ASSERT_TRUE(f.reach(State::shut_down));
  EXPECT_EQ(f.reason(), "over the pad: thrust is cut");
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::idle);
  EXPECT_TRUE(f.until(State::complete));
}

TEST(Mission, SightLostForAReasonIsToldByIt) {
  struct Case {
    Blindness why;
    const char *lost, *given_up;
  };
  const Case cases[] = {
      {Blindness::pictures, "no pictures come from the camera",
       "no pictures come from the camera: the autopilot lands"},
      {Blindness::late, "the pictures come too late",
       "the pictures come too late: the autopilot lands"},
      {Blindness::frozen, "the camera repeats its picture",
       "the camera repeats its picture: the autopilot lands"},
      {Blindness::computer, "the computer stood still",
       "the computer stood still, the LEDs are lost: the autopilot lands"}};
  for (const Case& c : cases) {
    for (const State state : {State::follow, State::rendezvous, State::land}) {
      Flight f;
      ASSERT_TRUE(bring(f, state));
      f.sight = false;
      f.blindness = c.why;
      f.run(0.3);
      expect_last(f, state, State::lost_target, c.lost);
      ASSERT_TRUE(f.until(State::aborted, 8));
      EXPECT_EQ(f.reason(), c.given_up);
    }
  }
  // What is known later is told later, once.
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_target));
  f.blindness = Blindness::late;
  const std::size_t before = f.transitions.size();
  f.run(1.5);
  EXPECT_EQ(f.state(), State::lost_target);
  EXPECT_EQ(f.reason(), "the pictures come too late");
  EXPECT_EQ(f.transitions.size(), before + 1);
}

TEST(Mission, TheSearchGoesUpInView) {
  MissionConfig config;
  config.give_up_s = 6;
  Flight f(config);
  ASSERT_TRUE(bring(f, State::lost_target));
  f.run(4);
  const MissionConfig placed = places_for({}, f.rig());
  EXPECT_GT(placed.search_point.z(), placed.follow_point.z() + 0.1);
  EXPECT_TRUE(f.x().p_NB.isApprox(placed.search_point, 1e-6));
  for (int i = 0; i < f.rig().leds.size(); ++i) {
    EXPECT_TRUE(project_led(f.rig().camera,
                            make_pose(Matrix3::Identity(), placed.search_point),
                            f.rig().leds.p_BL(i)));
  }
}

// Given up unseen on a moving platform: at rest over the ground when the autopilot,
// which does not know its speed, takes over; without a jump on the way.
TEST(Mission, AnUnseenDroneIsStoppedOverTheGroundBeforeTheAutopilotLands) {
  Flight f;
  ASSERT_TRUE(bring(f, State::lost_target));
  ASSERT_TRUE(f.until(State::aborted, 8));
  EXPECT_EQ(f.orders_land, 0);
  Vector3 v = f.x().v_NB;
  while (f.orders_land == 0 && f.state() == State::aborted) {
    v = f.x().v_NB;
    f.step();
    EXPECT_LT((f.x().v_NB - v).norm(), 0.05);
  }
  const Vector3 platform(0.9, 0, 0);  // Flight's
  EXPECT_LT((v + platform).norm(), 0.2);
  EXPECT_LT(to_seconds(f.now() - f.transitions.back().t), 1.5);
}

/// With which speed over the ground, in N, a blind drone is left to its autopilot.
Vector3 left_blind_with(Flight& f, Blindness why = Blindness::pictures) {
  f.blindness = why;
  f.sight = false;
  EXPECT_TRUE(f.until(State::aborted, 8));
  Vector3 v_N = Vector3::Zero();
  while (f.orders_land == 0 && f.state() == State::aborted) {
    v_N = f.x().v_NB + Vector3(f.platform_speed, 0, 0);
    f.step();
  }
  EXPECT_LT(to_seconds(f.now() - f.transitions.back().t), 2);
  return v_N;
}

// Its autopilot keeps it level and the wind blows it away until it is down.
TEST(Mission, ABlindDroneIsLeftMovingAgainstTheWindThatIsKnown) {
  for (const Vector3& push : {Vector3(0, 0.3, 0), Vector3(-0.2, -0.15, 0.4)}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::rendezvous));
    f.push_N = push;
    const Vector3 v_N = left_blind_with(f);
    const Vector3 level(push.x(), push.y(), 0);
    EXPECT_LT((v_N + 1.1 * level).norm(), 0.25) << v_N.transpose();
    EXPECT_LT(v_N.dot(level), -0.05);
  }
  // No faster than it can be sure of.
  Flight stormy;
  ASSERT_TRUE(bring(stormy, State::rendezvous));
  stormy.push_N = Vector3(0, 3, 0);
  EXPECT_NEAR(left_blind_with(stormy).norm(), 0.8, 0.2);
  // What it met in its first second of flight may have been a gust.
  Flight early;
  ASSERT_TRUE(early.reach(State::taken_off));
  while (!early.mission().flying()) early.step();
  early.run(0.8);
  early.push_N = Vector3(0, 0.5, 0);
  EXPECT_LT(left_blind_with(early).norm(), 0.2);
  // Or it goes on to be told.
  Flight told;
  ASSERT_TRUE(told.reach(State::taken_off));
  while (!told.mission().flying()) told.step();
  told.run(0.8);
  told.push_N = Vector3(0, 0.5, 0);
  told.told_of = true;
  EXPECT_LT(left_blind_with(told).y(), -0.3);
  // As long as pictures come it may be seen again.
  Flight hidden;
  ASSERT_TRUE(bring(hidden, State::rendezvous));
  hidden.push_N = Vector3(0, 0.5, 0);
  EXPECT_LT(left_blind_with(hidden, Blindness::leds).norm(), 0.2);
}

TEST(Mission, WhereNoPicturesComeTheSearchIsShorter) {
  for (const Blindness why : {Blindness::pictures, Blindness::frozen}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    f.blindness = why;
    f.sight = false;
    ASSERT_TRUE(f.until(State::lost_target, 1));
    const Time since = f.now();
    ASSERT_TRUE(f.until(State::aborted, 8));
    EXPECT_NEAR(to_seconds(f.now() - since), MissionConfig{}.give_up_dark_s, 0.05);
  }
}

// Its reference waits above the commit height, where it was while nothing arrived.
TEST(Mission, LeftBesideThePadByItsAutopilotItGoesAroundWhereverItsReferenceIs) {
  struct Case {
    bool was_alone, obeys;
    double beside;
    bool leaves;
  };
  for (const Case& c :
       {Case{true, true, 0.25, true}, Case{true, false, 0.25, false},
        Case{false, true, 0.25, false}, Case{true, true, 0.15, false}}) {
    SCOPED_TRACE(testing::Message()
                 << c.was_alone << ", " << c.obeys << ", " << c.beside << " m");
    Flight f;
    ASSERT_TRUE(f.reach(State::land));
    ASSERT_TRUE(f.until_below(0.22));
    if (c.was_alone) f.mode = AutopilotMode::failsafe;
    f.step();
    f.off =
        Vector3(0, c.beside, 0.08 - f.mission().reference(f.now() + kStep).p_NB.z());
    ASSERT_LT(f.off.norm(), MissionConfig{}.go_around_error_m);
    if (c.obeys) f.mode = AutopilotMode::offboard;
    f.step();
    f.step();
    EXPECT_EQ(f.state(), c.leaves ? State::go_around : State::land);
    if (c.leaves) {
      EXPECT_EQ(f.reason(), "the pad is not beneath it");
    }
  }
}

// Height helps to be seen, and is the longer to fall.
TEST(Mission, WhereNoPicturesComeItDoesNotClimbToBeSeen) {
  const auto lost = [](Flight& f, Blindness why) {
    ASSERT_TRUE(bring(f, State::follow));
    f.blindness = why;
    f.sight = false;
    ASSERT_TRUE(f.until(State::lost_target, 1));
    f.run(0.9);
    ASSERT_EQ(f.state(), State::lost_target);
  };
  Flight lit;
  lost(lit, Blindness::leds);
  for (const Blindness why : {Blindness::pictures, Blindness::frozen}) {
    Flight f;
    lost(f, why);
    const double before = f.x().p_NB.z();
    EXPECT_LT(before, lit.x().p_NB.z() - 0.1);
    // Pictures come again, and show no LEDs.
    f.blindness = Blindness::leds;
    f.run(1);
    EXPECT_EQ(f.state(), State::lost_target);
    EXPECT_GT(f.x().p_NB.z(), before + 0.1);
  }
}

TEST(Mission, AFailsafeBeforeThrustCarriesItIsNoFlight) {
  for (const Seconds after : {0.03, 0.4}) {
    SCOPED_TRACE(after);
    Flight f;
    f.lifts = false;
    ASSERT_TRUE(f.reach(State::taken_off));
    f.run(after);
    const bool may_fly = f.c.ramp_share > 0.9;
    f.mode = AutopilotMode::failsafe;
    f.step();
    EXPECT_EQ(f.state(), may_fly ? State::lost_link : State::idle);
    EXPECT_EQ(f.reason(), "the autopilot's failsafe has taken over");
    EXPECT_EQ(f.orders_disarm, may_fly ? 0 : 1);
    f.lifts = true;
    f.mode = AutopilotMode::offboard;
    EXPECT_TRUE(may_fly || f.until(State::follow, 20)) << "starts anew";
  }
}

// The radio stalls as the take-off begins: thrust was taken back before it carried, and
// an autopilot that has waited in vain for set-points meanwhile has not flown either.
TEST(Mission, AFailsafeOnceThrustWasTakenBackIsNoFlight) {
  Flight f;
  f.lifts = false;
  ASSERT_TRUE(f.reach(State::taken_off));
  f.run(0.03);
  f.sight = false;
  f.run(0.35);
  ASSERT_EQ(f.state(), State::taken_off);
  EXPECT_LT(f.c.ramp_share, 0.7);
  f.mode = AutopilotMode::failsafe;
  f.step();
  expect_last(f, State::taken_off, State::idle,
              "the autopilot's failsafe has taken over");
  EXPECT_EQ(f.orders_disarm, 1);
  f.lifts = f.sight = true;
  f.mode = AutopilotMode::offboard;
  EXPECT_TRUE(f.until(State::follow, 20)) << "starts anew";
  // One that has long acted alone may have lifted off.
  Flight late;
  late.lifts = false;
  ASSERT_TRUE(late.reach(State::taken_off));
  late.run(0.03);
  late.miss(1);
  late.computer_was_late = true;
  late.mode = AutopilotMode::failsafe;
  late.sight = false;
  late.run(0.15);
  EXPECT_EQ(late.state(), State::taken_off) << "a picture is to come";
  EXPECT_EQ(late.c.mode, MissionCommand::Mode::silent);
  late.run(0.1);
  EXPECT_EQ(late.state(), State::lost_link);
  EXPECT_EQ(late.orders_disarm, 0);
}

// Its autopilot waits for set-points: in sight and heard it is flown on, with what
// thrust it had, and not left to a landing mode that a platform carries along.
TEST(Mission, ATakeOffGoesOnWhereOnlyTheComputerStoodStill) {
  for (const bool stood_still : {true, false}) {
    SCOPED_TRACE(stood_still);
    Flight f;
    ASSERT_TRUE(f.ramp_up_to(0.9));
    const double had = f.c.ramp_share;
    f.miss(1);
    f.computer_was_late = stood_still;
    f.mode = AutopilotMode::failsafe;
    if (stood_still) {
      f.sight = false;
      f.step();
      EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
      f.sight = true;
    }
    f.step();
    ASSERT_EQ(f.state(), stood_still ? State::taken_off : State::lost_link);
    if (!stood_still) continue;
    EXPECT_TRUE(f.c.lifted);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
    f.mode = AutopilotMode::offboard;
    f.computer_was_late = false;
    f.x().p_NB.z() = f.rig().drone.gear_height_m;
    f.step();
    EXPECT_NEAR(f.c.thrust_least, had, 0.03);
    EXPECT_EQ(f.orders_disarm, 0);
    EXPECT_TRUE(f.until(State::follow, 20));
  }
}

// It had just lifted. Where its autopilot has brought it down meanwhile, its thrust is
// to grow again: what the ground carries seems to need none.
TEST(Mission, WhatStandsAgainAfterTheComputerStoodStillIsLiftedAnew) {
  const struct {
    double x, rise;
    bool stands;
  } cases[] = {{0, 0.003, true},
               {0, 0.1, false},         // in the air
               {-0.22, -0.06, false}};  // beside the pad
  for (const auto& [x, rise, stands] : cases) {
    SCOPED_TRACE(rise);
    Flight f;
    f.lifts = false;
    f.slid = Vector3(1.1 * MissionConfig{}.slip_m, 0, 0);
    ASSERT_TRUE(f.reach(State::taken_off));
    while (!f.c.lifted) f.step();
    const double had = f.c.ramp_share;
    f.miss(1);
    f.computer_was_late = true;
    const auto step = [&] {
      f.x().p_NB = Vector3(x, 0, f.rig().drone.gear_height_m + rise);
      f.x().v_NB.setZero();
      f.step();
    };
    step();
    EXPECT_FALSE(f.c.lifted) << "no picture since";
    step();
    EXPECT_EQ(f.c.lifted, stands);
    if (stands) {
      EXPECT_GE(f.c.thrust_least, had);
    }
    step();
    EXPECT_FALSE(f.c.lifted) << "once";
  }
}

// It slid, so that it counts as lifted; what thrust makes of it no picture has shown.
TEST(Mission, ADroneThatIsLostAsItSlidesComesDownAsOneThatHasNotLifted) {
  struct Case {
    double rise, climb;
    bool comes_down;
  };
  for (const Case& c : {Case{0, 0, true}, Case{0.01, 0.05, true}, Case{0.03, 0, false},
                        Case{0.004, 0.25, false}}) {
    SCOPED_TRACE(testing::Message() << c.rise << " m, " << c.climb << " m/s");
    Flight f;
    f.lifts = false;
    f.slid = Vector3(1.1 * MissionConfig{}.slip_m, 0, 0);
    ASSERT_TRUE(f.reach(State::taken_off));
    while (!f.c.lifted) f.step();
    f.sight = false;
    const Time lost = f.now();
    const auto step = [&] {
      f.x().p_NB.z() = f.rig().drone.gear_height_m + c.rise;
      f.x().v_NB.z() = c.climb;
      f.step();
    };
    while (f.c.mode == MissionCommand::Mode::track && f.state() == State::taken_off &&
           to_seconds(f.now() - lost) < 0.2) {
      step();
    }
    if (!c.comes_down) {
      EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
      EXPECT_LT(f.c.thrust_least, 0.95) << "thrust does not grow unseen";
      continue;
    }
    EXPECT_LT(to_seconds(f.now() - lost), 0.12);
    EXPECT_EQ(f.c.mode, MissionCommand::Mode::ramp);
    EXPECT_NEAR(f.c.ramp_share, 0.6, 0.15);
    EXPECT_FALSE(f.mission().flying());
    while (f.state() == State::taken_off) step();
    EXPECT_EQ(f.state(), State::idle);
    EXPECT_EQ(f.orders_disarm, 1);
    f.sight = f.lifts = true;
    EXPECT_TRUE(f.until(State::follow, 20));
  }
}

// Its motors turn, for it was not heard; a second start would find it in the air.
TEST(Mission, NoStartBeginsWithMotorsThatStillTurn) {
  for (const bool seen : {true, false}) {
    SCOPED_TRACE(seen);
    Flight f;
    ASSERT_TRUE(f.ramp_up_to(0.8));
    f.link_up = false;
    ASSERT_TRUE(f.until(State::idle, 1));
    f.sight = seen;
    f.run(2);  // no order arrives
    ASSERT_TRUE(f.armed());
    const int orders = f.orders_disarm;
    f.link_up = true;
    if (seen) {
      f.step();
      EXPECT_FALSE(f.armed());
      f.lifts = true;
      EXPECT_TRUE(f.until(State::follow, 20)) << "starts anew";
      continue;
    }
    f.run(0.5);
    EXPECT_EQ(f.orders_disarm, orders) << "it may be in the air";
    EXPECT_EQ(f.state(), State::idle);
    ASSERT_TRUE(f.until(State::refused, 20));
    EXPECT_EQ(f.reason(), "the autopilot does not stop its motors");
    EXPECT_TRUE(f.armed());
  }
}

TEST(Mission, LostRightAfterTheTakeOffItIsLeftToTheAutopilotSoon) {
  Flight f;
  ASSERT_TRUE(f.reach(State::taken_off));
  while (!f.mission().flying()) f.step();
  f.run(0.3);
  f.sight = false;
  const Time lost = f.now();
  while (f.orders_land == 0 && f.now() - lost < from_seconds(5)) f.step();
  EXPECT_EQ(f.state(), State::aborted);
  EXPECT_GT(to_seconds(f.now() - lost), 1.1) << "pictures may miss for a second";
  EXPECT_LT(to_seconds(f.now() - lost), 1.3);
}

TEST(Mission, AnAbortedLandingLeavesThePlatformFirst) {
  const PlatformOutline outline(alan_rig());
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.25));
  ASSERT_FALSE(outline.clear(f.x().p_NB));
  f.wish = OperatorWish::abort;
  f.step();
  ASSERT_EQ(f.state(), State::aborted);
  while (f.orders_land == 0) {
    f.step();
    ASSERT_LT(to_seconds(f.now() - f.transitions.back().t), 4.1);
  }
  EXPECT_TRUE(outline.clear(f.x().p_NB));
  EXPECT_LT(f.reference_jump_m, 1e-6);
  // Not where the link, the autopilot or the eye forbids it.
  for (const int what : {0, 1}) {
    Flight g;
    ASSERT_TRUE(g.reach(State::land));
    ASSERT_TRUE(g.until_below(0.25));
    if (what == 0) g.link_up = false;
    if (what == 1) g.mode = AutopilotMode::failsafe;
    g.run(0.3);
    g.wish = OperatorWish::abort;
    g.run(0.3);
    EXPECT_GT(g.orders_land, 0) << what;
  }
}

TEST(Mission, PastTheCommitHeightAnAbortIsToldAndItLands) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.wish = OperatorWish::abort;
  f.run(0.05);
  EXPECT_EQ(f.state(), State::land);
  EXPECT_EQ(f.reason(), "the operator aborted past the commit height: it lands");
  ASSERT_TRUE(f.until(State::complete, 3));
  EXPECT_EQ(f.orders_land, 0);
  // Without a touch-down it is carried out after all.
  Flight misses;
  ASSERT_TRUE(misses.reach(State::land));
  ASSERT_TRUE(misses.until_below(0.11));
  misses.wish = OperatorWish::abort;
  misses.off = Vector3(0, 0, 0.2);
  ASSERT_TRUE(misses.until(State::aborted, 10));
}

TEST(Mission, PastTheCommitHeightALostLinkChangesNothing) {
  Flight f;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.11));
  f.link_up = false;
  ASSERT_TRUE(f.until(State::shut_down, 3));
  ASSERT_TRUE(f.until(State::lost_link, 5));
  EXPECT_EQ(f.reason(),
            "nothing heard since touch-down: the autopilot stops its motors");
}

TEST(Mission, ThePilotsSwitchWinsInEveryStateAndNothingIsOrdered) {
  for (const AutopilotMode mode : {AutopilotMode::hold, AutopilotMode::manual}) {
    for (const State state : kInTheAir) {
      SCOPED_TRACE(to_string(state));
      Flight f;
      ASSERT_TRUE(bring(f, state));
      f.mode = mode;
      f.step();
      expect_last(f, state, State::pilot, "the pilot has taken over");
      f.wish = OperatorWish::abort;
      for (int i = 0; i < 300; ++i) {
        f.x().p_NB += Vector3(0.002, 0.001, 0.001);  // the pilot's
        const Vector3 p = f.x().p_NB;
        f.step();
        EXPECT_EQ(f.c.order, AutopilotOrder::none);
        EXPECT_EQ(f.c.mode, MissionCommand::Mode::track);
        EXPECT_LT((f.mission().reference(f.now()).p_NB - p).norm(), 1e-9)
            << "asks for nothing but to go on";
      }
      EXPECT_EQ(f.state(), State::pilot);
      f.mode = AutopilotMode::offboard;
      f.run(0.1);
      EXPECT_EQ(f.state(), State::aborted) << "what the operator said stands";
    }
  }
}

// There what a turn of the platform asks for is no way to begin with.
TEST(Mission, GivenBackFarFromAPlatformThatTurnsItIsLeftToItsAutopilot) {
  for (const double turn : {0.0, 0.6, 1.2}) {
    SCOPED_TRACE(turn);
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    f.platform_turn = turn;
    f.mode = AutopilotMode::hold;
    f.run(1);
    f.x().p_NB += Vector3(-0.9, 1.5, 0);
    f.x().v_NB = Vector3(0.4, 0.3, 0);
    f.run(0.1);
    f.mode = AutopilotMode::offboard;
    f.run(0.1);
    EXPECT_EQ(f.state(), turn < 1 ? State::go_around : State::aborted) << f.reason();
  }
}

TEST(Mission, ThePilotGivesItBack) {
  Flight seen;
  ASSERT_TRUE(bring(seen, State::land));
  seen.mode = AutopilotMode::hold;
  seen.run(2);
  seen.mode = AutopilotMode::offboard;
  seen.step();
  expect_last(seen, State::pilot, State::go_around, "the pilot has given it back");
  EXPECT_TRUE(seen.until(State::complete));

  Flight unseen;
  ASSERT_TRUE(bring(unseen, State::follow));
  unseen.mode = AutopilotMode::hold;
  unseen.run(1);
  unseen.sight = false;
  unseen.run(3);
  EXPECT_EQ(unseen.state(), State::pilot);
  EXPECT_EQ(unseen.reason(), "the pilot flies, the LEDs are out of sight");
  unseen.mode = AutopilotMode::offboard;
  unseen.step();
  EXPECT_EQ(unseen.state(), State::aborted);
  EXPECT_EQ(unseen.reason(),
            "the pilot has given it back out of sight: the autopilot lands");

  Flight lands;
  ASSERT_TRUE(bring(lands, State::follow));
  lands.mode = AutopilotMode::hold;
  lands.run(1);
  lands.motors_stop = true;
  ASSERT_TRUE(lands.until(State::complete, 1));
  EXPECT_EQ(lands.reason(), "the pilot stopped the motors");
}

TEST(Mission, GivenBackByThePilotWithoutSetpointsItIsTheAutopilots) {
  Flight f;
  ASSERT_TRUE(bring(f, State::follow));
  f.mode = AutopilotMode::hold;
  f.run(2);
  f.mode = AutopilotMode::failsafe;
  f.step();
  expect_last(f, State::pilot, State::lost_link,
              "the autopilot's failsafe has taken over");
  f.motors_stop = true;
  ASSERT_TRUE(f.until(State::complete, 1));
  EXPECT_EQ(f.reason(), "set-points did not arrive: the autopilot landed by itself");
}

TEST(Mission, ThePilotsSwitchBeforeTheTakeOffRefusesAndOrdersNothing) {
  Flight f;
  ASSERT_TRUE(f.reach(State::taken_off));
  f.mode = AutopilotMode::hold;
  f.run(0.5);
  EXPECT_EQ(f.state(), State::refused);
  EXPECT_EQ(f.reason(), "the pilot took over before the take-off");
  EXPECT_EQ(f.orders_disarm, 0);
  EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
}

TEST(Mission, ALowBatteryEndsTheWaitingAndThenTheFlight) {
  Flight waits;
  ASSERT_TRUE(bring(waits, State::hold));
  waits.battery = 0.1;
  waits.run(0.2);
  EXPECT_EQ(waits.state(), State::hold) << "a dip of the voltage";
  ASSERT_TRUE(waits.until(State::follow, 1));
  EXPECT_EQ(waits.reason(), "the battery is low: it lands without waiting");
  waits.wish = OperatorWish::hold;
  ASSERT_TRUE(waits.until(State::complete, 20)) << waits.reason();

  Flight fails;
  ASSERT_TRUE(bring(fails, State::follow));
  fails.battery = 0.1;
  fails.plans_feasible = false;
  ASSERT_TRUE(fails.until(State::aborted, 20));
  EXPECT_EQ(fails.reason(),
            "the battery is low and the landing failed: the autopilot lands");

  Flight lands;
  ASSERT_TRUE(bring(lands, State::land));
  lands.battery = 0.03;
  lands.run(0.5);
  EXPECT_EQ(lands.state(), State::land);
  EXPECT_EQ(lands.reason(), "the battery is low: the landing goes on");
  EXPECT_TRUE(lands.until(State::complete, 10));

  Flight empty;
  ASSERT_TRUE(bring(empty, State::follow));
  empty.battery = 0.03;
  empty.run(0.5);
  EXPECT_EQ(empty.state(), State::aborted);
  EXPECT_EQ(empty.reason(), "the battery is empty: the autopilot lands");

  MissionConfig config;
  config.safety.when_battery_low = WhenBatteryLow::leave;
  Flight leaves(config);
  ASSERT_TRUE(bring(leaves, State::follow));
  leaves.battery = 0.1;
  leaves.run(0.5);
  EXPECT_EQ(leaves.state(), State::aborted);
  EXPECT_EQ(leaves.reason(), "the battery is low: the autopilot lands");
}

// However often landings fail, with a low battery it does not stay up.
TEST(Mission, ALowBatteryAfterTooManyLandingsTriesOnceMore) {
  MissionConfig config;
  config.safety.landings_max = 2;
  Flight f(config);
  f.plans_feasible = false;
  ASSERT_TRUE(f.reach(State::hold));
  f.battery = 0.1;
  ASSERT_TRUE(f.until(State::rendezvous, 20));
  ASSERT_TRUE(f.until(State::aborted, 20));
}

TEST(Mission, TooManyFailedLandingsLeaveWhereTold) {
  MissionConfig config;
  config.safety.landings_max = 2;
  config.safety.when_failed = WhenFailed::leave;
  config.safety.leave_at_m = Vector3(-1.5, 0.4, 0.9);
  Flight f(config);
  f.plans_feasible = false;
  ASSERT_TRUE(f.reach(State::aborted));
  EXPECT_EQ(f.reason(), "too many landings have failed: the autopilot lands");
  f.run(0.2);
  EXPECT_GT(f.orders_land, 0);
}

TEST(Mission, AHoldBeforeTheTakeOffWaitsOnThePad) {
  Flight f;
  ASSERT_TRUE(f.reach(State::armed));
  f.wish = OperatorWish::hold;
  f.run(1);
  EXPECT_EQ(f.state(), State::idle);
  EXPECT_FALSE(f.armed());
  f.run(20);
  EXPECT_EQ(f.state(), State::idle);
  f.wish = OperatorWish::go;
  EXPECT_TRUE(f.until(State::complete, 60));
}

TEST(Mission, WhatDoesNotComeToRestHolds) {
  Flight f;
  ASSERT_TRUE(f.reach(State::follow));
  f.off = Vector3(0.2, 0, 0);
  ASSERT_TRUE(f.until(State::hold, 30));
  EXPECT_EQ(f.reason(), "it does not come to rest at the follow point");
}

TEST(Mission, AComputerThatStoodStillIsToldOnceAndTheWayTakenUpAnew) {
  for (const double off : {0.1, 0.5}) {
    Flight f;
    ASSERT_TRUE(bring(f, State::follow));
    const std::size_t before = f.transitions.size();
    f.computer_was_late = true;
    f.off = Vector3(0, 0, -off);
    f.x().p_NB.z() -= off;
    f.step();
    f.off.setZero();
    ASSERT_EQ(f.transitions.size(), before + 1);
    EXPECT_EQ(f.reason(), "the computer stood still");
    EXPECT_EQ(f.state(), off > 0.35 ? State::go_around : State::follow);
    f.run(0.3);
    EXPECT_EQ(f.transitions.size(), before + 1);
    f.computer_was_late = false;
    EXPECT_TRUE(f.until(State::complete));
  }
}

// One fault of any kind and length, at any moment: never a disarm away from the pad,
// never a set-point against the autopilot's own landing, and an end that is told.
TEST(Mission, AnyOneFaultAtAnyMomentEndsWell) {
  int complete = 0, aborted = 0;
  for (int fault = 0; fault < 6; ++fault) {
    for (int moment = 0; moment < 24; ++moment) {
      for (const double lasting : {0.15, 0.6, 8.0}) {
        SCOPED_TRACE(testing::Message()
                     << "fault " << fault << " at " << moment << " for " << lasting);
        Flight f;
        f.wish = OperatorWish::go;
        const Time begin = f.now() + from_seconds(0.7 * moment + 0.005);
        const Time end = begin + from_seconds(lasting);
        for (int i = 0; i < 6000; ++i) {
          const bool on = f.now() >= begin && f.now() < end;
          f.sight = !(fault == 0 && on);
          f.link_up = !(fault == 1 && on);
          f.planner_answers = !(fault == 2 && on);
          f.plans_feasible = !(fault == 3 && on);
          f.mode = fault == 4 && on ? AutopilotMode::failsafe : AutopilotMode::offboard;
          f.off = fault == 5 && on && f.mission().flying() ? Vector3(0, 0.4, 0)
                                                           : Vector3::Zero();
          const bool flew = f.mission().flying();
          f.step();
          if (f.c.order == AutopilotOrder::disarm && flew) {
            EXPECT_LT(f.x().p_NB.z(), f.rig().drone.gear_height_m + 0.03);
            EXPECT_LT(f.x().p_NB.head<2>().norm(), 0.45);
          }
          // Once the autopilot has been left to itself nothing interferes.
          if (f.state() == State::lost_link || f.orders_land > 0) {
            EXPECT_EQ(f.c.mode, MissionCommand::Mode::silent);
          }
          EXPECT_STRNE(f.mission().status().reason, "");
          if (f.state() == State::complete || f.state() == State::aborted) break;
        }
        complete += f.state() == State::complete;
        aborted += f.state() == State::aborted;
        EXPECT_TRUE(f.state() == State::complete || f.state() == State::aborted ||
                    f.state() == State::refused)
            << to_string(f.state()) << ": " << f.reason();
      }
    }
  }
  EXPECT_GT(complete, 300);
  EXPECT_GT(aborted, 5);
}

TEST(Mission, ReplansWhileLandingWithoutAJumpAndLands) {
  const auto planner = Planner::create(PlannerConfig{}, alan_rig());
  ASSERT_TRUE(planner);
  Flight f;
  f.planner = &*planner;
  ASSERT_TRUE(f.reach(State::land));
  const std::size_t asked = f.requests.size();
  f.platform_speed = 0.5;  // It drives off: what was certified was for another motion.
  FlatState last = f.mission().reference(f.now());
  while (f.state() == State::land) {
    f.step();
    const FlatState ref = f.mission().reference(f.now());
    EXPECT_LT((ref.v_NB - last.v_NB).norm(), 0.12);  // 12 m/s^2 over a step
    EXPECT_LT((ref.a_NB - last.a_NB).norm(), 1.5);
    last = ref;
  }
  EXPECT_LT(f.reference_jump_m, 1e-6);
  ASSERT_GT(f.requests.size(), asked + 2);
  bool sweeps = false, single = false;
  for (std::size_t i = asked; i < f.requests.size(); ++i) {
    EXPECT_TRUE(f.requests[i].keep_jerk);
    EXPECT_NEAR(f.requests[i].platform.v_IN_N.x(), 0.5, 1e-9);
    (f.requests[i].durations[0] == 0 ? sweeps : single) = true;
  }
  EXPECT_TRUE(single);
  EXPECT_TRUE(sweeps);
  EXPECT_TRUE(f.until(State::complete));
}

TEST(Mission, PlansAnewThatComeLateOrNotChangeNothing) {
  const auto planner = Planner::create(PlannerConfig{}, alan_rig());
  ASSERT_TRUE(planner);
  std::vector<Vector3> paths[3];
  for (int kind = 0; kind < 3; ++kind) {
    Flight f;
    f.planner = &*planner;
    ASSERT_TRUE(f.reach(State::land));
    if (kind == 1) f.planner_answers = false;
    if (kind == 2) f.planner_delay = from_seconds(0.25);
    while (f.state() == State::land) {
      f.step();
      paths[kind].push_back(f.mission().reference(f.now()).p_NB);
    }
    EXPECT_EQ(f.state(), State::shut_down);
  }
  ASSERT_EQ(paths[1].size(), paths[2].size());
  for (std::size_t i = 0; i < paths[1].size(); ++i) {
    EXPECT_EQ(paths[1][i], paths[2][i]);
  }
}

TEST(Mission, GoesAroundOnACertifiedWayAndFromWhereItIsUntilThat) {
  const auto planner = Planner::create(PlannerConfig{}, alan_rig());
  ASSERT_TRUE(planner);
  Flight f;
  f.planner = &*planner;
  ASSERT_TRUE(f.reach(State::land));
  ASSERT_TRUE(f.until_below(0.3));
  f.off = Vector3(0, 0.36, 0);
  ASSERT_TRUE(f.until(State::go_around, 5));
  f.off.setZero();
  const PlanRequest back = f.requests.back();
  EXPECT_TRUE(back.way_back);
  const PlanResult way = planner->plan(back);
  ASSERT_TRUE(way.ok());
  while (f.now() < back.start + from_seconds(0.2)) f.step();
  const FlatState ref = f.mission().reference(f.now());
  const FlatState certified = way.trajectory.at(to_seconds(f.now() - back.start));
  EXPECT_LT((ref.p_NB - certified.p_NB).norm(), 1e-9);
  EXPECT_TRUE(f.until(State::complete));
  EXPECT_EQ(f.mission().status().attempts, 2);
}

}  // namespace
}  // namespace alight
