#pragma once
#include <Eigen/Core>

#include "alight/base/result.h"
#include "alight/base/time.h"
#include "alight/geometry/flat_state.h"
#include "alight/geometry/platform_state.h"
#include "alight/geometry/relative_state.h"
#include "alight/geometry/setpoint.h"

namespace alight {

using Vector4 = Eigen::Vector4d;

/// The paper's controller (sec:MP_control), as its authors set it: gains on x, y, z of
/// N and yaw. It follows a platform of speed v at v / kp.
struct PidControllerConfig {
  Vector4 kp{2.5, 2.5, 1.5, 1.0};   ///< 1/s
  Vector4 ki{0.3, 0.3, 0.3, 0.05};  ///< 1/s^2
  Vector4 kd{0.1, 0.1, 0.1, 0.0};
  Vector4 integral_max{1, 1, 1, 0.5};  ///< Bound on the integral's share, m/s and rad/s
  double speed_max_m_s = 3;            ///< Of the feedback's velocity
  double yaw_rate_max_deg_s = 90;

  Result<void> validate() const;
};

struct PidOutput {
  Setpoint setpoint;  ///< velocity
  Vector3 p_error_N = Vector3::Zero();
  bool limited = false;
  bool invalid = false;  ///< Input was not finite: velocity zero, integral kept.
};

/// Errors in N, velocity set-point rotated to I.
class PidController {
 public:
  static Result<PidController> create(const PidControllerConfig& config);

  /// `dt` s since the last step; `platform`, `state`, `reference` at the same instant.
  /// `autopilot_heading` as in AttitudeInput.
  PidOutput step(const PlatformState& platform, const RelativeState& state,
                 const FlatState& reference, Seconds dt, double autopilot_heading = 0);
  void reset();

 private:
  explicit PidController(const PidControllerConfig& config) : config_(config) {}
  PidControllerConfig config_;
  Vector4 integral_ = Vector4::Zero();  // of ki * error
  Vector4 last_error_ = Vector4::Zero();
  bool has_last_ = false;
};

}  // namespace alight
