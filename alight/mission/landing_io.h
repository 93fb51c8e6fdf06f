#pragma once
#include <cstdint>
#include <span>
#include <variant>

#include "alight/base/fixed_vector.h"
#include "alight/geometry/flat_state.h"
#include "alight/geometry/led_frame.h"
#include "alight/geometry/sensor_events.h"
#include "alight/planning/plan.h"

namespace alight {

/// A plan comes back from wherever it was computed.
struct PlanArrival {
  Time received = 0;
  PlanResult result;
};

using Event =
    std::variant<CameraFrame, PlatformOdometry, PlatformImu, AutopilotTelemetry,
                 LinkStatus, PlanArrival, OperatorInput, TruthSample>;

/// All that LandingSystem::step may know.
struct Input {
  Time now = 0;                   ///< Strictly later than the last step's.
  std::span<const Event> events;  ///< Since the last step, in order of arrival.
};

/// The paper's states, then what it lacks.
enum class MissionState : std::uint8_t {
  idle,
  armed,
  taken_off,
  follow,
  rendezvous,
  land,
  shut_down,
  complete,
  hold,         ///< The operator holds the drone at the follow point.
  go_around,    ///< Backs out of a landing to the follow point.
  lost_target,  ///< Flies on the prediction and searches.
  lost_link,    ///< Only the autopilot acts.
  aborted,      ///< Ended in the air: the autopilot lands by itself.
  refused,      ///< Never left the ground.
  pilot,        ///< The pilot flies: nothing is ordered until he gives it back.
};
const char* to_string(MissionState state);

/// Why the mission is in its state: one sentence, static text.
struct MissionStatus {
  MissionState state = MissionState::idle;
  const char* reason = "waiting for the operator";
  Time since = 0;
  int attempts = 0;  ///< Landings begun.
};

/// A change of state, to be logged and shown.
struct MissionTransition {
  Time t = 0;
  MissionState from = MissionState::idle;
  MissionState to = MissionState::idle;
  const char* reason = "";
};

/// What became of one LED observation in the filter.
struct LedUse {
  LedObservation observation;
  double nis = 0;  ///< Normalized innovation squared.
};

/// One camera frame as the estimator used it.
struct FrameReport {
  Time t = 0;  ///< Mid-exposure as told by the camera.
  bool tracked = false;
  bool initialized = false;  ///< Found without a prior in this frame.
  RelativeState x;           ///< At `t`, from data up to then.
  Covariance9 cov = Covariance9::Identity();
  FixedVector<LedUse, kMaxLeds> leds;
  FixedVector<RefusedBlob, kMaxRefused> refused;
  double reprojection_px = 0;  ///< rms
  int blobs = 0;
  const char* why_not = "";  ///< When not tracked.
};

/// Everything a person would want to plot, of one step.
struct Trace {
  Time t = 0;
  bool estimate_valid = false;
  RelativeState predicted;  ///< At `t`, as control used it.
  Covariance9 predicted_cov = Covariance9::Identity();
  FlatState reference;  ///< At `t`.
  bool reference_valid = false;
  PlatformState platform;                   ///< At `t`, as tracked.
  Vector3 disturbance_N = Vector3::Zero();  ///< m/s^2
  double link_delay_ms = 0;
  double heading_offset = 0;  ///< Autopilot's heading minus ours, rad.
  FixedVector<FrameReport, 4> frames;
  std::uint32_t events_refused = 0;  ///< Too old, out of order or damaged, since start.
};

/// All that LandingSystem::step says; of fixed size.
struct Output {
  Setpoint setpoint;
  AutopilotOrder order = AutopilotOrder::none;
  bool has_external_pose = false;  ///< Only while its speed is known.
  ExternalPose external_pose;
  double platform_speed_wish =
      1;  ///< Share of the speed the platform drives at, 0 to 1.
  bool has_plan_request = false;
  PlanRequest plan_request;
  MissionStatus mission;
  FixedVector<MissionTransition, 8> transitions;  ///< In this step.
  Trace trace;
};

/// Stages that a Probe can time.
enum class Stage : std::uint8_t { step, detect, associate, filter, mission, control };
inline constexpr int kStages = 6;
const char* to_string(Stage stage);

/// Told where stages begin and end; can influence nothing.
class Probe {
 public:
  virtual ~Probe() = default;
  virtual void begin(Stage stage) = 0;
  virtual void end(Stage stage) = 0;
};

/// Marks a stage for as long as it lives. `probe` may be null.
class ProbeScope {
 public:
  ProbeScope(Probe* probe, Stage stage) : probe_(probe), stage_(stage) {
    if (probe_ != nullptr) probe_->begin(stage_);
  }
  ~ProbeScope() {
    if (probe_ != nullptr) probe_->end(stage_);
  }
  ProbeScope(const ProbeScope&) = delete;
  ProbeScope& operator=(const ProbeScope&) = delete;

 private:
  Probe* probe_;
  Stage stage_;
};

}  // namespace alight
