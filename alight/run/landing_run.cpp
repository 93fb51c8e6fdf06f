#include "alight/run/landing_run.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>

#include "alight/eval/statistics.h"
#include "alight/planning/planner.h"
#include "alight/planning/rig_fit.h"
#include "alight/run/cpu_time.h"
#include "alight/run/timing_probe.h"
#include "alight/sim/camera_faults.h"
#include "alight/sim/camera_renderer.h"

namespace alight {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kHardContact = 0.8;  // m/s, CONTRACT
constexpr double kTrackedM = 0.15;    // CONTRACT: tracked
constexpr double kTrackedRad = 15 * kDegree;
constexpr Seconds kRestAfterStop = 1.0;
// From when the autopilot is told to follow again to when that shows.
constexpr Seconds kHelpless = 0.5;
// A rolling shutter takes a tenth of a second at most: straight ways in between do.
constexpr int kRollingPieces = 6;
constexpr std::size_t kCameraBuffers = 8;  // pictures that wait; then the oldest goes

/// A picture taken, on its way to the brain.
struct Exposure {
  std::uint64_t index = 0;
  Time captured = 0;
  Time received = 0;
  FixedVector<SceneAt, kMaxInstants> scene;
  SceneAt depth_scene;
  TruthState truth;
  PictureTrouble trouble;
  bool has_depth = true;
};

struct Squares {
  double sum = 0;
  int count = 0;
  void add(double square) {
    sum += square;
    ++count;
  }
  double root() const { return count > 0 ? std::sqrt(sum / count) : kNaN; }
  double mean() const { return count > 0 ? sum / count : kNaN; }
};

/// Gathers the figures of result.json.
class Tally {
 public:
  explicit Tally(const Rig& rig) : outline_(rig) {}

  void frame(const FrameReport& report, const TruthState& truth) {
    if (report.tracked) begun_ = true;
    if (!begun_) return;
    ++frames_;
    if (!report.tracked) return;
    const Vector9 e = boxminus(truth.relative(), report.x);
    position_.add(e.head<3>().squaredNorm());
    rotation_.add(e.segment<3>(3).squaredNorm());
    velocity_.add(e.tail<3>().squaredNorm());
    if (e.head<3>().norm() < kTrackedM && e.segment<3>(3).norm() < kTrackedRad)
      ++tracked_;
    const double nees = e.dot(report.cov.ldlt().solve(e));
    if (std::isfinite(nees)) nees_.add(nees);
  }

  void step(const Output& out, const TruthState& truth, const ContactReport& contact) {
    platform_speed_ = std::max(platform_speed_, truth.platform.v_IN_N.norm());
    if (contact.flown && !contact.touched_down) {
      drone_speed_ = std::max(drone_speed_, truth.v_IB.norm());
    }
    if (!out.trace.reference_valid) return;
    const double square =
        (truth.X_NB.translation() - out.trace.reference.p_NB).squaredNorm();
    switch (out.mission.state) {
      case MissionState::follow:
        follow_.add(square);
        break;
      case MissionState::rendezvous:
      case MissionState::land:
        if (!contact.touched_down) tracking_.add(square);
        break;
      default:
        break;
    }
  }

  /// Also when the brain is not run.
  /// @param cut_off  Nothing gets from the brain to the drone, or back.
  void lost_link(const TruthState& truth, const ContactReport& contact, bool cut_off) {
    // Also one that is left so while its motors lift it off the pad.
    const bool alone = truth.mode == AutopilotMode::failsafe && truth.motors_running &&
                       !contact.touched_down && !contact.landed_elsewhere;
    // A pad that it still stands on takes it along.
    if (alone && !(alone_ && contact.flown)) {
      alone_from_ = truth.X_IB.translation().head<2>();
    }
    if (alone && !alone_) {
      over_platform_ = !outline_.clear(truth.X_NB.translation());
    }
    alone_ = alone;
    if (alone && cut_off) helpless_until_ = truth.t;
    if (alone && !lost_link_ && (contact.flown || contact.struck)) {
      lost_link_ = {0, 0, false};
    }
    if (!met_ && (contact.touched_down || contact.struck || contact.landed_elsewhere)) {
      met_ = true;
      if (lost_link_) {
        lost_link_->helpless =
            over_platform_ && to_seconds(truth.t - helpless_until_) < kHelpless;
      }
    }
    if (!alone || met_ || !contact.flown) return;
    const double way = (truth.X_IB.translation().head<2>() - alone_from_).norm();
    const double sink = -truth.v_IB.z();
    lost_link_->drift_m = std::max(lost_link_->drift_m, way);
    lost_link_->sink_m_s = std::max(lost_link_->sink_m_s, sink);
  }

  void report(LandingResult& r) const {
    r.lost_link = lost_link_;
    r.tracking_rmse_m = tracking_.root();
    r.follow_rmse_m = follow_.root();
    r.estimate.position_rmse_m = position_.root();
    r.estimate.rotation_rmse_deg = rotation_.root() / kDegree;
    r.estimate.velocity_rmse_m_s = velocity_.root();
    r.estimate.tracked_fraction =
        frames_ > 0 ? static_cast<double>(tracked_) / frames_ : 0;
    r.estimate.nees_mean = nees_.mean();
    r.platform_speed_max_m_s = platform_speed_;
    r.drone_speed_max_m_s = drone_speed_;
  }

 private:
  PlatformOutline outline_;
  bool alone_ = false, over_platform_ = false, met_ = false;
  Time helpless_until_ = 0;
  Vector2 alone_from_ = Vector2::Zero();
  std::optional<LandingResult::LostLink> lost_link_;
  bool begun_ = false;
  int frames_ = 0, tracked_ = 0;
  Squares position_, rotation_, velocity_, nees_, tracking_, follow_;
  double platform_speed_ = 0, drone_speed_ = 0;
};

Percentiles percentiles(const std::vector<double>& us) {
  return {percentile(us, 0.5), percentile(us, 0.99),
          us.empty() ? kNaN : *std::max_element(us.begin(), us.end())};
}

CameraSimConfig camera_config(const LandingRunOptions& options) {
  const Scenario& scenario = options.scenario;
  CameraSimConfig config;
  // No picture reaches the brain before its own depth was captured.
  const double apart =
      std::min(scenario.camera.depth_offset_ms, options.rig.timing.frame_to_use_ms);
  config.depth_offset_ms =
      apart * Rng(options.seed).fork("depth offset").uniform(-1, 1);
  config.led_axis_B = leds_face(options.rig);
  config.lights = scenario.camera.lights;
  config.pad_reflectance = scenario.camera.pad_reflectance;
  config.jpeg = scenario.camera.jpeg;
  config.noise = scenario.camera.noise;
  return config;
}

LandingConfig landing_config(const LandingRunOptions& options) {
  LandingConfig config = options.profile == Profile::paper
                             ? LandingConfig::paper(options.rig)
                             : LandingConfig::standard(options.rig);
  if (options.scenario.autopilot.interface == AutopilotInterface::velocity &&
      options.profile != Profile::paper) {
    config.interface = ControlInterface::motion;
  }
  for (const Part part : options.without) config = without(part, config);
  config.mission.start_on_floor = options.scenario.start.place == StartPlace::floor;
  config.mission.safety = options.safety;
  return config;
}

SceneAt scene(const TruthState& truth) { return {truth.platform.X_IN, truth.X_NB}; }

}  // namespace

std::string configuration_name(Profile profile, const std::vector<Part>& without) {
  std::string name = profile == Profile::paper ? "paper" : "default";
  if (!without.empty()) name += " without";
  for (const Part part : without) name += std::string(" ") + to_string(part);
  return name;
}

const char* to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::landed:
      return "landed";
    case Outcome::held:
      return "held";
    case Outcome::aborted:
      return "aborted";
    case Outcome::refused:
      return "refused";
    case Outcome::landed_elsewhere:
      return "landed_elsewhere";
    case Outcome::lost_link_landing:
      return "lost_link_landing";
    case Outcome::crashed:
      return "crashed";
    case Outcome::timeout:
      return "timeout";
  }
  return "timeout";
}

namespace {

/// The loop's parts, so that its steps can be read one by one.
class Loop {
 public:
  Loop(const LandingRunOptions& options, RunObserver* observer,
       std::unique_ptr<World> world, CameraRenderer renderer, Time depth_offset,
       LandingSystem brain, Planner planner)
      : options_(options),
        observer_(observer),
        world_(std::move(world)),
        renderer_(std::move(renderer)),
        depth_offset_(depth_offset),
        brain_(std::move(brain)),
        planner_(std::move(planner)),
        tally_(options.rig),
        camera_faults_(options.scenario.faults, Rng(options.seed).fork("picture")) {
    events_.reserve(256);
  }

  Result<LandingResult> run();

 private:
  Result<void> take_pictures(Time now);
  void hand_over(Exposure e);
  Result<void> gather(Time now);
  void operator_of_faults(Time now);
  void carry_out(Time now);
  bool cut_off(Time now) const;
  void judge(LandingResult& result) const;

  const LandingRunOptions& options_;
  RunObserver* observer_;
  std::unique_ptr<World> world_;
  CameraRenderer renderer_;
  Time depth_offset_;  // after mid-exposure of colour
  LandingSystem brain_;
  Planner planner_;

  Tally tally_;
  TimingProbe probe_;
  Output out_;
  std::vector<Event> events_;
  SensorBatch batch_;
  CameraFaults camera_faults_;
  std::deque<Exposure> exposures_;
  std::optional<Exposure> last_good_;
  std::deque<PlanArrival> plans_;
  std::deque<ColorBuffer> colors_;  // of this step's pictures
  std::deque<DepthBuffer> depths_;
  std::vector<TruthState> frame_truth_;
  std::uint64_t next_picture_ = 0;
  Time last_received_ = 0;
  bool said_go_ = false;
  bool said_hold_ = false;
  Time operator_heard_ = 0;  // up to then what faults make the operator say was said
  bool was_lost_link_ = false;
  Time stopped_at_ = -1;
};

Result<void> Loop::take_pictures(Time now) {
  const double period = 1 / options_.rig.timing.rate_hz;
  for (;;) {
    const Time t = from_seconds((static_cast<double>(next_picture_) + 0.5) * period);
    const PictureTrouble trouble = camera_faults_.at(t, next_picture_);
    // What is asked for beyond the longest exposure is gain.
    const CameraTiming& timing = options_.rig.timing;
    const Time half = from_seconds(0.5 * span_of(timing, trouble.exposure_factor));
    if (t + std::max(half, depth_offset_) > now) return {};
    Exposure e;
    e.index = next_picture_++;
    e.trouble = trouble;
    e.captured = t;
    e.received = t + from_seconds(1e-3 * options_.rig.timing.frame_to_use_ms);
    e.truth = world_->truth_at(t);
    const int pieces = timing.readout_ms > 0 ? kRollingPieces : 2;
    for (int k = 0; k <= pieces; ++k) {
      e.scene.push_back(scene(world_->truth_at(t + (2 * k - pieces) * half / pieces)));
    }
    e.depth_scene = scene(world_->truth_at(t + depth_offset_));
    hand_over(e);
  }
}

void Loop::hand_over(Exposure e) {
  const Time t = e.captured;
  if (world_->fault(FaultKind::camera_out, t) != nullptr) return;
  if (world_->fault(FaultKind::camera_freeze, t) == nullptr) {
    last_good_ = e;
  } else if (last_good_) {  // the same index draws the same pixels
    e.index = last_good_->index;
    e.scene = last_good_->scene;
    e.depth_scene = last_good_->depth_scene;
    e.trouble = last_good_->trouble;
  }
  e.has_depth = world_->fault(FaultKind::depth_out, t) == nullptr;
  if (const auto* late = world_->fault(FaultKind::camera_late, t)) {
    e.received += from_seconds(1e-3 * late->late_ms);
  }
  // None overtakes the one before, whose copy comes with it at the latest.
  e.received = std::max(e.received, last_received_);
  last_received_ = e.received;
  if (!exposures_.empty()) {
    Time& before = exposures_.back().received;
    before = std::min(before, e.received);
  }
  exposures_.push_back(e);
  if (world_->fault(FaultKind::camera_repeat, t) != nullptr) {
    e.received += from_seconds(1 / options_.rig.timing.rate_hz);
    exposures_.push_back(e);
  }
}

Result<void> Loop::gather(Time now) {
  events_.clear();
  frame_truth_.clear();
  batch_.clear();
  world_->collect(now, batch_);
  for (const auto& e : batch_.odometry) events_.emplace_back(e);
  for (const auto& e : batch_.imu) events_.emplace_back(e);
  for (const auto& e : batch_.telemetry) events_.emplace_back(e);
  for (const auto& e : batch_.link) events_.emplace_back(e);
  std::size_t used = 0;
  while (!exposures_.empty() && exposures_.front().received <= now) {
    if (exposures_.size() > kCameraBuffers &&
        exposures_[kCameraBuffers].received <= now) {
      exposures_.pop_front();
      continue;
    }
    const Exposure& e = exposures_.front();
    if (colors_.size() <= used) {
      colors_.emplace_back();
      depths_.emplace_back();
    }
    ColorBuffer& color = colors_[used];
    DepthBuffer& depth = depths_[used];
    const bool with_depth = options_.depth && e.has_depth;
    const auto rendered =
        renderer_.render(e.index, {e.scene.data(), e.scene.size()}, color,
                         with_depth ? &depth : nullptr, &e.depth_scene, &e.trouble);
    if (!rendered) return fail(rendered.error());
    CameraFrame frame;
    frame.captured = e.captured;
    frame.received = e.received;
    frame.color = color.view();
    if (with_depth) frame.depth = depth.view();
    if (observer_ != nullptr) observer_->on_picture(frame);
    events_.emplace_back(frame);
    frame_truth_.push_back(e.truth);
    exposures_.pop_front();
    ++used;
  }
  while (!plans_.empty() && plans_.front().received <= now) {
    events_.emplace_back(plans_.front());
    plans_.pop_front();
  }
  if (!said_go_ && to_seconds(now) >= options_.go_at_s) {
    said_go_ = true;
    events_.emplace_back(OperatorInput{now, now, OperatorWish::go});
  }
  if (!said_hold_ && to_seconds(now) >= options_.hold_at_s) {
    said_hold_ = true;
    events_.emplace_back(OperatorInput{now, now, OperatorWish::hold});
  }
  operator_of_faults(now);
  return {};
}

void Loop::operator_of_faults(Time now) {
  const auto due = [&](double at_s) {
    const Time at = from_seconds(at_s);
    return at > operator_heard_ && at <= now;
  };
  for (const FaultScenario& f : options_.scenario.faults) {
    const bool hold = f.kind == FaultKind::operator_hold;
    if (!hold && f.kind != FaultKind::operator_abort) continue;
    if (due(f.at_s)) {
      events_.emplace_back(
          OperatorInput{now, now, hold ? OperatorWish::hold : OperatorWish::abort});
    }
    if (hold && due(f.at_s + f.for_s)) {
      events_.emplace_back(OperatorInput{now, now, OperatorWish::go});
    }
  }
  operator_heard_ = now;
}

bool Loop::cut_off(Time now) const {
  constexpr std::array<FaultKind, 5> kCut = {
      FaultKind::radio_stall, FaultKind::radio_out, FaultKind::uplink_out,
      FaultKind::telemetry_out, FaultKind::computer_stall};
  return std::any_of(kCut.begin(), kCut.end(), [&](FaultKind kind) {
    return world_->fault(kind, now) != nullptr;
  });
}

void Loop::carry_out(Time now) {
  world_->send(out_.setpoint, now);
  if (out_.has_external_pose) world_->send(out_.external_pose, now);
  if (out_.order != AutopilotOrder::none) world_->send(out_.order, now);
  world_->wish_platform_speed(out_.platform_speed_wish *
                              options_.scenario.platform.speed_m_s);
  if (out_.mission.state == MissionState::follow) world_->start_platform();
  if (out_.has_plan_request) {
    PlanArrival arrival;
    arrival.result = planner_.plan(out_.plan_request);
    const auto* late = world_->fault(FaultKind::planner_late, now);
    const double delay_ms =
        options_.scenario.planner_delay_ms + (late != nullptr ? late->late_ms : 0);
    arrival.received = now + from_seconds(1e-3 * delay_ms);
    if (observer_ != nullptr) observer_->on_plan(out_.plan_request, arrival.result);
    plans_.push_back(arrival);
  }
  // How it came down is decided by the last state it flew in.
  if (out_.mission.state != MissionState::complete) {
    was_lost_link_ = out_.mission.state == MissionState::lost_link;
  }
}

void Loop::judge(LandingResult& result) const {
  const ContactReport& contact = world_->contact();
  const MissionStatus& mission = out_.mission;
  result.attempts = mission.attempts;
  result.reason = mission.reason;
  if (contact.touched_down) {
    const Vector3 p = world_->truth().X_NB.translation();
    result.touchdown = LandingResult::Touchdown{
        to_seconds(contact.first_contact), p.head<2>().norm(),
        contact.relative_speed_m_s, contact.tilt_deg, contact.yaw_error_deg};
  }
  const bool stopped = stopped_at_ >= 0;
  if (contact.struck) {
    result.outcome = Outcome::crashed;
    result.reason = std::string("struck: ") + contact.struck_what;
  } else if (contact.touched_down && contact.relative_speed_m_s > kHardContact) {
    result.outcome = Outcome::crashed;
    result.reason = "first contact was too hard";
  } else if (mission.state == MissionState::refused) {
    result.outcome = Outcome::refused;
  } else if (stopped && contact.flown) {
    if (was_lost_link_) {
      result.outcome = Outcome::lost_link_landing;
    } else if (mission.state == MissionState::aborted) {
      result.outcome = Outcome::aborted;
    } else if (world_->standing_on_pad()) {
      result.outcome = Outcome::landed;
    } else if (contact.landed_elsewhere) {
      result.outcome = Outcome::landed_elsewhere;
      result.reason = std::string("came to rest off the pad: ") + mission.reason;
    } else {
      result.outcome = Outcome::crashed;
      result.reason = "came to rest not on its feet inside the pad";
    }
  } else if (stopped) {
    result.outcome = Outcome::refused;  // it ended before it had flown
  } else if (mission.state == MissionState::hold ||
             mission.state == MissionState::pilot ||
             world_->truth().mode == AutopilotMode::hold) {
    result.outcome = Outcome::held;  // also by a pilot of whom nothing is heard
  } else if (mission.state == MissionState::aborted) {
    result.outcome = Outcome::aborted;
  } else {
    result.outcome = Outcome::timeout;
  }
}

Result<LandingResult> Loop::run() {
  const double began_us = thread_cpu_us();
  const Time period = from_seconds(1e-3 * options_.step_ms);
  const Time end = from_seconds(options_.timeout_s);
  if (observer_ != nullptr) observer_->on_world(*world_);
  Time now = 0;
  for (now = period; now <= end; now += period) {
    world_->advance_to(now);
    tally_.lost_link(world_->truth(), world_->contact(), cut_off(now));
    if (auto good = take_pictures(now); !good) return fail(good.error());
    if (world_->fault(FaultKind::computer_stall, now) != nullptr) continue;
    if (auto good = gather(now); !good) return fail(good.error());
    const double step_began_us = thread_cpu_us();
    brain_.step({now, events_}, out_, &probe_);
    const double us = thread_cpu_us() - step_began_us;
    carry_out(now);

    const TruthState& truth = world_->truth();
    tally_.step(out_, truth, world_->contact());
    for (const FrameReport& frame : out_.trace.frames) {
      for (const TruthState& at : frame_truth_) {
        if (at.t != frame.t) continue;
        if (!world_->contact().touched_down) tally_.frame(frame, at);
        if (observer_ != nullptr) observer_->on_frame(frame, at, us);
        break;  // a picture that came twice has its truth twice
      }
    }
    if (observer_ != nullptr) observer_->on_step(out_, truth, us);

    const bool over = out_.mission.state == MissionState::complete ||
                      out_.mission.state == MissionState::refused ||
                      out_.mission.state == MissionState::aborted ||
                      out_.mission.state == MissionState::lost_link;
    const bool still = !truth.motors_running && (over || world_->contact().struck);
    if (!still) {
      stopped_at_ = -1;
    } else if (stopped_at_ < 0) {
      stopped_at_ = now;
    } else if (to_seconds(now - stopped_at_) >= kRestAfterStop) {
      break;
    }
  }
  LandingResult result;
  judge(result);
  tally_.report(result);
  if (result.outcome == Outcome::crashed && result.lost_link &&
      result.lost_link->helpless) {
    result.reason += ", left alone over the platform: no abort was possible";
  }
  result.simulated_s = to_seconds(std::min(now, end));
  result.realtime_factor = result.simulated_s / (1e-6 * (thread_cpu_us() - began_us));
  for (int i = 0; i < kStages; ++i) {
    const auto stage = static_cast<Stage>(i);
    result.timing_us[to_string(stage)] = percentiles(probe_.us(stage));
  }
  result.events_refused = out_.trace.events_refused;
  return result;
}

}  // namespace

Result<LandingResult> run_landing(const LandingRunOptions& options,
                                  RunObserver* observer) {
  if (auto good = options.scenario.validate(); !good) return fail(good.error());
  auto brain = LandingSystem::create(landing_config(options), options.rig);
  if (!brain) return fail(brain.error());
  const PlannerConfig plans =
      options.profile == Profile::paper ? PlannerConfig::paper() : PlannerConfig{};
  if (auto good = check_view_of_pad(plans, options.rig); !good) {
    return fail(good.error());
  }
  auto planner = Planner::create(plans, options.rig);
  if (!planner) return fail(planner.error());
  auto world = World::create(options.scenario, options.rig, options.seed);
  if (!world) return fail(world.error());
  const CameraSimConfig camera = camera_config(options);
  Rig flown = (*world)->true_rig().rig;
  if (options.scenario.camera.gamma > 0) flown.gamma = options.scenario.camera.gamma;
  auto renderer = CameraRenderer::create(camera, flown, options.seed);
  if (!renderer) return fail(renderer.error());
  Loop loop(options, observer, std::move(*world), std::move(*renderer),
            from_seconds(1e-3 * camera.depth_offset_ms), std::move(*brain),
            std::move(*planner));
  return loop.run();
}

}  // namespace alight
