// How well RelativeFilter says it knows the state.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alight/estimation/relative_filter.h"
#include "alight/estimation/relative_filter_common.h"
#include "alight/geometry/small_solve.h"

namespace alight {
namespace {

// Where the place is white noise integrated three times, and seen in white noise, half
// the variance of the velocity is the process's, however large either is (it goes with
// the square root of both). Of drones little more than the other half is left where the
// filter averages over less than they take to change their push, most where it averages
// over more. Measured on Alight's own flights, clean and hard.
constexpr double kVelocityLeast = 0.24;
constexpr Seconds kPushesAlike = 0.165;
constexpr double kPushesEnd = 0.66;  // exponent; how sudden the one becomes the other
// The more corrections of what pushes the drone have lately gone on in one direction,
// the farther the velocity lags behind. Exponent of their mean square.
constexpr double kLags = 0.225, kTrendLeast = 0.1;
// Share of a picture's noise that stays for the next: to average more pictures than
// usual gains less than it seems to, and fewer lose less.
constexpr double kNoiseAlike = 0.0226;
constexpr double kAveragedUsual = 7.8, kAveragedLeast = 2, kAveragedMost = 18;
// Pictures in a row after which the way shows what pushes the drone, whatever way it
// was supposed to lean at first.
constexpr int kPushSeen = 6;

}  // namespace

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
