#include "alight/estimation/relative_filter.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <bit>
#include <cassert>
#include <cmath>

namespace alight {
namespace {

constexpr Seconds kFrame = 1.0 / 60;  // what variance_per_frame counts by
constexpr Time kLongest = 60'000'000'000;
constexpr double kOpen = 1e-2;         // px^-2, of a direction that is left open
constexpr double kGatePerImage = 4.3;  // keeps a gate's share for 2 more dimensions
constexpr double kLost = 100;          // m, standard deviation; nothing is known beyond

bool finite(const PlatformState& p) {
  return p.X_IN.matrix().allFinite() && p.w_IN_N.allFinite() && p.a_IN_N.allFinite() &&
         p.alpha_IN_N.allFinite();
}

double largest_sd(const Matrix3& covariance) {
  Eigen::SelfAdjointEigenSolver<Matrix3> solver;
  solver.computeDirect(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

using Matrix6 = Eigen::Matrix<double, 6, 6>;

bool positive_definite(const Matrix2& m) {
  return m.allFinite() && m(0, 0) > 0 && m.determinant() > 0;
}

}  // namespace

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
  stop();
}

void RelativeFilter::reset(Time t, const RelativeState& x,
                           const Covariance9& covariance, const Vector3& d_N,
                           const Vector3& b_N) {
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
    const double d_sd = config_.disturbance_sd, b_sd = config_.bias_sd;
    P_.diagonal().segment<3>(9).setConstant(d_sd * d_sd);
    P_.diagonal().tail<3>().setConstant(b_sd * b_sd);
  }
  led_bias_.setZero();
  updates_ = 0;
  measured_v_NB_ = x.v_NB;
}

Result<void> RelativeFilter::predict_to(Time t, const PredictionInput& given) {
  if (!initialized_ || t < time_ || t - time_ > kLongest) {
    return fail(Fault::invalid_input);
  }
  if (t == time_) return {};
  PredictionInput input = given;
  if (!config_.platform_motion) input.platform = PlatformState{};
  if (config_.model == ProcessModel::hover) input.f_N.setZero();
  if (!finite(input.platform) || !input.f_N.allFinite() || !input.w_NB_B.allFinite()) {
    return fail(Fault::invalid_input);
  }

  const Seconds dt = to_seconds(t - time_);
  Matrix15 F;
  const MotionState next = extrapolate(state_, input, dt, config_.motion(), &F);
  ProcessNoise noise = config_.noise;
  if (!config_.estimate_disturbance) noise.disturbance = noise.bias = 0;
  Matrix15 P = F * P_ * F.transpose() + process_covariance(noise, dt);
  P.diagonal().head<9>().array() += config_.variance_per_frame * dt / kFrame;
  if (!P.allFinite() || !next.x.p_NB.allFinite() || !next.x.R_NB.allFinite() ||
      !next.x.v_NB.allFinite() || !next.disturbance_N().allFinite()) {
    return fail(Fault::invalid_input);
  }
  if (P.diagonal().head<3>().maxCoeff() > kLost * kLost) {
    stop();
    return fail(Fault::degenerate);
  }
  state_ = next;
  P_ = 0.5 * (P + P.transpose());
  if (knows_led_errors()) {
    Eigen::Matrix<double, 15, 3> column;
    for (int i = 0; i < leds_.size(); ++i) {
      column.noalias() = F * led_bias_.middleCols<3>(3 * i);
      led_bias_.middleCols<3>(3 * i) = column;
    }
  }
  time_ = t;
  return {};
}

Result<void> RelativeFilter::prepare(const LedFrame& frame,
                                     PictureMeasurements& measurements,
                                     UpdateReport& report) const {
  const Pose X_NB = state_.x.X_NB();
  const Matrix6 P = P_.topLeftCorner<6, 6>();
  const unsigned known = (1u << leds_.size()) - 1;
  const Intrinsics& lens = camera_.intrinsics;
  const double white = config_.led_white_share * config_.led_white_share;
  const double led_sd = led_sd_m();
  const double scale = config_.learn_from_residuals ? watch_.noise() : 1;
  int improbable = 0;
  const auto gate = [&](const LedObservation& o) {
    report.refused.push_back({o.uv, Refusal::gated});
  };
  auto group = frame.groups.begin();
  for (std::size_t i = 0; i < frame.seen.size();) {
    const bool grouped =
        group != frame.groups.end() && static_cast<std::size_t>(group->first) == i;
    const auto count = grouped ? static_cast<std::size_t>(group->count) : 1;
    const LedObservation* const seen = &frame.seen[i];
    i += count;

    PictureMeasurement m;
    const auto rows = static_cast<Eigen::Index>(2 * count);
    Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 2 * kMaxGroup, 6> H(rows, 6);
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 2 * kMaxGroup, 1> innovation(rows);
    GroupMatrix drawn = GroupMatrix::Zero(rows, rows);  // anew in each picture
    GroupMatrix constant = GroupMatrix::Zero(rows, rows);
    int malformed = 0;
    bool ahead = true;
    for (std::size_t k = 0; k < count; ++k) {
      const LedObservation& o = seen[k];
      if (!o.uv.allFinite() || o.leds == 0 || (o.leds & ~known) != 0 ||
          (config_.use_observation_cov && !positive_definite(o.cov))) {
        ++malformed;
        continue;
      }
      Matrix26 H_k;
      const auto uv = project_observation(camera_, X_NB, leds_, o.leds, &H_k);
      const double z = predicted_depth(camera_, X_NB, leds_, o.leds);
      ahead = ahead && uv && z > 0;
      if (!ahead) continue;
      const auto at = static_cast<Eigen::Index>(2 * k);
      const int n = std::popcount(o.leds);
      const Vector2 led_px = led_sd / z * Vector2(lens.fx, lens.fy);
      const Vector2 led = led_px.cwiseAbs2() / n;
      const double pixel = config_.pixel_sd_px * config_.pixel_sd_px;
      H.middleRows<2>(at) = H_k;
      innovation.segment<2>(at) = o.uv - *uv;
      drawn.diagonal().segment<2>(at) =
          white * led + Vector2::Constant(scale * pixel / n);
      constant.diagonal().segment<2>(at) = (1 - white) * led;
      MeasuredImage image{.leds = o.leds, .uv = o.uv};
      if (config_.use_depth && o.depth_m > 0 && std::isfinite(o.depth_m)) {
        Eigen::Matrix<double, 1, 6> H_z;
        predicted_depth(camera_, X_NB, leds_, o.leds, &H_z);
        const double share = config_.depth_sd_share * z;
        const double variance = config_.depth_sd_m * config_.depth_sd_m + share * share;
        const double S_z = (H_z * P * H_z.transpose()).value() + variance;
        // A hole's rim or the background: the depth goes, the image stays.
        if (config_.gate_chi2 <= 0 ||
            (o.depth_m - z) * (o.depth_m - z) <= config_.gate_chi2 * S_z) {
          image.depth_m = o.depth_m;
          image.depth_variance = variance;
        }
      }
      m.images.push_back(image);
    }
    if (grouped) ++group;
    if (malformed > 0) {
      report.malformed += malformed;
      for (std::size_t k = 0; k < count; ++k) {
        if (seen[k].uv.allFinite()) gate(seen[k]);
      }
      continue;
    }
    if (!ahead) {
      improbable += static_cast<int>(count);
      for (std::size_t k = 0; k < count; ++k) gate(seen[k]);
      continue;
    }

    // Of a group, directions that the picture leaves open have no information: noise is
    // added to what there is, W = (I^-1 + D)^-1 = I - I (D^-1 + I)^-1 I.
    GroupMatrix noise = drawn;
    if (!grouped) {
      if (config_.use_observation_cov) noise += scale * seen->cov;
      m.information = noise.topLeftCorner<2, 2>().inverse();
    } else {
      const GroupMatrix information = group[-1].information / scale;
      GroupMatrix sum = information;
      sum.diagonal() += drawn.diagonal().cwiseInverse();
      const Eigen::LLT<GroupMatrix> llt(sum);
      m.information = information - information * llt.solve(information);
      GroupMatrix regular = m.information;
      regular.diagonal().array() += kOpen;
      noise = Eigen::LLT<GroupMatrix>(regular).solve(GroupMatrix::Identity(rows, rows));
    }
    m.slack = std::sqrt(1 + constant.trace() / noise.trace());

    const GroupMatrix S = H * P * H.transpose() + noise + constant;
    const auto nis_of = [&](Eigen::Index first, Eigen::Index size) {
      const auto r = innovation.segment(first, size);
      const Eigen::LLT<GroupMatrix> llt(S.block(first, first, size, size));
      return r.dot(llt.solve(r));
    };
    const double nis = grouped ? nis_of(0, rows) : nis_of(0, 2);
    if (!(nis >= 0) ||
        (config_.gate_chi2 > 0 &&
         nis > config_.gate_chi2 + kGatePerImage * static_cast<double>(count - 1))) {
      improbable += static_cast<int>(count);
      for (std::size_t k = 0; k < count; ++k) gate(seen[k]);
      continue;
    }
    measurements.push_back(m);
    for (std::size_t k = 0; k < count; ++k) {
      const auto at = static_cast<Eigen::Index>(2 * k);
      report.seen.push_back({.leds = seen[k].leds,
                             .uv = seen[k].uv,
                             .residual_px = innovation.segment<2>(at),
                             .variance_px2 = grouped ? 0 : noise.trace() / scale,
                             .nis = grouped ? nis_of(at, 2) : nis});
    }
  }
  report.gated = improbable;
  report.used = static_cast<int>(report.seen.size());
  if (improbable > report.used) return fail(Fault::ambiguous);
  if (report.used < config_.min_observations) return fail(Fault::too_few_points);
  return {};
}

Result<UpdateReport> RelativeFilter::update(const LedFrame& frame,
                                            std::size_t agreeing) {
  if (!initialized_ || frame.t != time_ || (updates_ > 0 && frame.t <= last_update_)) {
    return fail(Fault::invalid_input);
  }
  report_ = UpdateReport{};
  UpdateReport& report = report_;
  PictureMeasurements measurements;
  if (const auto ready = prepare(frame, measurements, report); !ready) {
    return fail(ready.error());
  }

  if (report.seen.size() < agreeing) return fail(Fault::ambiguous);

  MapUpdateOptions options{.max_iterations = config_.max_iterations,
                           .tolerance = config_.tolerance,
                           .huber_sd = config_.huber_sd};
  if (updates_ >= 2) {  // (p_{k-1} - p_{k-2}) needs two
    options.velocity_variance = config_.velocity_variance;
    options.v_NB = measured_v_NB_;
  }
  MotionState next = state_;
  Matrix15 P = P_;
  const auto done = map_update(camera_, leds_, measurements, options, next, P,
                               knows_led_errors() ? &led_bias_ : nullptr);
  if (!done) return fail(done.error());
  state_ = next;
  P_ = P;
  report.iterations = done->iterations;
  report.converged = done->converged;

  const Pose X_NB = state_.x.X_NB();
  double sum = 0;
  for (ObservationReport& o : report.seen) {
    const auto uv = project_observation(camera_, X_NB, leds_, o.leds);
    if (uv) o.residual_px = o.uv - *uv;
    sum += o.residual_px.squaredNorm();
  }
  report.reprojection_px = std::sqrt(sum / report.used);
  if (config_.learn_from_residuals) watch_residuals();
  learn_velocity();
  return report;
}

void RelativeFilter::watch_residuals() {
  FixedVector<ResidualWatch::Residual, kMaxLeds> residuals;
  const Pose X_NB = state_.x.X_NB();
  for (const ObservationReport& o : report_.seen) {
    if (!std::has_single_bit(o.leds) || o.variance_px2 <= 0) continue;
    const double z = predicted_depth(camera_, X_NB, leds_, o.leds);
    residuals.push_back({.led = std::countr_zero(o.leds),
                         .px = o.residual_px,
                         .m_per_px = z / camera_.intrinsics.fx,
                         .variance_px2 = o.variance_px2});
  }
  watch_.add({residuals.data(), residuals.size()});
}

double RelativeFilter::led_sd_m() const {
  return config_.learn_from_residuals ? watch_.led_sd_m() : config_.led_position_sd_m;
}

void RelativeFilter::learn_velocity() {
  if (updates_ > 0) {
    const Vector3 v = (state_.x.p_NB - last_p_NB_) / to_seconds(time_ - last_update_);
    measured_v_NB_ += config_.velocity_alpha * (v - measured_v_NB_);
  }
  last_p_NB_ = state_.x.p_NB;
  last_update_ = time_;
  ++updates_;
}

Covariance9 RelativeFilter::covariance() const {
  Covariance9 total = tracking_covariance();
  const double led = led_sd_m();
  if (led > 0) {
    const auto B = led_bias_.topRows<9>();
    total.noalias() += led * led * B.lazyProduct(B.transpose());
  }

  // A mount that is off moves the drone with it, about the camera.
  const Vector3 arm = state_.x.p_NB - camera_.X_NC.translation();
  const double shift = config_.mount_position_sd_m;
  const double turn = config_.mount_rotation_sd_rad;
  total.diagonal().head<3>().array() += shift * shift;
  Eigen::Matrix<double, 9, 3> by_turn;
  by_turn << -hat(arm), state_.x.R_NB.transpose(), -hat(state_.x.v_NB);
  total.noalias() += turn * turn * by_turn * by_turn.transpose();

  // A focal length that is off scales the distance along the optical axis.
  const Vector3 axis = camera_.X_NC.linear().col(2);
  Vector9 by_focal = Vector9::Zero();
  by_focal.head<3>() = axis * axis.dot(arm);
  by_focal.tail<3>() = axis * axis.dot(state_.x.v_NB);
  total.noalias() +=
      config_.focal_sd_share * config_.focal_sd_share * by_focal * by_focal.transpose();
  return total;
}

double RelativeFilter::position_sd() const { return largest_sd(P_.block<3, 3>(0, 0)); }

double RelativeFilter::velocity_sd() const { return largest_sd(P_.block<3, 3>(6, 6)); }

double RelativeFilter::yaw_sd() const {
  const Vector3 z_B = state_.x.R_NB.row(2).transpose();
  return std::sqrt(std::max(0.0, z_B.dot(P_.block<3, 3>(3, 3) * z_B)));
}

}  // namespace alight
