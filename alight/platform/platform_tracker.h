#pragma once
#include <array>
#include <cstdint>

#include "alight/base/result.h"
#include "alight/base/time.h"
#include "alight/geometry/sensor_events.h"

namespace alight {

/// Tuning of PlatformTracker.
struct PlatformTrackerConfig {
  double velocity_tau_s = 0.06;      ///< Smoothing of the speed reported.
  double yaw_rate_tau_s = 0.06;      ///< Smoothing of the yaw rate reported.
  double acceleration_tau_s = 0.20;  ///< Smoothing of the accelerations derived.
  double imu_tau_s = 0.1;            ///< Smoothing of the IMU's turn rate and of the
                                     ///< acceleration by it.
  double stale_after_s = 0.3;        ///< Older odometry is not to be acted on.
  bool carry_forward = true;         ///< False: the last odometry is taken for now.
  double predict_max_s = 2;          ///< Beyond this what is predicted comes to rest.
  double gap_max_s = 0.2;            ///< A longer gap starts the derivatives anew.

  Result<void> validate() const;
};

/// The best platform state at any time near now, from odometry (and the platform's IMU
/// where there is one) that comes late and noisy.
///
/// Each event is fused at its time of capture; `at` carries the newest forward with
/// constant turn rate and velocity plus the filtered acceleration. The pose is the
/// odometry's own: its drift is not corrected here, and what is relative to the
/// platform does not need it to be. No allocation; the same events give the same bits.
class PlatformTracker {
 public:
  explicit PlatformTracker(const PlatformTrackerConfig& config = {});

  /// @returns false, with nothing changed, for an event that is not finite or not newer
  /// than the last one.
  bool add(const PlatformOdometry& odometry);
  bool add(const PlatformImu& imu);

  /// State at `t` on the brain's clock. Before the first odometry: still, at the
  /// origin.
  PlatformState at(Time t) const;

  bool ready() const { return count_ > 0; }
  /// s since the capture of the newest odometry; infinite before the first.
  Seconds age(Time now) const;
  bool stale(Time now) const { return age(now) > config_.stale_after_s; }

  /// Counts the jumps of the pose: those the odometry announced, and those it did not
  /// but that no motion explains.
  std::uint32_t resets() const { return resets_; }

 private:
  struct Fused {
    Time t = 0;
    Pose X_IN = Pose::Identity();
    Vector3 v_N = Vector3::Zero();
    Vector3 w_N = Vector3::Zero();
    Vector3 dv_N = Vector3::Zero();  ///< Change of the components of v_N, m/s^2.
    Vector3 dw_N = Vector3::Zero();
  };
  PlatformState predicted(const Fused& from, Time t) const;
  const Fused& newest() const { return history_[(count_ - 1) % kHistory]; }

  static constexpr std::uint64_t kHistory = 32;

  PlatformTrackerConfig config_;
  std::array<Fused, kHistory> history_{};
  std::uint64_t count_ = 0;  ///< Events fused.
  std::uint64_t first_ = 0;  ///< The oldest one still of use: later than the last jump.
  std::uint32_t announced_ = 0;
  std::uint32_t resets_ = 0;

  bool has_imu_ = false;
  Time imu_t_ = 0;
  // Filtered, with their derivatives seen from I.
  Vector3 imu_w_N_ = Vector3::Zero(), imu_dw_N_ = imu_w_N_, imu_ddw_N_ = imu_w_N_;
  Vector3 imu_a_N_ = Vector3::Zero(), imu_da_N_ = imu_a_N_, imu_dda_N_ = imu_a_N_;
};

}  // namespace alight
