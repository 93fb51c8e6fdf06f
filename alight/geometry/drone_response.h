#pragma once
#include <array>

#include "alight/base/result.h"
#include "alight/base/time.h"
#include "alight/geometry/setpoint.h"
#include "alight/geometry/so3.h"

namespace alight {

/// How the autopilot turns set-points into motion; defaults as identified on PX4 1.16.
struct DroneResponseConfig {
  double omega_rad_s = 10;         ///< Attitude: second-order lag, natural frequency,
  double zeta = 0.55;              ///< damping,
  double delay_ms = 40;            ///< and dead time from a set-point's arrival.
  double thrust_delay_ms = 30;     ///< Dead time of the thrust share,
  double motor_ms = 30;            ///< then a first-order lag.
  double thrust_to_weight = 2.5;   ///< Full thrust gives this times g.
  double velocity_gain = 1.8;      ///< Velocity set-points: 1/s, horizontal
  double velocity_gain_z = 4;      ///< 1/s
  double velocity_integral = 0.4;  ///< 1/s^2, horizontal
  double velocity_integral_z = 2;  ///< 1/s^2
  double velocity_damping = 0.2;   ///< On the acceleration
  double tilt_max_deg = 35;        ///< Of what velocity set-points ask for.
  // Telemetry against the model.
  double attitude_share = 0.1;     ///< Of the difference in attitude, per report.
  double rate_observer_rad_s = 7;  ///< How fast rates and moments are believed.
  double moment_fade_s = 0.3;      ///< The autopilot learns to hold against it, too.

  Result<void> validate() const;
};

/// Model of the drone's attitude and thrust, driven by the set-points already sent:
/// what specific force acts at a time within about the last 0.7 s, and in the near
/// future as far as the set-points under way decide it. Deterministic, no allocation.
///
/// Everything is in the autopilot's own inertial frame, in which set-points are sent
/// (the caller turns it if that frame's heading differs from I's).
///
///   w' = -2 zeta omega w + omega^2 Log(R^T R_sp) + m,  R' = R hat(w),
///   T' = (T_sp - T) / tau
///
/// with the moment m (over inertia) that telemetry shows and nobody commanded.
///
/// Velocity set-points are first turned into an attitude and a thrust as PX4 does, with
/// the model's own velocity (no wind; set by `correct_velocity`): an approximation.
class DroneResponse {
 public:
  struct Sample {
    Time t = 0;
    Matrix3 R_IB = Matrix3::Identity();
    Vector3 w_IB_B = Vector3::Zero();  ///< rad/s
    double thrust_m_s2 = kGravity;     ///< Specific thrust along body z
    Vector3 v_IB = Vector3::Zero();    ///< Only kept true by correct_velocity.

    /// Specific force R e_z T, m/s^2.
    Vector3 f_I() const { return R_IB.col(2) * thrust_m_s2; }
  };

  static constexpr Time kGrid = 5'000'000;  ///< ns
  static constexpr Time kHistory = 700'000'000;
  static constexpr Time kAhead = 400'000'000;

  /// @pre config.validate() holds.
  explicit DroneResponse(const DroneResponseConfig& config = {});

  /// Starts anew at `t`: attitude as given, at rest, hovering unless told otherwise.
  void reset(Time t, const Matrix3& R_IB, double thrust_m_s2 = kGravity,
             const Vector3& v_IB = Vector3::Zero());

  /// A set-point that will arrive at the drone at `arrives`; what had been expected
  /// after that time is recomputed by the next `advance`. `Kind::none` and NaN are
  /// ignored. One that overtakes an earlier one replaces it.
  void sent(const Setpoint& setpoint, Time arrives);

  /// Extends the model up to `t` (no further than `kAhead` past the newest arrival).
  void advance(Time t);

  /// Interpolated; clamped to what `advance` has covered and the history still holds.
  Sample at(Time t) const;
  /// The first and last instant that `at` knows.
  Time oldest() const;
  Time newest() const;

  /// Draws the model towards the attitude and the rate that the autopilot reported for
  /// `captured`; the rest of the history after it follows. From the rates it learns the
  /// moment that nobody commanded: a centre of mass that is off, a gust on one side.
  /// Ignored when older than the history or NaN.
  void correct(Time captured, const Matrix3& R_IB, const Vector3& w_IB_B);
  /// The same for the velocity that the velocity set-points' model starts from.
  void correct_velocity(Time captured, const Vector3& v_IB, double gain = 1);

  const DroneResponseConfig& config() const { return config_; }

 private:
  static constexpr std::size_t kSamples = 256;
  static constexpr std::size_t kSetpoints = 128;
  struct State {
    Sample s;
    Vector3 v_integral = Vector3::Zero();  // m/s^2
    Vector3 moment_B = Vector3::Zero();    // over inertia, rad/s^2
  };
  struct Sent {
    Time arrives = 0;
    Setpoint setpoint;
  };

  State& slot(std::int64_t index);
  const State& slot(std::int64_t index) const;
  const Sent* in_force(Time t, Time delay) const;
  Time next_change(Time t, Time delay) const;
  void step(State& x, Time t, Time until) const;
  Vector3 velocity_loop(State& x, const Setpoint& setpoint, Seconds dt) const;
  void cut(Time t);
  State& restart_after(Time t);

  DroneResponseConfig config_;
  Time delay_;
  Time thrust_delay_;
  std::array<State, kSamples> ring_{};
  std::int64_t first_ = 0;  // grid indices, t / kGrid
  std::int64_t last_ = 0;
  std::int64_t covered_ = 0;  // how far `advance` was asked to go
  std::array<Sent, kSetpoints> setpoints_{};
  std::size_t setpoint_head_ = 0;  // of the ring: next to write
  std::size_t setpoint_count_ = 0;
  Time corrected_ = 0;  // time of the last report
};

}  // namespace alight
