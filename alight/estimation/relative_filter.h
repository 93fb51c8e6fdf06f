#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <optional>

#include "alight/base/result.h"
#include "alight/estimation/correction_trend.h"
#include "alight/estimation/led_learner.h"
#include "alight/estimation/map_update.h"
#include "alight/estimation/motion_model.h"
#include "alight/estimation/push.h"
#include "alight/estimation/relative_filter_config.h"
#include "alight/estimation/residual_watch.h"
#include "alight/estimation/update_report.h"
#include "alight/geometry/rig.h"

namespace alight {

/// Tracks x = (p, R, v) of the drone in N from the images of its LEDs: iterated EKF on
/// R3 x SO(3) x R3 (paper, eqn:RSE_predict1..7, eqn:IEKF_GN). No clock, no allocation
/// after `create`. The state stays finite whatever comes in.
///
/// Use: reset() from an initialization; then, for each picture, predict_to(frame.t) and
/// update(frame). To know the state at another time without touching the filter, call
/// extrapolate(filter.motion_state(), input, dt, config.motion()).
class RelativeFilter {
 public:
  /// invalid_config, or too_few_points for a constellation of less than three LEDs.
  static Result<RelativeFilter> create(const RelativeFilterConfig& config,
                                       const Camera& camera, const Constellation& leds);

  /// Begins anew; the disturbances are forgotten unless they are given. What LEDs do to
  /// a state that was fitted to a picture, `taken_from` tells.
  /// @pre everything finite, R_NB a rotation, covariance positive definite.
  void reset(Time t, const RelativeState& x, const Covariance9& covariance,
             const Vector3& d_N = Vector3::Zero(), const Vector3& b_N = Vector3::Zero(),
             const LedFrame* taken_from = nullptr);
  bool initialized() const { return initialized_; }

  /// The disturbances begin anew from these, the rest of the state stands.
  void restart_disturbance(const Vector3& d_N, const Vector3& b_N);

  /// Forgets the state: initialized() is false until the next reset().
  void stop() { initialized_ = false; }

  /// A rig that has been measured takes the place of the one written down; its LEDs are
  /// known to `led_sd_m`, or as well as before if that is better. Forgets the state.
  /// @pre as many LEDs as before.
  void set_rig(const Camera& camera, const Constellation& leds, double led_sd_m);

  /// LEDs as pictures have told take the place of those so far, known to `cov`; the
  /// state moves to where it would be, had they been used since reset().
  /// @pre as many LEDs as before; camera and frame of them as before.
  void correct_leds(const Constellation& leds, const LedCovariance& cov);

  /// By how much LEDs seem to be off, sd of each coordinate, m: what residuals show
  /// that stay; 0 until they have told, or unless they are watched.
  double led_sd_seen_m() const { return watch_.led_sd_m(); }
  /// Factor on the claimed variances of images, as residuals show.
  double image_noise() const {
    return config_.learn_from_residuals ? watch_.noise() : 1;
  }

  /// Carries the state to `t` with one input, constant since time().
  /// @returns invalid_input, and nothing changed: not initialized, t before time(),
  ///          more than a minute ahead, input not finite. t == time() is no error.
  ///          degenerate: the position is uncertain by more than 100 m; stops.
  Result<void> predict_to(Time t, const PredictionInput& input);

  /// As above in steps of at most `step` ns; `input_at(Time)` gives the PredictionInput
  /// that holds from that time on.
  template <class InputAt>
  Result<void> predict_through(Time t, Time step, InputAt&& input_at) {
    do {
      const Time next = std::min(t, time_ + step);
      const auto done = predict_to(next, input_at(time_));
      if (!done) return done;
    } while (time_ < t);
    return {};
  }

  /// Carries the state to when something was seen `dt` s after time(), or before,
  /// within one picture; without noise and, as time() stays, to be undone by -dt.
  /// Nothing happens unless initialized, with all of it finite.
  void shift(Seconds dt, const PredictionInput& input);

  /// Rate of B against N, in B, rad/s: the input's with what has been learnt beside it.
  Vector3 turn_rate(const PredictionInput& input) const {
    return input.w_NB_B + turn_.w;
  }

  /// Fuses the correspondences of a picture taken at time(). On failure the prediction
  /// stands:
  ///   invalid_input   not initialized, frame.t is not time() (late, repeated, early)
  ///   too_few_points  fewer than min_observations of use
  ///   ambiguous       more than half of the observations are improbable: picture and
  ///                   prediction contradict each other; initialize again if it lasts
  ///   no_convergence  the picture cannot be explained near the prediction
  /// @param agreeing  Observations that must have passed the gate; less: ambiguous.
  /// @param told      Receives what the picture tells of the LEDs; nothing without
  ///                  errors to be known of them, or with the velocity measured.
  /// @param misfit_px Where five and more fit worse than this (rms) and than LEDs and
  ///                  pixels may be off, and all but one plainly better, that one is
  ///                  left out (Refusal::off_constellation): a lamp, or a light that
  ///                  runs together with one. 0: never.
  Result<UpdateReport> update(const LedFrame& frame, std::size_t agreeing = 0,
                              LedInformation* told = nullptr, double misfit_px = 0);

  /// Fuses a velocity v_NB known to `sd_m_s` along each axis, of time(). Nothing
  /// happens unless initialized, with both finite and sd_m_s > 0.
  void update_velocity(const Vector3& v_NB, double sd_m_s);

  /// Fuses a pose X_NB of time(), known to `cov` of (dp_NB, dR in B), from elsewhere
  /// than the pictures. Nothing happens unless initialized, with all of it finite.
  void update_pose(const Pose& X_NB, const Eigen::Matrix<double, 6, 6>& cov);

  /// Of the last update that came as far as looking at its observations, be it refused.
  const UpdateReport& last_report() const { return report_; }

  Time time() const { return time_; }
  /// When a picture was fused the last time; of use once one has been since reset().
  Time last_update() const { return last_update_; }
  const RelativeState& state() const { return state_.x; }
  const Constellation& leds() const { return leds_; }
  const MotionState& motion_state() const { return state_; }
  /// Acceleration the inputs do not explain, d + b, in N, m/s^2; drag left out.
  Vector3 disturbance_N() const {
    return config_.estimate_drag ? state_.d_N : state_.disturbance_N();
  }

  /// What pushes the drone, as its way shows it: where pictures alone tell of it
  /// (ProcessModel::hover with ProcessNoise::turn), once some in a row have.
  std::optional<Push> push() const;

  /// Of state() against the truth: the filter's own and the share of the rig's constant
  /// errors (LEDs, mount, focal length), which stays however long one looks. Where it
  /// learns how the drone turns (ProcessNoise::turn), the filter's own is told as
  /// drones and pictures are: see as_flown().
  Covariance9 covariance() const;
  /// What of it the mount and the focal length are, for a drone at p_NB with v_NB. The
  /// share of the former grows with the distance from the lens.
  Covariance9 mount_covariance(const Vector3& p_NB, const Vector3& v_NB) const;
  /// Without the rig's constant share: how far the state may move from one picture to
  /// the next. For search windows, guards and the autopilot's own estimator.
  Covariance9 tracking_covariance() const { return P_.topLeftCorner<9, 9>(); }

  /// From tracking_covariance: largest over directions, m; about z of N, rad; largest
  /// over directions, m/s.
  double position_sd() const;
  double yaw_sd() const;
  double velocity_sd() const;

 private:
  RelativeFilter(const RelativeFilterConfig& config, const Camera& camera,
                 const Constellation& leds);
  /// Root mean square distance of images from where X_NB has them; less of what may be
  /// off by more than `limit_px`, by pixels or LEDs.
  double misfit_of(const Pose& X_NB, const PictureMeasurements& measurements,
                   double limit_px) const;
  /// Takes the one out that the others plainly contradict.
  /// @returns false, with nothing changed, where there is none.
  bool leave_out_misfit(double limit_px, const MapUpdateOptions& options,
                        PictureMeasurements& measurements, UpdateReport& report) const;
  /// What of a frame is fused, each observation or group judged by the prediction.
  Result<void> prepare(const LedFrame& frame, PictureMeasurements& measurements,
                       UpdateReport& report) const;
  enum class Verdict { probable, improbable, malformed };
  /// Judges K images, those of `group` unless it is null; a probable one is appended.
  template <int K>
  Verdict judge(const LedObservation* seen, const OverlappingLeds* group,
                PictureMeasurements& measurements, UpdateReport& report) const;
  bool well_formed(const LedObservation& o) const;
  /// The N components of the state from `first` on, measured with covariance R.
  template <int N>
  void fuse_directly(int first, const Eigen::Matrix<double, N, 1>& innovation,
                     const Eigen::Matrix<double, N, N>& R);
  void add_depth(const LedObservation& o, const Pose& X_NB,
                 const Eigen::Matrix<double, 6, 6>& P, double z,
                 MeasuredImage& out) const;
  /// Rate of turn in B beside the input's (ProcessNoise::turn).
  struct TurnRate {
    Vector3 w = Vector3::Zero();
    Matrix3 P = Matrix3::Zero();
    Eigen::Matrix<double, 3, 15> cross =
        Eigen::Matrix<double, 3, 15>::Zero();  ///< Covariance with the state.
  };
  static TurnRate unknown_turn();
  double restless_unseen(Time t) const;
  /// The input as the filter takes it; false: not finite.
  bool taken(PredictionInput& input) const;
  /// P turned by the rate for dt. @returns the rate's covariance with the state then.
  Eigen::Matrix<double, 3, 15> turn_by_rate(Seconds dt, const Matrix15& F,
                                            Matrix15& P) const;
  TurnRate predict_turn(Seconds dt, double restless, const Matrix15& F,
                        Matrix15& P) const;
  void learn_turn(const MotionState& next, const Matrix15& P);
  void learn_restlessness();
  void learn_velocity();
  void watch_residuals();
  double led_sd_m() const;
  /// tracking_covariance() without what white noise makes of it. Drones move smoothly:
  /// what the process noise adds to the velocity within a moment is not there, unless
  /// what pushes them is seen to change. And of what a picture shows off, a small share
  /// is the same in the next: averaging leaves more of it than of white noise.
  Covariance9 as_flown() const;
  /// What of covariance() the LEDs as a whole are (RelativeFilterConfig::led_frame).
  Covariance9 led_frame_covariance() const;
  void watch_fit(const LedFrame& seen);
  LedBias response_to_leds(const LedFrame& seen) const;
  /// Variance of the innovation by what is left of the LEDs' errors, px^2.
  Vector2 led_variance(std::uint16_t leds, const Matrix26& H, const Matrix3& R_NB,
                       double z) const;
  bool knows_led_errors() const {
    return config_.led_position_sd_m > 0 || config_.learn_from_residuals;
  }

  RelativeFilterConfig config_;
  Camera camera_;
  Constellation leds_;

  bool initialized_ = false;
  Time time_ = 0;
  MotionState state_;
  UpdateReport report_;
  Matrix15 P_ = Matrix15::Zero();
  // First-order error of the state by the constant displacement of each LED (3 columns
  // each), carried along as the filter carries errors (Schmidt 1966, consider states).
  LedBias led_bias_;
  bool leds_learnt_ = false;  // then led_cov_ holds, else led_sd_m()
  LedCovariance led_cov_;
  ResidualWatch watch_;
  TurnRate turn_;
  double restless_ = 1;   // factor on the process noise
  int contrary_ = 0;      // pictures in a row that contradict the prediction,
  Time contrary_at_ = 0;  // the last of them
  CorrectionTrend of_d_, of_turn_;
  double lately_of_d_ = 0;  // mean of of_d_.ratio()

  // The paper's velocity measurement.
  int updates_ = 0;  // since reset
  Time last_update_ = 0;
  int in_a_row_ = 0;       // pictures fused, no more than kGoesOnAlike between them
  Seconds between_s_ = 0;  // the last two of them
  Vector3 last_p_NB_ = Vector3::Zero();
  Vector3 measured_v_NB_ = Vector3::Zero();
};

}  // namespace alight
