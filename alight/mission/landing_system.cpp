#include "alight/mission/landing_system.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "alight/control/motion_setpoint.h"
#include "alight/mission/dead_reckoning.h"
#include "alight/mission/drone_motion.h"
#include "alight/mission/floor_contact.h"
#include "alight/mission/lean_watch.h"
#include "alight/mission/miss.h"
#include "alight/mission/mission.h"
#include "alight/platform/deck_motion.h"

namespace alight {
namespace {

constexpr Seconds kHeadingSight = 0.1;  // unseen for longer, nothing is learnt
// The autopilot's heading jumps when it takes up the poses it is sent: seen so often in
// a row, a difference so large is no noise.
constexpr double kHeadingJump = 15 * kDegree;
constexpr int kHeadingJumpSeen = 3;
constexpr Seconds kHeadingApart = 0.1;  // told so far apart, it may have turned by then
constexpr double kLeastUpright = 0.5;  // cosine of the tilt at which thrust still lifts
constexpr Seconds kLatestTold = 10;    // a picture still later is no word on the camera
constexpr Seconds kPosesApart =
    0.015;  // that the autopilot is told; it wants 30 to 50 a second
constexpr Seconds kWokeLately = 0.5;
constexpr Seconds kTouchUnsure = 0.15;
constexpr double kSquareUpMost = 6 * kDegree;  // more would throw it to the side
// Of the way back to how it stands, as long as its feet touch: they hold it, in part.
// Just above the ground it is taken to follow as little: it leans the more, and the
// sooner, against what blows it out of a picture that is narrow there (of 200 take-offs
// in 5 m/s of wind 2 were lost sight of, 8 without).
constexpr double kFeetHold = 0.5;
constexpr double kLiftTrust = 0.3;  // share of what lift-off says of the thrust
// Pictures that still come are to find the filter where they were taken; where they do
// come, only they carry it on.
constexpr Seconds kReckonedLate = 0.12;
// From a picture to the lean that it is held against, and not so soon after its heading
// began anew.
constexpr Seconds kLeanTold = 0.12, kLeanAfterTurn = 1.5;
constexpr double kOwnVelocityShare = 0.1;  // of what telemetry tells anew
constexpr Time kFuture = 5'000'000;        // ns; clocks agree no better than this

// What no platform or drone that is landed on does: a number beyond is a broken
// message, and squared somewhere it would no longer be one.
constexpr double kFarthest = 1e6;     // m
constexpr double kFastest = 100;      // m/s
constexpr double kFastestTurn = 100;  // rad/s
constexpr double kStrongest = 1e3;    // m/s^2

bool within(const Vector3& v, double most) {
  return (v.array().abs() <= most).all();  // false for NaN, unlike the largest of them
}

/// By how much its heading has turned as its gyros do not show, rad: its estimator has
/// begun anew. 0 where it was not told for too long.
double turn_unfelt(const AutopilotTelemetry& before, const AutopilotTelemetry& t) {
  const Seconds apart = to_seconds(t.captured - before.captured);
  if (apart > kHeadingApart) return 0;
  const Matrix3 R_IB = t.q_IB.toRotationMatrix();
  return wrap_angle(yaw_of(R_IB) - yaw_of(before.q_IB.toRotationMatrix()) -
                    apart * (R_IB * t.w_IB_B).z());
}

bool sane(const PlatformOdometry& o) {
  return within(o.X_IN.translation(), kFarthest) && o.X_IN.linear().allFinite() &&
         within(o.v_IN_N, kFastest) && within(o.w_IN_N, kFastestTurn);
}
bool sane(const PlatformImu& i) {
  return within(i.f_N, kStrongest) && within(i.w_IN_N, kFastestTurn);
}
bool sane(const AutopilotTelemetry& t) {
  return t.q_IB.coeffs().allFinite() && std::abs(t.q_IB.norm() - 1) < 1e-3 &&
         within(t.w_IB_B, kFastestTurn) && std::isfinite(t.battery) &&
         (within(t.v_IB, kFastest) || t.v_IB.array().isNaN().all()) &&
         (std::abs(t.climb) < kFastest || std::isnan(t.climb));
}

}  // namespace

struct LandingSystem::Parts {
  Parts(const LandingConfig& c, const Rig& r, RelativeEstimator e, AttitudeController a,
        PidController p)
      : config(c),
        rig(r),
        estimator(std::move(e)),
        platform(c.platform),
        sight(1e-3 * r.timing.frame_to_use_ms),
        link(c.link),
        response(c.response),
        motion(response, platform, c.attitude.drag_per_s),
        mission(c.mission, r),
        attitude(std::move(a)),
        pid(std::move(p)) {
    if (config.mission.start_on_floor) return;
    // It stands on the pad, facing the camera: where, to within a few centimetres.
    Vector6 sd;
    sd << Vector3(0.06, 0.06, 0.02), Vector3(6, 6, 10) * kDegree;
    const Vector6 variance = sd.array().square();
    estimator.expect(
        make_pose(Matrix3::Identity(), Vector3(0, 0, rig.drone.gear_height_m)),
        variance.asDiagonal());
  }

  LandingConfig config;
  Rig rig;
  RelativeEstimator estimator;
  PlatformTracker platform;
  DeckMotion deck;
  SightWatch sight;
  LinkMonitor link;
  DroneResponse response;
  DroneMotion motion;
  DeadReckoning reckoning;
  FloorContact floor;
  LeanWatch lean;
  Mission mission;
  AttitudeController attitude;
  PidController pid;

  bool started = false;
  Time last_now = 0;
  std::uint32_t refused = 0;
  bool telemetry_heard = false;
  AutopilotTelemetry telemetry;
  bool alone = false;  // the autopilot flies by itself, set-points are not followed;
  Vector3 b_N_obeyed = Vector3::Zero();  // what the filter had learnt before that
  // Sent meanwhile; which of them the autopilot obeys again it tells a moment later.
  struct Unanswered {
    Time arrives = 0;
    Setpoint setpoint;
  };
  std::array<Unanswered, 32> unanswered;
  std::size_t unanswered_next = 0, unanswered_count = 0;
  Time told_alone = 0;  // when it was still so, by telemetry
  bool heading_known = false;
  int heading_off = 0;     // telemetry in a row that contradicts it
  Time heading_begun = 0;  // when it began anew
  Time last_pose = std::numeric_limits<Time>::min() / 2;  // told to the autopilot
  Time slept_from = 0;      // the computer last stood still
  Time first_pose = 0;      // that could have been told to the autopilot,
  bool poses_told = false;  // which it was, or a later one
  Time reckoned = 0;        // when its velocity was told last, unseen
  RelativeState x_seen;
  Eigen::Quaterniond tilt_at_rest = Eigen::Quaterniond::Identity();  // on a level deck
  bool calibrated = false;                                           // or tried to
  double heading_at_rest = 0;  // rad, in the autopilot's frame, as tilt_at_rest what
  bool rest_known = false;     // telemetry says of it before take-off
  Vector3 v_off_A = Vector3::Zero();  // its own velocity, as told, less ours
  Setpoint last_track;                // what `track` sent last,
  double last_track_heading = 0;      // and the platform's heading then

  // Of the step under way.
  OperatorWish wish = OperatorWish::none;
  const PlanArrival* plan = nullptr;

  void take(const Event& event, Time now, Output& out, Probe* probe);
  void learn_heading(const AutopilotTelemetry& t, const AutopilotTelemetry& before);
  /// Of the deck, as seen by the drone that stood on it before take-off, its heading
  /// aside.
  Eigen::Quaterniond deck_tilt(const PlatformState& at) const;
  void learn_rest(const AutopilotTelemetry& t);
  void follow_autopilot(const AutopilotTelemetry& t, Time now);
  /// The set-points since it was last alone are what the drone does now.
  void obeys_again();
  /// The drone's velocity at `t`, as the estimator has it.
  Vector3 seen_v_IB(Time t) const;
  void watch_velocity(const AutopilotTelemetry& t);
  void watch_floor(const AutopilotTelemetry& t);
  /// The LEDs of another drone are not flown by.
  void watch_lean(FrameReport& frame);
  void learn_own_velocity(const AutopilotTelemetry& t);
  void reckon(Time now);
  void external_pose(const FrameReport& frame, Output& out);
  bool may_tell_first(const ExternalPose& pose) const;
  /// What its autopilot believes at `t`, of a drone that is then as in `ahead`.
  OwnMotion own_motion(const MotionState& ahead, const PlatformState& at, Time t,
                       bool standing) const;
  /// The feet of a drone that leans come down one after the other.
  void square_up(double share, const PlatformState& at, Output& out) const;
  Setpoint resting_setpoint(const PlatformState& at, double thrust) const;
  void control(const MissionCommand& command, Time now, const MotionState& state,
               Output& out);
};

LandingSystem::LandingSystem(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
LandingSystem::LandingSystem(LandingSystem&&) noexcept = default;
LandingSystem& LandingSystem::operator=(LandingSystem&&) noexcept = default;
LandingSystem::~LandingSystem() = default;

Result<LandingSystem> LandingSystem::create(const LandingConfig& config,
                                            const Rig& rig) {
  if (auto good = rig.validate(); !good) return fail(good.error());
  if (auto good = config.validate(); !good) return fail(good.error());
  if (auto good = config.mission.safety.validate(rig); !good) {
    return fail(good.error());
  }
  if (auto good = check_places(config.mission, rig); !good) return fail(good.error());
  if (auto good = check_pictures(rig.timing); !good) return fail(good.error());
  auto estimator = RelativeEstimator::create(config.estimator, rig);
  if (!estimator) return fail(estimator.error());
  auto attitude =
      AttitudeController::create(config.attitude, config.response, rig.drone);
  if (!attitude) return fail(attitude.error());
  auto pid = PidController::create(config.pid);
  if (!pid) return fail(pid.error());
  return LandingSystem(std::make_unique<Parts>(config, rig, std::move(*estimator),
                                               std::move(*attitude), std::move(*pid)));
}

void LandingSystem::Parts::learn_heading(const AutopilotTelemetry& t,
                                         const AutopilotTelemetry& before) {
  if (!estimator.initialized() || !platform.ready()) return;
  if (to_seconds(t.captured - estimator.last_sight()) > kHeadingSight) {
    const double jump = turn_unfelt(before, t);
    if (heading_known && std::abs(jump) >= kHeadingJump) {
      motion.autopilot_heading = wrap_angle(motion.autopilot_heading + jump);
      heading_begun = t.captured;
    }
    return;
  }
  const double ours = yaw_of(platform.at(t.captured).X_IN.linear()) +
                      yaw_of(estimator.filter().state().R_NB);
  const double theirs = yaw_of(t.q_IB.toRotationMatrix());
  const double difference = wrap_angle(theirs - ours - motion.autopilot_heading);
  heading_off = std::abs(difference) > kHeadingJump ? heading_off + 1 : 0;
  const bool jumped = !heading_known || heading_off >= kHeadingJumpSeen;
  motion.autopilot_heading =
      wrap_angle(motion.autopilot_heading +
                 (jumped ? difference : config.heading_smoothing * difference));
  if (jumped || heading_off > 0) heading_begun = t.captured;
  heading_known = true;
}

Eigen::Quaterniond LandingSystem::Parts::deck_tilt(const PlatformState& at) const {
  const Matrix3& R_IN = at.X_IN.linear();
  return Eigen::Quaterniond(from_rpy(0, 0, -mission.heading_at_rest() - yaw_of(R_IN)) *
                            R_IN * from_rpy(0, 0, mission.heading_at_rest()));
}

void LandingSystem::Parts::learn_rest(const AutopilotTelemetry& t) {
  if (t.armed) return;
  const double yaw = yaw_of(t.q_IB.toRotationMatrix());
  Eigen::Quaterniond tilt(Eigen::AngleAxisd(-yaw, Vector3::UnitZ()) * t.q_IB);
  if (!config.mission.start_on_floor && platform.ready()) {
    tilt = deck_tilt(platform.at(t.captured)).inverse() * tilt;
  }
  tilt_at_rest = rest_known ? tilt_at_rest.slerp(0.2, tilt) : tilt;
  heading_at_rest = yaw;
  rest_known = true;
}

// While the autopilot flies by itself, the set-points say nothing of what the drone
// does.
void LandingSystem::Parts::follow_autopilot(const AutopilotTelemetry& t, Time now) {
  const bool was = alone;
  alone = t.armed && !motion.on_ground &&
          (t.mode == AutopilotMode::failsafe || t.mode == AutopilotMode::land ||
           t.mode == AutopilotMode::hold);
  if (alone != was && estimator.initialized()) {
    Vector3& b_N = b_N_obeyed;
    const MotionState& state = estimator.filter().motion_state();
    if (alone) b_N = state.b_N;
    // It holds its height, whatever thrust that takes; the wind is as before.
    const Vector3 d_N(state.d_N.x(), state.d_N.y(), 0);
    estimator.restart_disturbance(d_N, alone ? Vector3(b_N.x(), b_N.y(), 0) : b_N);
  }
  if (was && !alone) obeys_again();
  if (!alone) return;
  told_alone = t.captured;
  const auto holding_height = [&](const Eigen::Quaterniond& q_IB) {
    Setpoint setpoint;
    setpoint.kind = Setpoint::Kind::attitude;
    setpoint.q_IB = q_IB;
    const double upright = std::max(q_IB.toRotationMatrix()(2, 2), kLeastUpright);
    setpoint.thrust = std::min(1 / (config.response.thrust_to_weight * upright), 1.0);
    return setpoint;
  };
  // Nor did it do, while the computer stood still, what it had been told last.
  if (!was && slept_from > 0 && to_seconds(now - sight.woke()) < kWokeLately) {
    const double heading = yaw_of(t.q_IB.toRotationMatrix());
    response.sent(holding_height(Eigen::Quaterniond(from_rpy(0, 0, heading))),
                  slept_from + link.delay());
  }
  response.sent(holding_height(t.q_IB), now);
}

void LandingSystem::Parts::obeys_again() {
  const std::size_t first = unanswered_next + unanswered.size() - unanswered_count;
  for (std::size_t i = 0; i < unanswered_count; ++i) {
    const Unanswered& sent = unanswered[(first + i) % unanswered.size()];
    if (sent.arrives > told_alone) response.sent(sent.setpoint, sent.arrives);
  }
  unanswered_count = 0;
}

Vector3 LandingSystem::Parts::seen_v_IB(Time t) const {
  const PlatformState at = platform.at(t);
  const RelativeState x = estimator.carried_to(t, motion).x;
  return at.X_IN.linear() * inertial_velocity_N(at, x.p_NB, x.v_NB);
}

void LandingSystem::Parts::watch_velocity(const AutopilotTelemetry& t) {
  if (!config.dead_reckoning || motion.on_ground || !estimator.initialized() ||
      !platform.ready()) {
    reckoning.forget();
    return;
  }
  const DeadReckoning::Velocity told = {
      t.captured, from_rpy(0, 0, -motion.autopilot_heading) * t.v_IB};
  if (to_seconds(t.captured - estimator.last_sight()) > kHeadingSight) {
    reckoning.out_of_sight(told);
    return;
  }
  reckoning.in_sight(told, seen_v_IB(t.captured));
}

void LandingSystem::Parts::learn_own_velocity(const AutopilotTelemetry& t) {
  if (config.interface != ControlInterface::motion || !estimator.initialized() ||
      !platform.ready() || !t.v_IB.allFinite()) {
    return;
  }
  const Vector3 ours_A =
      from_rpy(0, 0, motion.autopilot_heading) * seen_v_IB(t.captured);
  v_off_A += kOwnVelocityShare * (t.v_IB - ours_A - v_off_A);
}

OwnMotion LandingSystem::Parts::own_motion(const MotionState& ahead,
                                           const PlatformState& at, Time t,
                                           bool standing) const {
  const Matrix3 R_AN = from_rpy(0, 0, motion.autopilot_heading) * at.X_IN.linear();
  OwnMotion own;
  if (standing) {
    // Its feet hold it against what thrust and wind would make of it.
    own.v_IB = v_off_A + R_AN * inertial_velocity_N(at, ahead.x.p_NB, Vector3::Zero());
    own.a_IB = R_AN * at.a_IN_N;
    return own;
  }
  const DroneResponse::Sample drone = response.at(t);
  own.v_IB = v_off_A + R_AN * inertial_velocity_N(at, ahead.x.p_NB, ahead.x.v_NB);
  own.a_IB = drone.f_I() - kGravity * Vector3::UnitZ() +
             R_AN * ahead.disturbance_N(motion.at(t, ahead.x).lift_N);
  return own;
}

void LandingSystem::Parts::watch_lean(FrameReport& frame) {
  if (config.estimator.search_lean_deg >= 180) return;
  // By set-points alone it is not known for long how it leans.
  const bool told = telemetry_heard && telemetry.armed &&
                    std::abs(to_seconds(frame.t - telemetry.captured)) < kLeanTold;
  // One that takes over another heading is told to lean elsewhere meanwhile.
  const bool turns = to_seconds(frame.t - heading_begun) < kLeanAfterTurn;
  // Nor what it did while the computer stood still.
  const Time woke = sight.woke();
  const bool missed = woke > 0 && to_seconds(frame.t - woke) < kLeanAfterTurn;
  // Without odometry a deck leans unknown.
  if (!told || turns || missed || platform.stale(frame.t)) {
    lean.pause();
    return;
  }
  // Against its own nose: from the floor an autopilot takes over another heading.
  const auto level = [](const Matrix3& R) {
    return Matrix3(from_rpy(0, 0, -yaw_of(R)) * R);
  };
  const Matrix3 seen = level(platform.at(frame.t).X_IN.linear() * frame.x.R_NB);
  const Matrix3 by_itself = level(response.at(frame.t).R_IB);
  lean.add(frame.t, seen.transpose() * by_itself.col(2));
  if (!lean.contrary() || motion.on_ground) return;
  estimator.refuse(frame.x.X_NB(), frame.t);
  reckoning.forget();
  lean.pause();
  frame.tracked = frame.initialized = false;
  frame.why_not = "the LEDs of another drone: it leans otherwise";
}

void LandingSystem::Parts::watch_floor(const AutopilotTelemetry& t) {
  if (!alone || !t.armed || !estimator.initialized()) {
    floor.forget();
    return;
  }
  if (to_seconds(t.captured - estimator.last_sight()) < kHeadingSight) {
    floor.seen(x_seen.p_NB.z() + rig.pad.above_floor_m - rig.drone.gear_height_m);
  }
  const Matrix3 R_IB = t.q_IB.toRotationMatrix();
  floor.told(t.captured, t.climb, std::acos(std::clamp(R_IB(2, 2), -1.0, 1.0)));
}

void LandingSystem::Parts::reckon(Time now) {
  const Time until = dark(sight.why(now)) ? now - from_seconds(kReckonedLate)
                                          : estimator.filter().time();
  DeadReckoning::Velocity told;
  while (reckoning.next(until, told)) {
    const PlatformState at = platform.at(told.captured);
    const Vector3 v_IB_N = at.X_IN.linear().transpose() * told.v_IB;
    const Vector3 v_IP_N =
        inertial_velocity_N(at, estimator.filter().state().p_NB, Vector3::Zero());
    estimator.reckon(told.captured, v_IB_N - v_IP_N, motion);
    reckoned = told.captured;
  }
}

void LandingSystem::Parts::take(const Event& event, Time now, Output& out,
                                Probe* probe) {
  const auto timely = [&](Time captured) {
    // Not by their difference, which overflows for times that are wrong enough.
    return captured >= now - from_seconds(config.event_age_max_s) &&
           captured <= now + kFuture;
  };
  bool good = true;
  if (const auto* frame = std::get_if<CameraFrame>(&event)) {
    FrameReport report;
    good = timely(frame->captured) && estimator.fuse(*frame, motion, report, probe);
    if (good) {
      if (report.tracked) watch_lean(report);
      if (report.tracked) {
        x_seen = report.x;
        external_pose(report, out);
      }
      out.trace.frames.push_back(report);
    }
    const bool late = !timely(frame->captured) && frame->captured < now &&
                      frame->captured >= now - from_seconds(kLatestTold);
    if (good || late) sight.picture(frame->captured, std::min(frame->received, now));
  } else if (const auto* odometry = std::get_if<PlatformOdometry>(&event)) {
    good = timely(odometry->captured) && sane(*odometry) && platform.add(*odometry);
  } else if (const auto* imu = std::get_if<PlatformImu>(&event)) {
    good = timely(imu->captured) && sane(*imu) && platform.add(*imu);
  } else if (const auto* t = std::get_if<AutopilotTelemetry>(&event)) {
    good = timely(t->captured) && sane(*t) &&
           (!telemetry_heard || t->captured > telemetry.captured);
    if (good) {
      telemetry_heard = true;
      const AutopilotTelemetry before = std::exchange(telemetry, *t);
      link.heard(std::min(t->received, now));  // a link is not alive from the future
      learn_heading(*t, before);
      learn_rest(*t);
      response.correct(t->captured, t->q_IB.toRotationMatrix(), t->w_IB_B);
      follow_autopilot(*t, now);
      watch_velocity(*t);
      watch_floor(*t);
      learn_own_velocity(*t);
    }
  } else if (const auto* status = std::get_if<LinkStatus>(&event)) {
    good = std::isfinite(status->round_trip_ms) && status->last_answer <= now + kFuture;
    if (good) link.add(*status);
  } else if (const auto* arrival = std::get_if<PlanArrival>(&event)) {
    plan = arrival;
  } else if (const auto* operator_input = std::get_if<OperatorInput>(&event)) {
    // Within one step the most severe wish wins.
    wish = std::max(wish, operator_input->wish);
  }
  if (!good) ++refused;
}

void LandingSystem::Parts::external_pose(const FrameReport& frame, Output& out) {
  // A radio has a queue, and 120 poses a second fill it before set-points.
  if (to_seconds(frame.t - last_pose) < kPosesApart) return;
  const double velocity_sd = largest_sd(frame.cov.bottomRightCorner<3, 3>());
  if (!platform.ready() || velocity_sd > config.external_velocity_sd_max_m_s) return;
  const PlatformState at = platform.at(frame.t);
  const Matrix3 R_IN = at.X_IN.linear();
  ExternalPose& pose = out.external_pose;
  pose.captured = frame.t;
  pose.X_IB = at.X_IN * frame.x.X_NB();
  pose.v_IB = R_IN * inertial_velocity_N(at, frame.x.p_NB, frame.x.v_NB);
  Matrix9 J = Matrix9::Identity();
  J.block<3, 3>(0, 0) = R_IN;
  J.block<3, 3>(6, 6) = R_IN;
  pose.cov = J * frame.cov * J.transpose();
  const auto square = [](double v) { return v * v; };
  pose.cov.diagonal().head<3>().array() += square(config.odometry_position_sd_m);
  pose.cov.diagonal().segment<3>(3).array() +=
      square(config.odometry_rotation_sd_deg * kDegree);
  pose.cov.diagonal().tail<3>().array() += square(config.odometry_velocity_sd_m_s);
  pose.resets = platform.resets();
  if (first_pose == 0) first_pose = frame.t;
  last_pose = frame.t;
  poses_told = poses_told || may_tell_first(pose);
  out.has_external_pose = poses_told;
}

// From the floor an autopilot takes over the heading of the first pose in the air. What
// was sent by its old one until telemetry shows that has it lean elsewhere for a
// quarter of a second: first the drone must be braked.
bool LandingSystem::Parts::may_tell_first(const ExternalPose& pose) const {
  const MissionState state = mission.status().state;
  const bool begins = state == MissionState::taken_off || state == MissionState::follow;
  return !config.mission.start_on_floor || !begins ||
         pose.v_IB.norm() < config.first_pose_speed_max_m_s ||
         to_seconds(pose.captured - first_pose) > config.first_pose_wait_s;
}

Setpoint LandingSystem::Parts::resting_setpoint(const PlatformState& at,
                                                double thrust) const {
  Setpoint setpoint;
  const Vector3& p = x_seen.p_NB;
  const Matrix3& R_IN = at.X_IN.linear();
  const double heading =
      wrap_angle(yaw_of(R_IN) + yaw_of(x_seen.R_NB) + motion.autopilot_heading);
  const Matrix3 R_AI = from_rpy(0, 0, motion.autopilot_heading);
  if (config.interface == ControlInterface::velocity) {
    setpoint.kind = Setpoint::Kind::velocity;
    setpoint.v_IB = R_AI * R_IN * inertial_velocity_N(at, p, Vector3::Zero());
    setpoint.v_IB.z() = thrust > 0 ? 0.5 : -1.0;
    setpoint.yaw = heading;
    setpoint.yaw_rate = at.w_IN_N.z();
    return setpoint;
  }
  // The attitude in which it stands, as the autopilot believes it to be, turning with
  // the platform: any other would wind up its rate loop against the ground and kick the
  // drone over when the feet come free.
  // Its heading is held to the platform's: light on its feet it would stay behind.
  // On the floor, which does not turn, it keeps the heading it was armed with.
  const bool on_floor = config.mission.start_on_floor &&
                        mission.status().state <= MissionState::taken_off;
  const double standing =
      on_floor ? heading_at_rest
               : yaw_of(R_IN) + mission.heading_at_rest() + motion.autopilot_heading;
  setpoint.kind = Setpoint::Kind::attitude;
  const Eigen::Quaterniond below =
      on_floor ? Eigen::Quaterniond::Identity() : deck_tilt(at);
  setpoint.q_IB = (Eigen::AngleAxisd(standing, Vector3::UnitZ()) * below * tilt_at_rest)
                      .normalized();
  setpoint.thrust = thrust;
  return setpoint;
}

void LandingSystem::Parts::square_up(double share, const PlatformState& at,
                                     Output& out) const {
  Eigen::Quaterniond& q = out.setpoint.q_IB;
  const Eigen::Quaterniond standing = resting_setpoint(at, 0).q_IB;
  const double turn = q.angularDistance(standing);
  q = q.slerp(std::min(share, kSquareUpMost / std::max(turn, kSquareUpMost)), standing);
}

void LandingSystem::Parts::control(const MissionCommand& command, Time now,
                                   const MotionState& state, Output& out) {
  const Time acts = now + link.delay() + from_seconds(config.response.delay_ms * 1e-3);
  const Time t_eff = config.delay_compensation ? acts : now;
  response.advance(acts);
  const PlatformState platform_eff = platform.at(t_eff);
  switch (command.mode) {
    case MissionCommand::Mode::silent:
      return;
    case MissionCommand::Mode::idle:
    case MissionCommand::Mode::ramp: {
      const double hover = 1 / config.response.thrust_to_weight;
      const double thrust = command.mode == MissionCommand::Mode::ramp
                                ? std::min(command.ramp_share * hover, 1.0)
                                : 0.0;
      out.setpoint = resting_setpoint(platform_eff, thrust);
      break;
    }
    case MissionCommand::Mode::settle: {
      out.setpoint = last_track;
      // From the last attitude over to the pad's own, as the feet take the weight;
      // with what thrust is left it leans against what would throw it over.
      const double turned = yaw_of(platform.at(now).X_IN.linear()) - last_track_heading;
      const Eigen::Quaterniond last(Eigen::AngleAxisd(turned, Vector3::UnitZ()) *
                                    last_track.q_IB);
      const Matrix3 R_AN =
          from_rpy(0, 0, motion.autopilot_heading) * platform_eff.X_IN.linear();
      const Eigen::Quaterniond standing =
          Eigen::Quaterniond::FromTwoVectors(R_AN.col(2), R_AN * command.f_rest_N) *
          resting_setpoint(platform_eff, 0).q_IB;
      out.setpoint.q_IB = standing.slerp(std::sqrt(command.ramp_share), last);
      out.setpoint.thrust *= command.ramp_share;
      if (config.interface == ControlInterface::velocity) out.setpoint.v_IB.z() = -0.5;
      break;
    }
    case MissionCommand::Mode::track: {
      const auto raised = [&](Time t) {
        FlatState reference = mission.reference(t);
        reference.p_NB.z() += command.raise_m;
        reference.v_NB.z() += command.raise_m_s;
        return reference;
      };
      if (config.interface == ControlInterface::velocity) {
        out.setpoint = pid.step(platform.at(now), state.x, raised(now),
                                std::max(to_seconds(now - last_now), 1e-3),
                                motion.autopilot_heading)
                           .setpoint;
        break;
      }
      AttitudeInput in;
      in.platform = platform_eff;
      in.platform_later = platform.at(t_eff + from_seconds(AttitudeInput::kLater));
      const MotionState ahead = estimator.carried_on(state, now, t_eff, motion);
      in.state = ahead.x;
      in.response = response.at(t_eff);
      in.autopilot_heading = motion.autopilot_heading;
      in.d_N = ahead.d_N;
      in.b_N = ahead.b_N;
      in.reference = raised(t_eff);
      in.tilt_limit_rad = command.tilt_limit;
      out.setpoint =
          attitude.step(in, std::max(to_seconds(now - last_now), 1e-3)).setpoint;
      out.setpoint.thrust = std::max(
          out.setpoint.thrust,
          std::min(command.thrust_least / config.response.thrust_to_weight, 1.0));
      if (command.square_up > 0) square_up(command.square_up, platform_eff, out);
      last_track = out.setpoint;
      last_track_heading = yaw_of(platform.at(now).X_IN.linear());
      break;
    }
  }
  if (alone) {
    unanswered[unanswered_next] = {now + link.delay(), out.setpoint};
    unanswered_next = (unanswered_next + 1) % unanswered.size();
    unanswered_count = std::min(unanswered_count + 1, unanswered.size());
  } else {
    Setpoint felt = out.setpoint;
    if (command.thrust_least > 0) {
      felt.q_IB =
          felt.q_IB.slerp(kFeetHold, resting_setpoint(platform_eff, felt.thrust).q_IB);
    }
    response.sent(felt, now + link.delay());
  }
  if (config.interface == ControlInterface::motion) {
    const MotionState ahead = estimator.initialized()
                                  ? estimator.carried_on(state, now, t_eff, motion)
                                  : state;
    const bool standing = command.mode != MissionCommand::Mode::track;
    out.setpoint =
        as_motion(out.setpoint, own_motion(ahead, platform_eff, t_eff, standing),
                  platform_eff.w_IN_N.z(), config.response);
  }
}

void LandingSystem::step(const Input& input, Output& out, Probe* probe) {
  const ProbeScope scope(probe, Stage::step);
  Parts& p = *parts_;
  out = Output{};
  if (p.started && input.now <= p.last_now) {
    ++p.refused;
    out.trace.events_refused = p.refused;
    out.mission = p.mission.status();
    return;
  }
  if (!p.started) {
    p.started = true;
    p.last_now = input.now;
    p.response.reset(input.now, Matrix3::Identity(), 0);
  }
  p.response.advance(input.now);
  p.wish = OperatorWish::none;
  p.plan = nullptr;
  p.sight.step(input.now);
  if (p.sight.woke() == input.now) p.slept_from = p.last_now;
  for (const Event& event : input.events) p.take(event, input.now, out, probe);

  p.reckon(input.now);
  // No older picture is taken any more, and what moved the drone is forgotten soon.
  p.estimator.advance(input.now - from_seconds(p.config.event_age_max_s), p.motion);
  out.trace.t = input.now;
  out.trace.platform = p.platform.at(input.now);
  out.trace.estimate_valid = p.estimator.initialized();
  MotionState state;
  if (out.trace.estimate_valid) {
    state = p.estimator.carried_to(input.now, p.motion, &out.trace.predicted_cov);
    out.trace.predicted = state.x;
    out.trace.disturbance_N = state.disturbance_N();
  }

  MissionInput in;
  in.now = input.now;
  in.wish = p.wish;
  in.telemetry_heard = p.telemetry_heard;
  in.armed = p.telemetry.armed;
  in.mode = p.telemetry.mode;
  in.battery = p.telemetry.battery;
  in.told = p.telemetry.captured;
  in.climb = p.telemetry.climb;
  in.stands_on_floor = p.floor.stands();
  in.link = &p.link;
  in.platform_ready = p.platform.ready() && !p.platform.stale(input.now);
  in.estimate_valid = out.trace.estimate_valid;
  in.x = state.x;
  in.x_seen = p.x_seen;
  const Seconds acts =
      to_seconds(p.link.delay()) +
      1e-3 * (p.config.response.thrust_delay_ms + p.config.response.motor_ms);
  if (p.config.delay_compensation) {
    in.acts_in = to_seconds(p.link.delay()) + 1e-3 * p.config.response.delay_ms;
  }
  in.thrust_acts_in = acts;
  in.z_acted = state.x.p_NB.z() + acts * state.x.v_NB.z();
  in.seen = p.estimator.last_sight();
  in.motion_known = std::max(in.seen, p.reckoned);
  if (in.estimate_valid) {
    // At the touch it is nearer to the lens, about which a mount that is off turns it.
    const RelativeFilter& filter = p.estimator.filter();
    const Vector3 touch_N(0, 0, p.rig.drone.gear_height_m);
    in.miss_sd_m = miss_sd(out.trace.predicted_cov +
                           filter.mount_covariance(touch_N, state.x.v_NB) -
                           filter.mount_covariance(state.x.p_NB, state.x.v_NB));
  }
  in.picture_repeats = p.estimator.picture_repeats();
  p.sight.frozen(in.picture_repeats);
  in.blindness = p.sight.why(input.now);
  if (in.blindness == Blindness::leds && !in.platform_ready) {
    in.blindness = Blindness::odometry;
  }
  in.computer_was_late = p.sight.computer_was_late(input.now);
  in.woke = p.sight.woke();
  in.platform = out.trace.platform;
  p.deck.add(input.now, p.platform, Vector3(0, 0, p.rig.drone.gear_height_m));
  FlatState over_pad;
  over_pad.p_NB.z() = p.rig.drone.gear_height_m;
  const Vector3 f_now_N =
      wished_force_N(in.platform, over_pad, state.disturbance_N(Vector3::Zero()),
                     p.config.attitude.drag_per_s);
  const auto at_rest_N = [&](Seconds ahead) {
    Vector3 f_N = f_now_N;
    f_N.head<2>() += p.deck.force_N(ahead) - p.deck.force_N(0);
    return f_N;
  };
  in.f_touch_N = at_rest_N(kTouchAhead);
  // When exactly it touches is not known.
  const Seconds touches = p.mission.touches_in(in);
  in.f_end_N = at_rest_N(touches);
  for (const Seconds at : {touches - kTouchUnsure, touches + kTouchUnsure}) {
    const Vector3 f_N = at_rest_N(at);
    if (f_N.head<2>().norm() > in.f_end_N.head<2>().norm()) in.f_end_N = f_N;
  }
  in.push_N = state.disturbance_N(Vector3::Zero());
  in.deck_swing = p.deck.swing();
  in.plan = p.plan;
  MissionCommand command;
  {
    const ProbeScope mission_scope(probe, Stage::mission);
    command = p.mission.step(in, out);
  }
  p.motion.on_ground = command.on_ground;
  if (!command.on_ground) p.estimator.expect_nothing();
  p.estimator.set_on_floor(p.config.mission.start_on_floor && command.on_ground);
  if (p.mission.status().state == MissionState::armed && !p.calibrated) {
    p.calibrated = true;
    if (const auto fit = p.estimator.calibrate_at_rest()) {
      p.x_seen = p.estimator.filter().state();
      state = p.estimator.carried_to(input.now, p.motion);
    }
  }
  if (command.lifted) {
    // The ground no longer says what the thrust is worth: at lift-off it equals weight.
    // When that was is known to a tenth of a second, in which thrust grows by as much
    // as the drone's mass may be off. A drone that slides only has less of it yet.
    Vector3 b_N = Vector3::Zero();
    if (command.carried) {
      const double thrust =
          p.response.at(in.seen - from_seconds(command.lifted_since)).thrust_m_s2;
      b_N.z() =
          kLiftTrust * kGravity * (kGravity / std::max(thrust, 0.5 * kGravity) - 1);
    }
    p.estimator.restart_disturbance(Vector3::Zero(), b_N);
    state.d_N.setZero();
    state.b_N = b_N;
    p.pid.reset();
    p.attitude.reset();
  }
  {
    const ProbeScope control_scope(probe, Stage::control);
    p.control(command, input.now, state, out);
  }
  out.order = command.order;
  out.platform_speed_wish = command.platform_speed_wish;
  out.trace.reference = p.mission.reference(input.now);
  out.trace.reference_valid = command.mode == MissionCommand::Mode::track;
  out.trace.link_delay_ms = p.link.delay_ms();
  out.trace.heading_offset = p.motion.autopilot_heading;
  out.trace.events_refused = p.refused;
  p.last_now = input.now;
}

}  // namespace alight
