#pragma once
#include <deque>

#include "alight/base/fixed_vector.h"
#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/sensor_events.h"
#include "alight/sim/scenario.h"

namespace alight {

/// Wheel odometry with a gyro, and the platform's IMU, as they err: a scale of the way,
/// a bias of the turn, slip in turns, noise, lateness. The pose is what those speeds
/// add up to; roll, pitch and height are taken for known.
class OdometrySensor {
 public:
  OdometrySensor(const OdometryScenario& config, const PlatformState& start, Rng rng);

  /// The platform's true motion, once per physics step. `silent`: nothing is sent.
  void step(const PlatformState& truth, bool silent = false);

  /// Moves the pose it reports by `p_I` m; counts a reset if it is `told`.
  void jump(const Vector3& p_I, bool told = true);

  /// From now on speed and turn are off by this much more, m/s and rad/s.
  void drift(const Vector3& v_N, double yaw_rate) {
    drift_N_ = v_N;
    drift_yaw_ = yaw_rate;
  }

  /// Next event that has been received by `now`; false when there is none.
  bool receive(Time now, PlatformOdometry& out);
  bool receive(Time now, PlatformImu& out);

  double scale() const { return scale_; }
  double yaw_rate_bias() const { return bias_; }

 private:
  OdometryScenario config_;
  Rng rng_;
  double scale_, bias_, slip_yaw_, slip_side_;
  double yaw_error_ = 0;
  Vector3 drift_N_ = Vector3::Zero();
  double drift_yaw_ = 0;
  Pose X_IN_;
  Time last_;
  Time next_, next_imu_;
  std::uint32_t resets_ = 0;
  Vector3 imu_bias_N_;
  std::deque<PlatformOdometry> odometry_;
  std::deque<PlatformImu> imu_;
};

}  // namespace alight
