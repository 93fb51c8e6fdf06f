// What RelativeFilter makes of a picture, or of a pose or velocity that is told.
#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "alight/estimation/relative_filter.h"
#include "alight/estimation/relative_filter_common.h"
#include "alight/geometry/small_solve.h"

namespace alight {
namespace {

constexpr double kOpen = 1e-2;         // px^-2, of a direction that is left open
constexpr double kGatePerImage = 4.3;  // keeps a gate's share for 2 more dimensions
constexpr int kContrary = 2;           // pictures in a row that end an even flight,
constexpr double kWiderAtOnce = 225;   // and what one may do to its variances
// Beyond so many sd of all that it may be off by, an LED contradicts the others;
constexpr double kMisfitSds = 2.5;
constexpr double kPlainly = 0.6;     // share of the next best misfit without it
constexpr std::size_t kTelling = 4;  // more of them tell which one

bool positive_definite(const Matrix2& m) {
  return m.allFinite() && m(0, 0) > 0 && m.determinant() > 0;
}

}  // namespace

Result<void> RelativeFilter::prepare(const LedFrame& frame,
                                     PictureMeasurements& measurements,
                                     UpdateReport& report) const {
  static_assert(kMaxGroup == 4);
  auto next_group = frame.groups.begin();
  for (std::size_t i = 0; i < frame.seen.size();) {
    const OverlappingLeds* group = nullptr;
    if (next_group != frame.groups.end() &&
        static_cast<std::size_t>(next_group->first) == i) {
      group = next_group++;
    }
    const auto count = group != nullptr ? static_cast<std::size_t>(group->count) : 1;
    const LedObservation* const seen = &frame.seen[i];
    i += count;
    Verdict verdict = Verdict::malformed;
    switch (count) {
      case 1:
        verdict = judge<1>(seen, group, measurements, report);
        break;
      case 2:
        verdict = judge<2>(seen, group, measurements, report);
        break;
      case 3:
        verdict = judge<3>(seen, group, measurements, report);
        break;
      default:
        verdict = judge<4>(seen, group, measurements, report);
    }
    if (verdict == Verdict::probable) continue;
    if (verdict == Verdict::improbable) report.gated += static_cast<int>(count);
    for (const LedObservation& o : std::span(seen, count)) {
      if (o.uv.allFinite()) report.refused.push_back({o.uv, Refusal::gated});
    }
  }
  report.used = static_cast<int>(report.seen.size());
  if (report.gated > report.used) return fail(Fault::ambiguous);
  if (report.used < config_.min_observations) return fail(Fault::too_few_points);
  return {};
}

bool RelativeFilter::well_formed(const LedObservation& o) const {
  const unsigned known = (1u << leds_.size()) - 1;
  return o.uv.allFinite() && o.leds != 0 && (o.leds & ~known) == 0 &&
         (!config_.use_observation_cov || positive_definite(o.cov));
}

template <int K>
RelativeFilter::Verdict RelativeFilter::judge(const LedObservation* seen,
                                              const OverlappingLeds* group,
                                              PictureMeasurements& measurements,
                                              UpdateReport& report) const {
  constexpr int kRows = 2 * K;
  using MatrixK = Eigen::Matrix<double, kRows, kRows>;
  using VectorK = Eigen::Matrix<double, kRows, 1>;
  const auto malformed = std::count_if(
      seen, seen + K, [&](const LedObservation& o) { return !well_formed(o); });
  if (malformed > 0) {
    report.malformed += static_cast<int>(malformed);
    return Verdict::malformed;
  }

  const Pose X_NB = state_.x.X_NB();
  const Matrix6 P = P_.topLeftCorner<6, 6>();
  const double white = config_.led_white_share * config_.led_white_share;
  const double scale = config_.learn_from_residuals ? watch_.noise() : 1;
  const double pixel = scale * config_.pixel_sd_px * config_.pixel_sd_px;
  PictureMeasurement m;
  Eigen::Matrix<double, kRows, 6> H;
  VectorK innovation;
  VectorK drawn, constant;  // variances: anew in each picture, and the rig's
  for (int k = 0; k < K; ++k) {
    const LedObservation& o = seen[k];
    Matrix26 H_k;
    const auto uv = project_observation(camera_, X_NB, leds_, o.leds, &H_k);
    const double z = predicted_depth(camera_, X_NB, leds_, o.leds);
    if (!uv || !(z > 0)) return Verdict::improbable;
    const int n = std::popcount(o.leds);
    const Vector2 led = led_variance(o.leds, H_k, X_NB.linear(), z);
    Vector2 anew = white * led, stays = (1 - white) * led;
    if (leds_learnt_ && config_.led_aspect_sd_m > 0) {
      const double aspect = config_.led_aspect_sd_m / z;
      const Intrinsics& lens = camera_.intrinsics;
      anew = aspect * aspect / n * Vector2(lens.fx, lens.fy).cwiseAbs2();
      stays = led;
    }
    H.template middleRows<2>(2 * k) = H_k;
    innovation.template segment<2>(2 * k) = o.uv - *uv;
    drawn.template segment<2>(2 * k) = anew + Vector2::Constant(pixel / n);
    constant.template segment<2>(2 * k) = stays;
    MeasuredImage image{.leds = o.leds, .uv = o.uv};
    add_depth(o, X_NB, P, z, image);
    m.images.push_back(image);
  }

  MatrixK noise = drawn.asDiagonal();
  if (group == nullptr) {
    if constexpr (K == 1) {
      if (config_.use_observation_cov) noise += scale * seen->cov;
      m.information = noise.inverse();
    }
  } else {
    // Directions that the picture leaves open have no information: noise is added to
    // what there is, W = (I^-1 + D)^-1 = I - I (D^-1 + I)^-1 I.
    const MatrixK information =
        group->information.template topLeftCorner<kRows, kRows>() / scale;
    MatrixK sum = information;
    sum.diagonal() += drawn.cwiseInverse();
    const MatrixK W =
        information - information * solve_small(Eigen::LLT<MatrixK>(sum), information);
    m.information = W;
    MatrixK regular = W;
    regular.diagonal().array() += kOpen;
    noise = inverse_of(Eigen::LLT<MatrixK>(regular));
  }
  m.slack = std::sqrt(1 + constant.sum() / noise.trace());

  MatrixK S = H.lazyProduct((P * H.transpose()).eval()) + noise;
  S.diagonal() += constant;
  const double nis = innovation.dot(Eigen::LLT<MatrixK>(S).solve(innovation));
  if (!(nis >= 0) ||
      (config_.gate_chi2 > 0 && nis > config_.gate_chi2 + kGatePerImage * (K - 1))) {
    return Verdict::improbable;
  }
  measurements.push_back(m);
  for (int k = 0; k < K; ++k) {
    const Vector2 r = innovation.template segment<2>(2 * k);
    const Matrix2 S_k = S.template block<2, 2>(2 * k, 2 * k);
    report.seen.push_back(
        {.leds = seen[k].leds,
         .uv = seen[k].uv,
         .residual_px = r,
         .variance_px2 = noise.template block<2, 2>(2 * k, 2 * k).trace() / scale,
         .alone = group == nullptr,
         .nis = K == 1 ? nis : r.dot(Eigen::LLT<Matrix2>(S_k).solve(r))});
  }
  return Verdict::probable;
}

void RelativeFilter::add_depth(const LedObservation& o, const Pose& X_NB,
                               const Matrix6& P, double z, MeasuredImage& out) const {
  if (!config_.use_depth || !(o.depth_m > 0) || !std::isfinite(o.depth_m)) return;
  Eigen::Matrix<double, 1, 6> H_z;
  predicted_depth(camera_, X_NB, leds_, o.leds, &H_z);
  const double share = config_.depth_sd_share * z;
  const double variance = config_.depth_sd_m * config_.depth_sd_m + share * share;
  const double S_z = (H_z * P * H_z.transpose()).value() + variance;
  const double off = o.depth_m - z;
  // A hole's rim or the background: the depth goes, the image stays.
  if (config_.gate_chi2 > 0 && !(off * off <= config_.gate_chi2 * S_z)) return;
  out.depth_m = o.depth_m;
  out.depth_variance = variance;
}

double RelativeFilter::misfit_of(const Pose& X_NB,
                                 const PictureMeasurements& measurements,
                                 double limit_px) const {
  double sum = 0;
  int count = 0;
  for (const PictureMeasurement& m : measurements) {
    const auto n = static_cast<Eigen::Index>(m.images.size());
    // What says little of its place may stand far off, and an LED that may be off, too.
    const double sd =
        m.slack * std::sqrt(static_cast<double>(2 * n) / m.information.trace());
    const double share = std::min(1.0, limit_px / (kMisfitSds * sd));
    for (const MeasuredImage& image : m.images) {
      const auto uv = project_observation(camera_, X_NB, leds_, image.leds);
      if (uv) sum += share * share * (image.uv - *uv).squaredNorm();
      ++count;
    }
  }
  return std::sqrt(sum / std::max(count, 1));
}

bool RelativeFilter::leave_out_misfit(double limit_px, const MapUpdateOptions& options,
                                      PictureMeasurements& measurements,
                                      UpdateReport& report) const {
  // Of two that contradict the others four are left: they fit whichever two those are.
  std::optional<std::size_t> left_out;
  double least_px = limit_px, next_px = limit_px;
  for (std::size_t k = 0; k < measurements.size(); ++k) {
    PictureMeasurements others = measurements;
    others.erase(k);
    MotionState x = state_;
    Matrix15 P = P_;
    if (!map_update(camera_, leds_, others, options, x, P, nullptr)) continue;
    const double px = misfit_of(x.x.X_NB(), others, limit_px);
    if (px < least_px) {
      next_px = std::exchange(least_px, px);
      left_out = k;
    } else {
      next_px = std::min(next_px, px);
    }
  }
  if (!left_out || least_px > kPlainly * next_px) return false;
  std::size_t first = 0;
  for (std::size_t k = 0; k < *left_out; ++k) first += measurements[k].images.size();
  for (std::size_t n = measurements[*left_out].images.size(); n > 0; --n) {
    report.refused.push_back({report.seen[first].uv, Refusal::off_constellation});
    report.seen.erase(first);
  }
  measurements.erase(*left_out);
  report.used = static_cast<int>(report.seen.size());
  return true;
}

Result<UpdateReport> RelativeFilter::update(const LedFrame& frame, std::size_t agreeing,
                                            LedInformation* told, double misfit_px) {
  if (!initialized_ || frame.t != time_ || (updates_ > 0 && frame.t <= last_update_)) {
    return fail(Fault::invalid_input);
  }
  report_ = UpdateReport{};
  UpdateReport& report = report_;
  PictureMeasurements measurements;
  auto ready = prepare(frame, measurements, report);
  const bool contrary = !ready && ready.error().fault == Fault::ambiguous;
  if (contrary && frame.t != contrary_at_) {
    ++contrary_;
    contrary_at_ = frame.t;
  }
  if (contrary && agreeing == 0 && restless_ < 1) {
    // It may have moved evenly for too long to be believed when it no longer does. One
    // picture may be of lamps, and nothing would hold the pose against them.
    const bool at_once = contrary_ < kContrary;
    const double wider =
        at_once ? std::min(1 / restless_, kWiderAtOnce) : 1 / restless_;
    const Matrix15 P = P_;
    const TurnRate turn = turn_;
    P_ *= wider;
    turn_.P *= wider;
    turn_.cross *= wider;
    report = UpdateReport{};
    measurements.clear();
    ready = prepare(frame, measurements, report);
    if (ready || !at_once) {
      restless_ *= wider;
      of_d_.forget();
      of_turn_.forget();
    } else {
      P_ = P;
      turn_ = turn;
    }
  }
  if (!ready) return fail(ready.error());

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
  LedBias bias = led_bias_;
  auto done = map_update(camera_, leds_, measurements, options, next, P,
                         knows_led_errors() ? &bias : nullptr);
  if (!done) return fail(done.error());
  const auto contradicts = [&] {
    return misfit_px > 0 &&
           misfit_of(next.x.X_NB(), measurements, misfit_px) > misfit_px;
  };
  report.contradicts = report.seen.size() > kTelling && contradicts();
  if (report.contradicts &&
      leave_out_misfit(misfit_px, options, measurements, report)) {
    if (report.seen.size() < agreeing) return fail(Fault::ambiguous);
    next = state_;
    P = P_;
    bias = led_bias_;
    done = map_update(camera_, leds_, measurements, options, next, P,
                      knows_led_errors() ? &bias : nullptr);
    if (!done) return fail(done.error());
    report.contradicts = contradicts();
  }
  if (told != nullptr &&
      !(knows_led_errors() && options.velocity_variance == 0 &&
        tell_of_leds(camera_, leds_, measurements, options.huber_sd, next.x.X_NB(),
                     P.topLeftCorner<6, 6>(), led_bias_, *told))) {
    told->matrix.setZero(3 * leds_.size(), 3 * leds_.size());
    told->vector.setZero(3 * leds_.size());
  }
  led_bias_ = bias;
  if (config_.noise.turn > 0) {
    learn_turn(next, P);
    of_d_.add(next.d_N - state_.d_N, P_.block<3, 3>(9, 9) - P.block<3, 3>(9, 9));
    learn_restlessness();
  }
  state_ = next;
  P_ = P;
  contrary_ = 0;
  report.iterations = done->iterations;
  report.converged = done->converged;
  report.moved = done->moved;

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

void RelativeFilter::update_velocity(const Vector3& v_NB, double sd_m_s) {
  if (!initialized_ || !v_NB.allFinite() || !(sd_m_s > 0) || !std::isfinite(sd_m_s)) {
    return;
  }
  fuse_directly<3>(6, v_NB - state_.x.v_NB, sd_m_s * sd_m_s * Matrix3::Identity());
}

void RelativeFilter::update_pose(const Pose& X_NB, const Matrix6& cov) {
  if (!initialized_ || !X_NB.matrix().allFinite() || !cov.allFinite()) return;
  Vector6 innovation;
  innovation << X_NB.translation() - state_.x.p_NB,
      so3_log(state_.x.R_NB.transpose() * X_NB.linear());
  fuse_directly<6>(0, innovation, cov);
}

template <int N>
void RelativeFilter::fuse_directly(int first,
                                   const Eigen::Matrix<double, N, 1>& innovation,
                                   const Eigen::Matrix<double, N, N>& R) {
  using MatrixN = Eigen::Matrix<double, N, N>;
  const MatrixN S = P_.template block<N, N>(first, first) + R;
  const MatrixN S_inverse = S.llt().solve(MatrixN::Identity());
  if (!S_inverse.allFinite()) return;
  const Eigen::Matrix<double, 15, N> K = P_.template middleCols<N>(first) * S_inverse;
  const MotionState next = boxplus(state_, Vector15(K * innovation));
  if (config_.noise.turn > 0) {
    const Eigen::Matrix<double, 3, N> turned =
        turn_.cross.template middleCols<N>(first);
    const Eigen::Matrix<double, 3, N> K_turn = turned * S_inverse;
    turn_.w += K_turn * innovation;
    turn_.P -= K_turn * turned.transpose();
    turn_.cross -= K_turn * P_.template middleRows<N>(first);
  }
  Matrix15 left = Matrix15::Identity();
  left.template middleCols<N>(first) -= K;
  // Joseph's form: it stays positive however small the noise.
  const Matrix15 P = left * P_ * left.transpose() + K * R * K.transpose();
  state_ = next;
  P_ = 0.5 * (P + P.transpose());
  led_bias_ = (left * led_bias_).eval();
}

Vector2 RelativeFilter::led_variance(std::uint16_t leds, const Matrix26& H,
                                     const Matrix3& R_NB, double z) const {
  const Intrinsics& lens = camera_.intrinsics;
  const int n = std::popcount(leds);
  if (!leds_learnt_) {
    return (led_sd_m() / z * Vector2(lens.fx, lens.fy)).cwiseAbs2() / n;
  }
  // They move their images, and have moved the state.
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 3 * kMaxLeds> by_led =
      -(H * led_bias_.topRows<6>());
  const Eigen::Matrix<double, 2, 3> own = H.leftCols<3>() * R_NB / n;
  for (int i = 0; i < leds_.size(); ++i) {
    if ((leds >> i) & 1) by_led.middleCols<3>(3 * i) += own;
  }
  const Vector2 known =
      by_led.lazyProduct(led_cov_).eval().cwiseProduct(by_led).rowwise().sum();
  return known;
}

}  // namespace alight
