#pragma once
#include <complex>

#include "alight/control/attitude_controller.h"
#include "alight/geometry/drone_response.h"

namespace alight {

/// One axis of the whole loop, linear: set-point -> radio and autopilot (delay) -> lag
/// -> double integrator -> camera (delay) -> steady-state Kalman filter for position,
/// velocity and disturbance -> carried forward over all delays with the exact model ->
/// gains. Gains are designed on it, not by trial.
struct LoopModel {
  enum class Axis { horizontal, vertical };
  Axis axis = Axis::horizontal;
  DroneResponseConfig response;
  AttitudeControllerConfig gains;
  Seconds control_period = 0.01;  ///< Set-points are held.
  Seconds frame_period = 1.0 / 60;
  Seconds camera_delay = 0.030;  ///< Mid-exposure to use; half a frame is added.
  Seconds link_delay = 0.040;
  // The estimator: what it believes of its measurement and of the world.
  double position_sd_m = 0.005;     ///< Of one frame
  double acceleration_noise = 0.1;  ///< m/s^2 per sqrt(Hz)
  double disturbance_noise = 1.9;   ///< m/s^3 per sqrt(Hz), of wind and bias together
};

/// How the real drone differs from what the controller believes.
struct LoopError {
  double thrust_scale = 1;  ///< Gain of the plant
  double omega_scale = 1;   ///< Speed of the attitude loop or of the motors
  Seconds extra_delay = 0;
};

struct LoopMargins {
  bool stable = false;      ///< By Nyquist's count, against the error-free loop, which
                            ///< is stable as its gains and filter are each.
  double phase_deg = 0;     ///< Least change of phase that destabilizes
  double delay_ms = 0;      ///< Least further delay that does
  double gain_up_db = 0;    ///< Factor on the gain, up
  double gain_down_db = 0;  ///< and down (positive)
  double crossover_rad_s = 0;   ///< Highest
  double sensitivity_peak = 0;  ///< max |1 / (1 + L)|
};

/// Stationary errors of position, m, standard deviations of one axis.
struct LoopErrors {
  double gust_m = 0;                ///< By gusts through the drone's drag
  double noise_m = 0;               ///< By white noise of the position measurement
  double step_peak_m_per_m_s2 = 0;  ///< Largest, after a step of disturbance of 1 m/s^2
};

/// Gusts of Dryden's form: first-order spectrum of `sd` and length/airspeed.
struct GustModel {
  double sd_m_s = 0.4;  ///< MIL-F-8785C at 2 m/s and 3 m height
  double length_m = 12;
  double airspeed_m_s = 2;
  double drag_per_s = 0.35;  ///< Acceleration per airspeed
};

class Loop {
 public:
  /// @pre model.response and model.gains are valid.
  explicit Loop(const LoopModel& model);

  /// Open loop at `w` rad/s, broken at the plant's input: L = -(what returns).
  std::complex<double> open_loop(double w, const LoopError& error = {}) const;
  LoopMargins margins(const LoopError& error = {}) const;
  LoopErrors errors(const GustModel& gust = {}, const LoopError& error = {}) const;

  /// Steady-state gain of the filter on position (1), velocity (1/s), disturbance
  /// (1/s^2).
  const Vector3& filter_gain() const { return kalman_; }

 private:
  std::complex<double> lag(std::complex<double> s, double omega_scale) const;
  /// Position by disturbance acceleration, and by measurement noise.
  std::complex<double> from_disturbance(double w, const LoopError& error) const;

  LoopModel model_;
  Seconds horizon_;  // from mid-exposure to the effect of the set-point
  Vector3 kalman_ = Vector3::Zero();
};

}  // namespace alight
