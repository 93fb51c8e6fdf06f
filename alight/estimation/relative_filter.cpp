#include "alight/estimation/relative_filter.h"

#include <Eigen/Cholesky>
#include <bit>
#include <cassert>

#include "alight/estimation/relative_filter_common.h"
#include "alight/geometry/small_solve.h"

namespace alight {

RelativeFilter::RelativeFilter(const RelativeFilterConfig& config, const Camera& camera,
                               const Constellation& leds)
    : config_(config), camera_(camera), leds_(leds) {
  led_bias_.setZero(15, 3 * leds.size());
}

Result<RelativeFilter> RelativeFilter::create(const RelativeFilterConfig& config,
                                              const Camera& camera,
                                              const Constellation& leds) {
  if (const auto valid = config.validate(); !valid) return fail(valid.error());
  if (leds.size() < 3) {
    return fail(Fault::too_few_points, "leds: the filter needs at least 3");
  }
  return RelativeFilter(config, camera, leds);
}

void RelativeFilter::set_rig(const Camera& camera, const Constellation& leds,
                             double led_sd_m) {
  assert(leds.size() == leds_.size() && led_sd_m >= 0);
  config_.led_position_sd_m = std::min(config_.led_position_sd_m, led_sd_m);
  camera_ = camera;
  leds_ = leds;
  leds_learnt_ = false;
  watch_ = ResidualWatch();
  stop();
}

void RelativeFilter::correct_leds(const Constellation& leds, const LedCovariance& cov) {
  assert(leds.size() == leds_.size() && cov.rows() == 3 * leds.size());
  if (initialized_) {
    Vector15 change = Vector15::Zero();
    for (int i = 0; i < leds.size(); ++i) {
      change -= led_bias_.middleCols<3>(3 * i) * (leds.p_BL(i) - leds_.p_BL(i));
    }
    state_ = boxplus(state_, change);
  }
  leds_ = leds;
  led_cov_ = cov;
  leds_learnt_ = true;
  watch_.begin_anew();
}

void RelativeFilter::reset(Time t, const RelativeState& x,
                           const Covariance9& covariance, const Vector3& d_N,
                           const Vector3& b_N, const LedFrame* taken_from) {
  assert(x.p_NB.allFinite() && x.R_NB.allFinite() && x.v_NB.allFinite());
  assert(covariance.allFinite() && d_N.allFinite() && b_N.allFinite());
  initialized_ = true;
  time_ = t;
  state_ = {x};
  P_.setZero();
  P_.topLeftCorner<9, 9>() = covariance;
  if (config_.estimate_disturbance) {
    state_.d_N = d_N;
    state_.b_N = b_N;
    const RelativeFilterConfig& c = config_;
    Eigen::Matrix<double, 6, 1> sd;
    sd << c.disturbance_sd, c.disturbance_sd, c.updraught_sd, c.bias_sd, c.bias_sd,
        c.lift_sd;
    P_.diagonal().tail<6>() = sd.cwiseAbs2();
  }
  led_bias_.setZero();
  report_ = UpdateReport{};
  if (taken_from != nullptr && knows_led_errors()) {
    led_bias_ = response_to_leds(*taken_from);
    if (config_.learn_from_residuals) watch_fit(*taken_from);
  }
  turn_ = unknown_turn();
  restless_ = 1;
  contrary_ = 0;
  of_d_.forget();
  of_turn_.forget();
  lately_of_d_ = kTrendUsual;
  updates_ = in_a_row_ = 0;
  measured_v_NB_ = x.v_NB;
}

void RelativeFilter::restart_disturbance(const Vector3& d_N, const Vector3& b_N) {
  const LedBias bias = led_bias_;
  reset(time_, RelativeState(state_.x), tracking_covariance(), d_N, b_N);
  led_bias_.topRows<9>() = bias.topRows<9>();
}

LedBias RelativeFilter::response_to_leds(const LedFrame& seen) const {
  // The fit's normal equations, the covariance held against what it leaves open.
  const Matrix6 P = P_.topLeftCorner<6, 6>();
  Matrix6 A = inverse_of(Eigen::LLT<Matrix6>(P));
  Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 3 * kMaxLeds> T(6, led_bias_.cols());
  T.setZero();
  for (const LedObservation& o : seen.seen) {
    Matrix26 H;
    if (!well_formed(o) ||
        !project_observation(camera_, state_.x.X_NB(), leds_, o.leds, &H)) {
      continue;
    }
    const Matrix2 noise =
        o.cov + config_.pixel_sd_px * config_.pixel_sd_px * Matrix2::Identity();
    const Eigen::Matrix<double, 6, 2> HtW = H.transpose() * noise.inverse();
    A.noalias() += HtW * H;
    const Eigen::Matrix<double, 6, 3> pull =
        HtW * H.leftCols<3>() * state_.x.R_NB / std::popcount(o.leds);
    for (int i = 0; i < leds_.size(); ++i) {
      if ((o.leds >> i) & 1) T.middleCols<3>(3 * i) += pull;
    }
  }
  LedBias response = LedBias::Zero(15, led_bias_.cols());
  const Eigen::LLT<Matrix6> llt(A);
  for (Eigen::Index c = 0; llt.info() == Eigen::Success && c < T.cols(); ++c) {
    response.col(c).head<6>() = llt.solve(Vector6(T.col(c)));
  }
  if (!response.allFinite()) response.setZero();
  return response;
}

}  // namespace alight
