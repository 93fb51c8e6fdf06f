#pragma once
#include <Eigen/Core>
#include <span>

#include "alight/base/result.h"
#include "alight/calibration/observed_frame.h"

namespace alight {

struct ThrustAxisConfig {
  double window_s = 0.3;     ///< Stretch of flight that gives one acceleration,
  int poses_min = 8;         ///< from so many pictures at least;
  int windows_min = 10;      ///< and so many stretches.
  double follows_min = 0.8;  ///< Least share of the acceleration to the sides that the
                             ///< attitude must account for,
  double moves_min_m_s2 = 0.1;  ///< which must be at least this (rms).
  double push_sd_m_s2 = 0.3;    ///< Steady wind, and the camera's own tilt.
  double drag_sd_per_s = 0.3;
  double sd_min_deg = 0.5;  ///< Rotors are not mounted better than this.
};

/// Where the thrust of a flying drone points, seen from its LEDs.
struct ThrustAxis {
  Vector2 turn_rad = Vector2::Zero();  ///< About x and y of B: so the LEDs must be
                                       ///< turned for the thrust to lie along z,
  Eigen::Matrix2d cov = Eigen::Matrix2d::Zero();  ///< and how well that is known.
  int windows = 0;
  double follows = 0;  ///< Share of the acceleration that the attitude accounts for.
};

/// A quadrotor only accelerates where it leans: what its LEDs as a whole are turned by
/// in B, which pictures cannot show, its flight does (flatness; Mellinger and Kumar
/// 2011). N must be at rest and level, but for `push_sd_m_s2`.
///
/// @param frames  In order of time; X_NB by the LEDs as they are to be turned.
/// @returns too_few_points, or degenerate when this is no free flight (a drone that is
///          carried by hand, a platform that moves), with what to record instead.
Result<ThrustAxis> find_thrust_axis(const ThrustAxisConfig& config,
                                    std::span<const ObservedFrame> frames);

}  // namespace alight
