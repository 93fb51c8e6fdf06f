#include "alight/estimation/relative_filter.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "alight/geometry/small_solve.h"

namespace alight {
namespace {

constexpr Seconds kFrame = 1.0 / 60;  // what variance_per_frame counts by
constexpr Time kLongest = 60'000'000'000;
constexpr double kOpen = 1e-2;         // px^-2, of a direction that is left open
constexpr double kGatePerImage = 4.3;  // keeps a gate's share for 2 more dimensions
constexpr double kLost = 100;          // m, standard deviation; nothing is known beyond
constexpr double kTurnRateSd = 1;      // rad/s, at reset
constexpr Seconds kTurnMemory = 1;     // drones do not go on turning
// A drone that does not move as the model says (in a hand, on a cable) makes the
// process noise grow at once with what pictures find improbable, or with corrections of
// thrust and turn that add up to what they hardly ever do; else it follows these sums,
// picture by picture.
constexpr double kRestlessLeast = 0.0003, kRestlessMost = 100;
constexpr double kImprobable = 2;       // mean NIS, 1 by the model;
constexpr double kImprobableTrend = 2;  // mean square of those sums
constexpr int kContrary = 2;            // pictures in a row that end an even flight,
constexpr double kWiderAtOnce = 225;    // and what one may do to its variances
constexpr double kRestlessGain = 0.05;  // share of what it is off that counts at once
// Drones move smoothly: their corrections go on for a while that white noise would not
// have, even where the covariance is true (sines and splines, flights of both
// renderers).
constexpr double kSmooth = 1.8;
// Out of sight, what is left of a smooth movement adds up instead of averaging out:
// from then on the process noise grows, by as much again in each such time.
constexpr Seconds kGoesOnAlike = 0.05, kTurnsElsewhere = 0.1;
// Where the place is white noise integrated three times, and seen in white noise, half
// the variance of the velocity is the process's, however large either is (it goes with
// the square root of both). Of drones little more than the other half is left where the
// filter averages over less than they take to change their push, most where it averages
// over more. Measured on Alight's own flights, clean and hard.
constexpr double kVelocityLeast = 0.24;
constexpr Seconds kPushesAlike = 0.165;
constexpr double kPushesEnd = 0.66;  // exponent; how sudden the one becomes the other
// The more corrections of what pushes the drone have lately gone on in one direction,
// the farther the velocity lags behind. Exponent of their mean square, of what it is as
// a rule, and over how many pictures it is taken.
constexpr double kLags = 0.225, kTrendUsual = 0.45, kTrendLeast = 0.1, kTrendMost = 8;
constexpr double kTrendMemory = 12;
// Share of a picture's noise that stays for the next: to average more pictures than
// usual gains less than it seems to, and fewer lose less.
constexpr double kNoiseAlike = 0.0226;
constexpr double kAveragedUsual = 7.8, kAveragedLeast = 2, kAveragedMost = 18;
// Six LEDs show six directions of their errors. What is learnt from these varies; the
// mean of 1 / chi^2 of six degrees of freedom is 1.5 / 6.
constexpr double kLedCaution = 1.2247;  // sqrt(1.5)
constexpr double kLeftLeast = 0.1;  // of a residual's variance, whatever is computed
// By how much more it may be pushed aside while few pictures have told how it moves: it
// may be carried.
constexpr double kCarried = 2.75;
constexpr double kCarriedFor = 60;  // pictures, less and less
// Pictures in a row after which the way shows what pushes the drone, whatever way it
// was supposed to lean at first.
constexpr int kPushSeen = 6;
// Beyond so many sd of all that it may be off by, an LED contradicts the others;
constexpr double kMisfitSds = 2.5;
constexpr double kPlainly = 0.6;     // share of the next best misfit without it
constexpr std::size_t kTelling = 4;  // more of them tell which one
constexpr double kTurnAside = 0.2;   // rad; a turn so far off tells nothing of its rate

bool finite(const PlatformState& p) {
  return p.X_IN.matrix().allFinite() && p.w_IN_N.allFinite() && p.a_IN_N.allFinite() &&
         p.alpha_IN_N.allFinite();
}

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

bool positive_definite(const Matrix2& m) {
  return m.allFinite() && m(0, 0) > 0 && m.determinant() > 0;
}

/// The derivative of a step, by the few of its entries that are not zero.
class Transition {
 public:
  explicit Transition(const Matrix15& F) {
    for (int k = 0; k < 15; ++k) {
      for (int i = 0; i < 15; ++i) {
        if (F(i, k) != 0) entries_[count_++] = {i, k, F(i, k)};
      }
    }
  }

  /// F P F' for a symmetric P.
  Matrix15 carry(const Matrix15& P) const {
    return times_transposed(Matrix15(times_transposed(P).transpose()));
  }

  /// F B.
  void carry(LedBias& B) const {
    const Eigen::Matrix<double, Eigen::Dynamic, 15, 0, 3 * kMaxLeds, 15> from =
        B.transpose();
    B = times_transposed(from).transpose();
  }

 private:
  struct Entry {
    int i, k;
    double value;
  };

  /// M F'.
  template <class Matrix>
  Matrix times_transposed(const Matrix& M) const {
    Matrix out = Matrix::Zero(M.rows(), 15);
    for (int n = 0; n < count_; ++n) {
      const Entry& f = entries_[static_cast<std::size_t>(n)];
      out.col(f.i) += f.value * M.col(f.k);
    }
    return out;
  }

  std::array<Entry, 15 * 15> entries_;
  int count_ = 0;
};

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

Result<void> RelativeFilter::predict_to(Time t, const PredictionInput& given) {
  if (!initialized_ || t < time_ || t - time_ > kLongest) {
    return fail(Fault::invalid_input);
  }
  if (t == time_) return {};
  PredictionInput input = given;
  if (!taken(input)) return fail(Fault::invalid_input);

  const Seconds dt = to_seconds(t - time_);
  Matrix15 F;
  const MotionState next = extrapolate(state_, input, dt, config_.motion(), &F);
  ProcessNoise noise = config_.noise;
  if (!config_.estimate_disturbance) {
    noise.disturbance = noise.updraught = noise.bias = noise.thrust = 0;
  }
  if (noise.turn > 0) {
    const double told = std::min(updates_ / kCarriedFor, 1.0);
    const double more = kCarried + (1 - kCarried) * told;
    noise.disturbance *= more;
    noise.updraught *= more;
  }
  const double restless = restless_unseen(t);
  // However restless a drone is, its drag is its own.
  if (config_.estimate_drag) noise.bias /= std::sqrt(restless);
  const Transition transition(F);
  Matrix15 P = transition.carry(P_) +
               restless * process_covariance(noise, dt, state_.x.R_NB.col(2),
                                             config_.estimate_drag);
  P.diagonal().head<9>().array() += config_.variance_per_frame * dt / kFrame;
  const TurnRate turn = noise.turn > 0 ? predict_turn(dt, restless, F, P) : turn_;
  if (!P.allFinite() || !next.x.p_NB.allFinite() || !next.x.R_NB.allFinite() ||
      !next.x.v_NB.allFinite() || !next.d_N.allFinite() || !next.b_N.allFinite()) {
    return fail(Fault::invalid_input);
  }
  if (P.diagonal().head<3>().maxCoeff() > kLost * kLost) {
    stop();
    return fail(Fault::degenerate);
  }
  state_ = next;
  turn_ = turn;
  P_ = 0.5 * (P + P.transpose());
  if (knows_led_errors()) transition.carry(led_bias_);
  time_ = t;
  return {};
}

bool RelativeFilter::taken(PredictionInput& input) const {
  if (!config_.platform_motion) input.platform = PlatformState{};
  if (config_.model == ProcessModel::hover) input.f_N.setZero();
  input.w_NB_B = turn_rate(input);
  return finite(input.platform) && input.f_N.allFinite() && input.w_NB_B.allFinite() &&
         input.lift_N.allFinite();
}

void RelativeFilter::shift(Seconds dt, const PredictionInput& given) {
  PredictionInput input = given;
  if (!initialized_ || !std::isfinite(dt) || dt == 0 || !taken(input)) return;
  Matrix15 F;
  const MotionState next = extrapolate(state_, input, dt, config_.motion(), &F);
  const Transition transition(F);
  Matrix15 P = transition.carry(P_);
  TurnRate turn = turn_;
  if (config_.noise.turn > 0) turn.cross = turn_by_rate(dt, F, P);
  if (!P.allFinite() || !next.x.p_NB.allFinite() || !next.x.R_NB.allFinite()) return;
  state_ = next;
  turn_ = turn;
  P_ = 0.5 * (P + P.transpose());
  if (knows_led_errors()) transition.carry(led_bias_);
}

RelativeFilter::TurnRate RelativeFilter::unknown_turn() {
  TurnRate turn;
  turn.P = kTurnRateSd * kTurnRateSd * Matrix3::Identity();
  return turn;
}

double RelativeFilter::restless_unseen(Time t) const {
  if (config_.noise.turn <= 0 || updates_ == 0) return restless_;
  const Seconds unseen = to_seconds(t - last_update_) - kGoesOnAlike;
  return restless_ * (1 + std::max(unseen, 0.0) / kTurnsElsewhere);
}

Eigen::Matrix<double, 3, 15> RelativeFilter::turn_by_rate(Seconds dt, const Matrix15& F,
                                                          Matrix15& P) const {
  // R turns by the rate: P += F C' B' + B C F' + B W B', with B = dt in the rows of R.
  const Eigen::Matrix<double, 15, 3> carried = F.lazyProduct(turn_.cross.transpose());
  P.middleCols<3>(3) += dt * carried;
  P.middleRows<3>(3) += dt * carried.transpose();
  P.block<3, 3>(3, 3) += dt * dt * turn_.P;
  Eigen::Matrix<double, 3, 15> cross = carried.transpose();
  cross.middleCols<3>(3) += dt * turn_.P;
  return cross;
}

RelativeFilter::TurnRate RelativeFilter::predict_turn(Seconds dt, double restless,
                                                      const Matrix15& F,
                                                      Matrix15& P) const {
  const Eigen::Matrix<double, 3, 15> cross = turn_by_rate(dt, F, P);
  const double kept = std::exp(-dt / kTurnMemory);
  const double q2 = restless * config_.noise.turn * config_.noise.turn;
  TurnRate next;
  next.w = kept * turn_.w;
  next.cross = kept * cross;
  next.P = kept * kept * turn_.P;
  next.P.diagonal().array() += q2 * kTurnMemory / 2 * (1 - kept * kept);
  return next;
}

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

std::optional<Push> RelativeFilter::push() const {
  if (config_.model != ProcessModel::hover || config_.noise.turn <= 0 ||
      in_a_row_ < kPushSeen) {
    return std::nullopt;
  }
  return Push{disturbance_N() + kGravity * state_.x.R_NB.col(2), P_.block<3, 3>(9, 9)};
}

Covariance9 RelativeFilter::as_flown() const {
  const Covariance9 P = tracking_covariance();
  if (config_.noise.turn <= 0 || in_a_row_ == 0 || !(between_s_ > 0)) return P;
  // Over how long the filter averages.
  const double averaged_s =
      std::sqrt(P.diagonal().head<3>().sum() / P.diagonal().tail<3>().sum());
  const Eigen::LLT<Matrix6> pose(P.topLeftCorner<6, 6>());
  if (!std::isfinite(averaged_s) || pose.info() != Eigen::Success) return P;
  const double settled = std::min(in_a_row_ / kCarriedFor, 1.0);
  const double less =
      (1 - kVelocityLeast) * std::exp(-std::pow(averaged_s / kPushesAlike, kPushesEnd));
  const double lags =
      std::pow(std::max(lately_of_d_ / kTrendUsual, kTrendLeast), settled * kLags);
  const double pushed = (1 - settled * less) * lags;
  const double pictures =
      std::clamp(averaged_s / between_s_, kAveragedLeast, kAveragedMost);
  const double noise = 1 + settled * kNoiseAlike * (pictures - kAveragedUsual);

  const Eigen::Matrix<double, 6, 3> cross = P.topRightCorner<6, 3>();
  const Matrix3 by_pose =
      cross.transpose() * solve_small<6, 3>(pose, cross);  // what of v the pose tells
  Covariance9 told = noise * P;
  told.bottomRightCorner<3, 3>() =
      noise * by_pose + pushed * (P.bottomRightCorner<3, 3>() - by_pose);
  return told;
}

Covariance9 RelativeFilter::covariance() const {
  Covariance9 total = as_flown();
  const double led = led_sd_m();
  if (leds_learnt_) {
    const auto B = led_bias_.topRows<9>();
    total.noalias() += B.lazyProduct(led_cov_).eval().lazyProduct(B.transpose());
  } else if (led > 0) {
    const auto B = led_bias_.topRows<9>();
    total.noalias() += led * led * B.lazyProduct(B.transpose());
  }
  return total + led_frame_covariance() +
         mount_covariance(state_.x.p_NB, state_.x.v_NB);
}

Covariance9 RelativeFilter::led_frame_covariance() const {
  // LEDs that are moved in B by s + (p - middle) turned by t are taken for a drone that
  // is moved by s + middle x t and turned by t; larger ones for a drone that is nearer.
  const LedFrameSpec& frame = config_.led_frame;
  if (frame.exact()) return Covariance9::Zero();
  const Matrix3& R = state_.x.R_NB;
  Eigen::Matrix<double, 9, 7> by = Eigen::Matrix<double, 9, 7>::Zero();
  by.block<3, 3>(0, 0) = R * frame.shift_sd_m.asDiagonal();
  by.block<3, 3>(0, 3) = R * hat(leds_.middle_B()) * frame.turn_sd_rad.asDiagonal();
  by.block<3, 3>(3, 3) = frame.turn_sd_rad.asDiagonal();
  by.block<3, 1>(0, 6) =
      frame.size_sd * (state_.x.X_NB() * leds_.middle_B() - camera_.X_NC.translation());
  by.block<3, 1>(6, 6) = frame.size_sd * state_.x.v_NB;
  return by * by.transpose();
}

Covariance9 RelativeFilter::mount_covariance(const Vector3& p_NB,
                                             const Vector3& v_NB) const {
  // A mount that is off moves the drone with it, about the camera.
  const Vector3 arm = p_NB - camera_.X_NC.translation();
  const double shift = config_.mount_position_sd_m;
  const double turn = config_.mount_rotation_sd_rad;
  Covariance9 total = Covariance9::Zero();
  total.diagonal().head<3>().array() += shift * shift;
  Eigen::Matrix<double, 9, 3> by_turn;
  by_turn << -hat(arm), state_.x.R_NB.transpose(), -hat(v_NB);
  total.noalias() += turn * turn * by_turn * by_turn.transpose();

  // A focal length that is off scales the distance along the optical axis.
  const Vector3 axis = camera_.X_NC.linear().col(2);
  Vector9 by_focal = Vector9::Zero();
  by_focal.head<3>() = axis * axis.dot(arm);
  by_focal.tail<3>() = axis * axis.dot(v_NB);
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
