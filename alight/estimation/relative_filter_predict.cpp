// How RelativeFilter goes on from one picture to the next.
#include <array>
#include <cmath>

#include "alight/estimation/relative_filter.h"
#include "alight/estimation/relative_filter_common.h"

namespace alight {
namespace {

constexpr Seconds kFrame = 1.0 / 60;  // what variance_per_frame counts by
constexpr Time kLongest = 60'000'000'000;
constexpr double kLost = 100;       // m, standard deviation; nothing is known beyond
constexpr double kTurnRateSd = 1;   // rad/s, at reset
constexpr Seconds kTurnMemory = 1;  // drones do not go on turning
// Out of sight, what is left of a smooth movement adds up instead of averaging out:
// from then on the process noise grows, by as much again in each such time.
constexpr Seconds kTurnsElsewhere = 0.1;
// By how much more it may be pushed aside while few pictures have told how it moves: it
// may be carried.
constexpr double kCarried = 2.75;

bool finite(const PlatformState& p) {
  return p.X_IN.matrix().allFinite() && p.w_IN_N.allFinite() && p.a_IN_N.allFinite() &&
         p.alpha_IN_N.allFinite();
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

}  // namespace alight
