#pragma once
#include <Eigen/Core>
#include <array>
#include <memory>
#include <vector>

#include "alight/base/result.h"
#include "alight/planning/constraint.h"
#include "alight/planning/plan.h"

namespace alight {

/// Tuning of Planner; the defaults are the standard profile.
struct PlannerConfig {
  Profile profile = Profile::standard;

  double touch_down_height_m = 0.35;  ///< h_T, of the origin of B above the pad.
  double dilation_m = 0.05;           ///< eps_d: how far S_R and S_T reach over h_T.
  double free_space_margin_m = 0.5;   ///< S around start and end, on every axis.
  double shrink_m = 0;      ///< eps_s; 0: the drone's radius, half its diagonal.
  double end_height_m = 0;  ///< Where the trajectory ends; 0: on the landing gear.
  double touch_down_speed_m_s = 0.25;  ///< Downwards, relative, at the end.
  double end_yaw = 0;                  ///< Heading in N at the end, rad.

  double view_border_px = 12;       ///< Kept free along the picture's edges.
  double view_wish_px = 60;         ///< More of it, where the corridor allows.
  double attitude_spare_deg = 2;    ///< Tracking error of the attitude, for visibility.
  double tilt_max_deg = 15;         ///< Planned tilt, at most the drone's own bound.
  double thrust_least_share = 0.3;  ///< Of the weight: rotors keep their authority.
  double thrust_most_share = 0.9;   ///< Of what the rotors give at most.
  double body_rate_max_deg_s = 180;  ///< About the body's x and y, of any direction.
  double yaw_rate_max_deg_s = 150;   ///< About its z.
  double funnel_radius_m = 0.1;      ///< Half width of the funnel at the end height.
  double funnel_slope_deg = 20;      ///< Of its walls against the horizontal.

  double escape_clearance_m = 0.02;  ///< Of the gear above the pad while going around.

  int time_samples = 31;      ///< Per segment.
  double slowest_m_s = 0.25;  ///< Worst case of the mean speed: the longest times.
  double shortest_s = 0.4;    ///< No segment is shorter.
  double tightening = 0.9;    ///< Of the dynamic limits while sampling.
  double time_weight = 2.5;   ///< rho, m^2/s^6: cost of a second against jerk.

  /// Names the first field out of range, its value and its bounds.
  Result<void> validate() const;

  /// The paper's own: box limits on the inertial difference, a sphere for the drone,
  /// jerk alone, ends at rest 0.14 m above the pad.
  static PlannerConfig paper();
};

/// One row of the corridor: a'p <= b, p the origin of B in N, already shrunk.
struct HalfSpace {
  int segment = 0;
  Vector3 a = Vector3::Zero();  ///< unit
  double b = 0;                 ///< m
  Constraint meaning = Constraint::free_space;
};

/// A face n'x <= b, in N.
struct LimitFace {
  Vector3 n = Vector3::Zero();
  double b = 0;
  Constraint meaning = Constraint::speed;
};

/// The QP as solved for the chosen durations: minimize x'Px/2 + q'x, Ax = b, Gx <= h.
/// x = per axis (c3, c4, p, v h, a h^2, d3, d4): c and d the control points of the two
/// segments, p, v, a the state where they meet, h the shorter duration.
struct PlanQp {
  Eigen::MatrixXd P, A, G;
  Eigen::VectorXd q, b, h;
  std::vector<Constraint> meaning;  ///< Of each row of G.
  Eigen::VectorXd x;                ///< The solution; empty if there is none.
  Eigen::VectorXd z;                ///< The multipliers of G.
  double constant = 0;              ///< jerk cost = cost + constant
};

/// What `alight plan --json` prints beside the result.
struct PlanDetails {
  PlanResult result;
  std::vector<HalfSpace> halfspaces;
  double speed_m_s = 0;
  double acceleration_m_s2 = 0;
  std::vector<LimitFace> polyhedron;  ///< Of v_IB_N, a_IB_N, for a limit of 1.
  std::vector<LimitFace> force;       ///< Of a_IB_N - g_N, m/s^2 (standard).
  double thrust_least_m_s2 = 0, thrust_most_m_s2 = 0;
  double heading_rate_rad_s = 0;  ///< Of the heading, seen from I (standard).
  FlatState start, end;
  PlatformState platform;
  /// The durations sampled, per segment: over the likely range and, if none of those is
  /// feasible, over all that could be.
  std::array<std::vector<Seconds>, kSegments> samples, wide_samples;
  /// For `best`; empty when the start or the end is outside the corridor.
  PlanQp qp;
  std::array<Seconds, kSegments> best{0, 0};  ///< Durations chosen, or found wanting.
};

/// Landing Motion Planning of the paper: corridor (eqn:MP_KINE), Bezier QP
/// (eqn:MP_OPT), time allocation. README.md here holds the derivations.
///
/// Pure: no clock, chance or thread, and bounded by the number of QPs and their
/// iterations. The same request gives the same bits.
class Planner {
 public:
  /// Plans by the configuration as the rig allows it (fitted_to).
  static Result<Planner> create(const PlannerConfig& config, const Rig& rig);

  /// One landing. `solved` comes with a certificate none of whose margins is negative
  /// (beyond 1e-6); `infeasible` and `invalid_request` with the reason.
  PlanResult plan(const PlanRequest& request) const;

  /// The same plan, bit for bit, with what it was made from. Fails only for a request
  /// that holds no numbers; of an infeasible one the result and the corridor are told.
  Result<PlanDetails> explain(const PlanRequest& request) const;

  /// The way back to the rear space from any state (`from`, at `start`) of a landing:
  /// the cheapest of a fixed set of durations, certified. Standard profile.
  Escape escape(const PlanRequest& request) const;

  /// As fitted to the rig.
  const PlannerConfig& config() const;

 private:
  struct Setting;
  explicit Planner(std::shared_ptr<const Setting> setting);

  std::shared_ptr<const Setting> setting_;  ///< Never changed.
};

/// planner.plan(request).
PlanResult plan(const Planner& planner, const PlanRequest& request);

}  // namespace alight
