#pragma once
#include <cstdint>
#include <limits>

#include "alight/base/time.h"
#include "alight/geometry/image.h"
#include "alight/geometry/platform_state.h"
#include "alight/geometry/relative_state.h"
#include "alight/geometry/setpoint.h"

namespace alight {

/// What reaches the brain, each with the time it was captured and received on the
/// brain's clock. Nothing here is the truth, but TruthSample, which is never acted on.

/// A picture; the pixels stay the sender's and are read only during the step.
struct CameraFrame {
  Time captured = 0;  ///< Mid-exposure.
  Time received = 0;
  ImageView color;
  DepthView depth;  ///< Empty when there is none.
};

struct PlatformOdometry {
  Time captured = 0;
  Time received = 0;
  Pose X_IN = Pose::Identity();
  Vector3 v_IN_N = Vector3::Zero();
  Vector3 w_IN_N = Vector3::Zero();
  std::uint32_t resets = 0;  ///< Counts the jumps the odometry knows of.
};

struct PlatformImu {
  Time captured = 0;
  Time received = 0;
  Vector3 f_N = Vector3::Zero();     ///< specific force, m/s^2
  Vector3 w_IN_N = Vector3::Zero();  ///< rad/s
};

enum class AutopilotMode : std::uint8_t { manual, offboard, land, hold, failsafe };

struct AutopilotTelemetry {
  Time captured = 0;
  Time received = 0;
  Eigen::Quaterniond q_IB =
      Eigen::Quaterniond::Identity();  ///< The autopilot's belief.
  Vector3 w_IB_B = Vector3::Zero();    ///< rad/s, its gyros
  /// m/s, its belief, in the same I as q_IB; NaN while it has none.
  Vector3 v_IB = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
  /// dz/dt, m/s, its belief by barometer and accelerometers, which needs no pose; NaN:
  /// not told.
  double climb = std::numeric_limits<double>::quiet_NaN();
  bool armed = false;
  AutopilotMode mode = AutopilotMode::manual;
  double battery = 1;  ///< Remaining share, 0 to 1.
};

/// How the radio does, as the ground end measures it.
struct LinkStatus {
  Time captured = 0;
  Time received = 0;
  double round_trip_ms = 0;  ///< Last answered exchange.
  Time last_answer = 0;      ///< When the drone was last heard.
};

enum class OperatorWish : std::uint8_t { none, go, hold, abort };

struct OperatorInput {
  Time captured = 0;
  Time received = 0;
  OperatorWish wish = OperatorWish::none;
};

/// Motion capture or simulation: recorded and evaluated, never acted on.
struct TruthSample {
  Time captured = 0;
  Time received = 0;
  RelativeState x;
};

}  // namespace alight
