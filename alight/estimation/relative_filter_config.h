#pragma once
#include "alight/base/result.h"
#include "alight/estimation/motion_model.h"
#include "alight/geometry/led_frame.h"
#include "alight/geometry/rig.h"

namespace alight {

/// Tuning of RelativeFilter. The default expects set-points and platform motion.
struct RelativeFilterConfig {
  // Prediction.
  ProcessModel model = ProcessModel::set_points;
  bool platform_motion = true;  ///< Use PredictionInput::platform; else N is inertial
                                ///< and gravity (0, 0, -9.81) in N, as in the paper.
  bool estimate_disturbance = true;  ///< d_N and b_N as states; else they stay zero.
  double disturbance_memory_s = 30;  ///< MotionModel::memory_s.
  bool estimate_drag = false;        ///< MotionModel::drag.
  ProcessNoise noise;
  double disturbance_sd = 1.2;  ///< d_N at reset, m/s^2,
  double updraught_sd = 0.2;    ///< its z.
  double bias_sd = 0.6;         ///< b_N at reset, m/s^2 (a drag: 1/s),
  double lift_sd = 1.3;         ///< its z: an eighth of the thrust.
  /// Added besides `noise`: variance of every component of (p, R, v), m^2, rad^2,
  /// (m/s)^2, per 1/60 s, in proportion to time.
  double variance_per_frame = 0;

  // Measurement of one observation: its own covariance (if used), plus
  //   pixel_sd_px^2 / n + (led_white_share led_position_sd_m f / z)^2 / n
  // for n LEDs in one blob. LED errors are constant: they shift the pose, which
  // covariance() carries apart, and must not slow the filter as noise would. What
  // changes with the aspect has its share in R, as large as the response to a gust
  // (63 % in 0.3 s at 1.5 m) allows, for it also calms velocity and disturbance. The
  // gate and Huber's limit, which judge single residuals, allow for all of it.
  bool use_observation_cov = true;
  double pixel_sd_px = 0.1;          ///< Floor: lens, blob model.
  double led_position_sd_m = 0.002;  ///< Of each coordinate of each LED, constant.
  double led_white_share = 0.65;     ///< Of led_position_sd_m, in R.
  /// Where pictures tell of the LEDs (LedErrors), this takes the place of that share:
  /// by how much an LED seems to move with the side it shows.
  double led_aspect_sd_m = 0.0003;
  /// led_position_sd_m and the scale of the pixels' noise are learnt instead
  /// (ResidualWatch), from
  bool learn_from_residuals = false;
  double led_supposed_sd_m = 0.002;  ///< until pictures tell otherwise.
  bool use_depth = false;
  double depth_sd_m = 0.01;      ///< Together with
  double depth_sd_share = 0.02;  ///< this share of the depth.

  // Constant errors of the rig, which no filter can average: only in covariance().
  double mount_position_sd_m = 0.005;
  double mount_rotation_sd_rad = 0.019;  ///< 1 deg, and 3 px of the principal point.
  double focal_sd_share = 0.005;
  LedFrameSpec led_frame;  ///< The LEDs as a whole.

  // Velocity by differences of position (paper); 0 switches it off.
  double velocity_variance = 0;  ///< (m/s)^2
  double velocity_alpha = 0.04;  ///< Share of the newest difference, per frame.

  // Update.
  int max_iterations = 5;
  double tolerance = 1e-3;  ///< Norm of the last step (m, rad, m/s).
  int min_observations = 1;
  double gate_chi2 = 16;  ///< Largest NIS of one observation (2 dof); 0: no gate.
  double huber_sd = 3;    ///< Residuals beyond weigh less; 0: quadratic throughout.

  MotionModel motion() const { return {model, disturbance_memory_s, estimate_drag}; }

  Result<void> validate() const;

  /// The authors' filter and tuning. Their paper gives bare numbers; read here as
  /// - Q 0.016: Q = 0.016 I (9 x 9) in eqn:RSE_predict7, per frame of 1/60 s, in m^2,
  ///   rad^2, (m/s)^2 (spread over time, so that splitting a step changes nothing);
  /// - R_p 0.008: R = 0.008 I (2 x 2) px^2 for each LED in eqn:IEKF_GN. In normalized
  ///   coordinates it would be 37 px of noise, which no detector of theirs has;
  /// - R_v 0.016: 0.016 I (3 x 3) (m/s)^2 of the velocity measurement;
  /// - alpha 0.04: per frame, a time constant of 0.41 s at 60 Hz;
  /// - 25 Gauss-Newton steps at most, until the step (9-vector: m, rad, m/s) is
  ///   shorter than 0.01.
  /// No gate, no robust weights, at least 4 observations, none of the rig's errors.
  static RelativeFilterConfig paper();

  /// Pictures alone, nothing known of set-points (a recorded video): hover model with a
  /// disturbance, wider noise.
  static RelativeFilterConfig camera_only();

  /// The rig is as the file says: no share of its errors in any covariance.
  RelativeFilterConfig with_perfect_rig() const;
};

}  // namespace alight
