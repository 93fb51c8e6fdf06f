#pragma once
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "alight/base/result.h"
#include "alight/mission/ablation.h"
#include "alight/mission/landing_system.h"
#include "alight/planning/plan.h"
#include "alight/sim/world.h"

namespace alight {

/// One simulated landing, start to end: the world, the pictures, the radio and the
/// brain in one loop. Same options, same bits.
struct LandingRunOptions {
  Scenario scenario;
  Rig rig;  ///< As written down; the one that flies is drawn around it.
  Safety safety;
  Profile profile = Profile::standard;
  std::uint64_t seed = 1;
  double timeout_s = 60;
  double step_ms = 10;
  double go_at_s = 1;  ///< When the operator says go,
  double hold_at_s = std::numeric_limits<double>::infinity();  ///< and hold.
  bool depth = true;               ///< Render depth pictures too.
  std::vector<Part> without = {};  ///< Parts that are left out (standard profile).
};

/// "paper", "default" or "default without PART ...": what stores and records call it.
std::string configuration_name(Profile profile, const std::vector<Part>& without);

enum class Outcome : std::uint8_t {
  landed,
  held,
  aborted,
  refused,
  landed_elsewhere,
  lost_link_landing,
  crashed,
  timeout
};
const char* to_string(Outcome outcome);

struct Percentiles {
  double p50 = 0;
  double p99 = 0;
  double max = 0;
};

/// What result.json says (CONTRACT). NaN where a figure does not exist.
struct LandingResult {
  Outcome outcome = Outcome::timeout;
  std::string reason;
  int attempts = 0;
  struct Touchdown {
    double t_s, error_m, relative_speed_m_s, tilt_deg, yaw_error_deg;
  };
  std::optional<Touchdown> touchdown;
  /// While the autopilot acted for want of set-points, up to touch: how far it got over
  /// the ground from where that began, and how fast it sank.
  struct LostLink {
    double drift_m, sink_m_s;
    /// It began on or over the platform, and the drone met that or the floor while
    /// nothing got from the brain to it or back, or less than 0.5 s after: no abort was
    /// possible.
    bool helpless = false;
  };
  std::optional<LostLink> lost_link;
  double tracking_rmse_m = 0;
  double follow_rmse_m = 0;
  struct Estimate {
    double position_rmse_m, rotation_rmse_deg, velocity_rmse_m_s, tracked_fraction,
        nees_mean;
  } estimate{};
  double platform_speed_max_m_s = 0;
  double drone_speed_max_m_s = 0;
  double simulated_s = 0;
  double realtime_factor = 0;
  std::map<std::string, Percentiles> timing_us;
  std::uint32_t events_refused = 0;
};

/// Sees everything, influences nothing.
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  virtual void on_world(const World&) {}
  /// A picture as the brain gets it, before the step that uses it.
  virtual void on_picture(const CameraFrame&) {}
  /// A step with the truth of its instant; `us` is what the step took.
  virtual void on_step(const Output&, const TruthState&, double /*us*/) {}
  /// The truth at a frame's mid-exposure.
  virtual void on_frame(const FrameReport&, const TruthState&, double /*us*/) {}
  virtual void on_plan(const PlanRequest&, const PlanResult&) {}
};

/// invalid_config when scenario or rig do not hold.
Result<LandingResult> run_landing(const LandingRunOptions& options,
                                  RunObserver* observer = nullptr);

}  // namespace alight
