// What RelativeFilter learns from pictures besides the state: how the drone turns, how
// restless it is, how exact its LEDs and their images are.
#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>

#include "alight/estimation/relative_filter.h"
#include "alight/estimation/relative_filter_common.h"
#include "alight/geometry/small_solve.h"

namespace alight {
namespace {

// A drone that does not move as the model says (in a hand, on a cable) makes the
// process noise grow at once with what pictures find improbable, or with corrections of
// thrust and turn that add up to what they hardly ever do; else it follows these sums,
// picture by picture.
constexpr double kRestlessLeast = 0.0003, kRestlessMost = 100;
constexpr double kImprobable = 2;       // mean NIS, 1 by the model;
constexpr double kImprobableTrend = 2;  // mean square of those sums
constexpr double kRestlessGain = 0.05;  // share of what it is off that counts at once
// Drones move smoothly: their corrections go on for a while that white noise would not
// have, even where the covariance is true (sines and splines, flights of both
// renderers).
constexpr double kSmooth = 1.8;
constexpr double kTrendMost = 8, kTrendMemory = 12;
// Six LEDs show six directions of their errors. What is learnt from these varies; the
// mean of 1 / chi^2 of six degrees of freedom is 1.5 / 6.
constexpr double kLedCaution = 1.2247;  // sqrt(1.5)
constexpr double kLeftLeast = 0.1;  // of a residual's variance, whatever is computed
constexpr double kTurnAside = 0.2;  // rad; a turn so far off tells nothing of its rate

}  // namespace

void RelativeFilter::learn_turn(const MotionState& next, const Matrix15& P) {
  // It follows the measured pose by regression, as the velocity does. The tangents
  // before and after are taken for one: that holds for small turns.
  const Vector6 e = boxminus(next.x, state_.x).head<6>();
  const Matrix6 P_prior = P_.topLeftCorner<6, 6>();
  const Eigen::Matrix<double, 3, 6> G =
      solve_small<6, 3>(P_prior.llt(), turn_.cross.leftCols<6>().transpose())
          .transpose();
  const Eigen::Matrix<double, 6, 15> change = P.topRows<6>() - P_.topRows<6>();
  const Matrix3 W = turn_.P + G * change.leftCols<6>() * G.transpose();
  if (!(e.tail<3>().norm() < kTurnAside && W.diagonal().minCoeff() > 0)) {
    turn_ = unknown_turn();
    return;
  }
  of_turn_.add(G * e, turn_.P - W);
  turn_.w += G * e;
  turn_.cross += G * change;
  turn_.P = 0.5 * (W + W.transpose());
}

void RelativeFilter::learn_restlessness() {
  double sum = 0;
  for (const ObservationReport& o : report_.seen) sum += o.nis;
  const double mean = sum / (2 * report_.used);  // 1 by the model
  const double of_d = of_d_.ratio();
  const double trend = 0.5 * (of_d + of_turn_.ratio()) / kSmooth;
  const double gain = std::max(kRestlessGain, 1.0 / (updates_ + 1));
  double factor = 1 + gain * (trend - 1);
  if (trend > kImprobableTrend) factor = trend;
  if (mean > kImprobable) factor = mean;
  restless_ = std::clamp(factor * restless_, kRestlessLeast, kRestlessMost);
  lately_of_d_ += (std::min(of_d, kTrendMost) - lately_of_d_) / kTrendMemory;
}

void RelativeFilter::watch_residuals() {
  FixedVector<ResidualWatch::Residual, kMaxLeds> residuals;
  const Pose X_NB = state_.x.X_NB();
  const Matrix6 P = P_.topLeftCorner<6, 6>();
  for (const ObservationReport& o : report_.seen) {
    if (!std::has_single_bit(o.leds)) continue;
    Matrix26 H;
    if (!project_observation(camera_, X_NB, leds_, o.leds, &H)) continue;
    const double taken = (H * P).cwiseProduct(H).sum();
    const double z = predicted_depth(camera_, X_NB, leds_, o.leds);
    residuals.push_back(
        {.led = std::countr_zero(o.leds),
         .px = o.residual_px,
         .H = H,
         .m_per_px = z / camera_.intrinsics.fx,
         .variance_px2 = o.variance_px2,
         .left = std::max(1 - taken / (watch_.noise() * o.variance_px2), kLeftLeast)});
  }
  watch_.add({residuals.data(), residuals.size()});
}

void RelativeFilter::watch_fit(const LedFrame& seen) {
  Matrix6 A = Matrix6::Zero();
  for (const LedObservation& o : seen.seen) {
    Matrix26 H;
    const auto uv = project_observation(camera_, state_.x.X_NB(), leds_, o.leds, &H);
    if (!uv || !well_formed(o)) continue;
    const Matrix2 noise =
        o.cov + config_.pixel_sd_px * config_.pixel_sd_px * Matrix2::Identity();
    A.noalias() += H.transpose() * noise.inverse() * H;
    report_.seen.push_back({.leds = o.leds,
                            .uv = o.uv,
                            .residual_px = o.uv - *uv,
                            .variance_px2 = noise.trace()});
  }
  const Eigen::LLT<Matrix6> llt(A);
  if (llt.info() == Eigen::Success && report_.seen.size() >= 3) {
    const Matrix15 P = P_;
    P_.topLeftCorner<6, 6>() = inverse_of(llt);
    watch_residuals();
    P_ = P;
  }
  report_ = UpdateReport{};
}

double RelativeFilter::led_sd_m() const {
  if (!config_.learn_from_residuals) return config_.led_position_sd_m;
  return kLedCaution * watch_.led_sd_m(config_.led_supposed_sd_m);
}

void RelativeFilter::learn_velocity() {
  if (updates_ > 0) {
    const Vector3 v = (state_.x.p_NB - last_p_NB_) / to_seconds(time_ - last_update_);
    measured_v_NB_ += config_.velocity_alpha * (v - measured_v_NB_);
  }
  last_p_NB_ = state_.x.p_NB;
  between_s_ = updates_ > 0 ? to_seconds(time_ - last_update_) : 0;
  in_a_row_ = between_s_ <= kGoesOnAlike ? in_a_row_ + 1 : 0;
  last_update_ = time_;
  ++updates_;
}

}  // namespace alight
