#include "alight/estimation/led_learner.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alight/base/bounds.h"
#include "alight/estimation/huber.h"

namespace alight {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix63 = Eigen::Matrix<double, 6, 3>;

constexpr double kHuber = 2.5;           // standard deviations
constexpr std::size_t kLeastImages = 5;  // fewer tell nothing beside the pose's six
// What is found weighs against what was supposed as if that came from so many
// coordinates.
constexpr double kSupposedWeight = 3;
// Sum of squares that LEDs may be off, over what is expected of them: beyond, pictures
// and LEDs do not belong together. Chi-square of 18 degrees of freedom lies below with
// all but 1e-9.
constexpr double kOffMost = 4;
constexpr double kTurnGrowth = 1.5;
// On variances: how far LEDs are off is known from about a dozen directions, and the
// mean of 12 / chi^2 of twelve degrees of freedom is this.
constexpr double kCaution = 1.2;

}  // namespace

Result<void> LedLearnerConfig::validate() const {
  return check_bounds({{"led_learner.led_sd_m", led_sd_m, 1e-5, 0.1},
                       {"led_learner.led_sd_max_m", led_sd_max_m, led_sd_m, 0.1},
                       {"led_learner.pixel_sd_px", pixel_sd_px, 1e-3, 10},
                       {"led_learner.turn_deg", turn_deg, 0.1, 90},
                       {"led_learner.nearer", nearer, 0.01, 1}});
}

LedLearner::LedLearner(const LedLearnerConfig& config, const Camera& camera,
                       const Constellation& nominal)
    : config_(config),
      camera_(camera),
      nominal_(nominal),
      leds_(nominal),
      turn_(config.turn_deg * kDegree),
      led_sd_m_(config.led_sd_m) {
  const Eigen::Index n = 3 * nominal.size();
  cov_ = LedCovariance::Identity(n, n) * (led_sd_m_ * led_sd_m_);
  S_.setZero(n, n);
  g_.setZero(n);
}

void LedLearner::forget() {
  pictures_.clear();
  leds_ = nominal_;
  led_sd_m_ = config_.led_sd_m;
  cov_.setIdentity();
  cov_ *= led_sd_m_ * led_sd_m_;
  turn_ = config_.turn_deg * kDegree;
}

bool LedLearner::offer(const Pose& X_NB, std::span<const Image> images) {
  if (images.size() < kLeastImages) return false;
  Picture picture;
  picture.X_NB = X_NB;
  const Vector3 to_lens = camera_.X_NC.translation() - X_NB.translation();
  picture.range_m = to_lens.norm();
  picture.side_B = X_NB.linear().transpose() * to_lens / picture.range_m;
  for (const Image& image : images) picture.images.push_back(image);
  // The picture of the same side, unless there is none.
  Picture* same = nullptr;
  double most = std::cos(turn_);
  for (Picture& kept : pictures_) {
    const double alike = kept.side_B.dot(picture.side_B);
    if (alike <= most) continue;
    most = alike;
    same = &kept;
  }
  if (same != nullptr) {
    const bool better = picture.range_m < config_.nearer * same->range_m &&
                        picture.images.size() >= same->images.size();
    if (better) *same = picture;
    return better;
  }
  if (pictures_.size() == kMostPictures) thin_out();
  if (pictures_.size() == kMostPictures) return false;
  pictures_.push_back(picture);
  return true;
}

void LedLearner::thin_out() {
  turn_ *= kTurnGrowth;
  FixedVector<Picture, kMostPictures> left;
  for (const Picture& picture : pictures_) {
    const auto alike = [&](const Picture& other) {
      return other.side_B.dot(picture.side_B) > std::cos(turn_);
    };
    if (std::none_of(left.begin(), left.end(), alike)) left.push_back(picture);
  }
  pictures_ = left;
}

bool LedLearner::add_to_normal_equations(Picture& picture) {
  const Eigen::Index n = 3 * leds_.size();
  Matrix6 A = 1e-9 * Matrix6::Identity();
  Vector6 b = Vector6::Zero();
  picture.by_leds.setZero(6, n);
  const double own = config_.pixel_sd_px * config_.pixel_sd_px;
  for (const Image& image : picture.images) {
    Matrix26 J;
    const auto uv = project_led(camera_, picture.X_NB, leds_.p_BL(image.led), &J);
    if (!uv) return false;
    const Vector2 r = image.uv - *uv;
    double w = 1 / (image.variance_px2 + own);
    const double e = std::sqrt(w) * r.norm();
    w *= huber_weight(e * e, kHuber);
    const Eigen::Matrix<double, 2, 3> J_led = J.leftCols<3>() * picture.X_NB.linear();
    A.noalias() += w * J.transpose() * J;
    b.noalias() += w * J.transpose() * r;
    const Eigen::Index at = 3 * image.led;
    picture.by_leds.middleCols<3>(at).noalias() = w * J.transpose() * J_led;
    S_.block<3, 3>(at, at).noalias() += w * J_led.transpose() * J_led;
    g_.segment<3>(at).noalias() += w * J_led.transpose() * r;
  }
  const Eigen::LLT<Matrix6> llt(A);
  if (llt.info() != Eigen::Success) return false;
  picture.change = llt.solve(b);
  g_.noalias() -= picture.by_leds.transpose() * picture.change;
  // With L of A = L L', C' A^-1 C is that of L^-1 C with itself.
  auto half = picture.by_leds;
  llt.matrixL().solveInPlace(half);
  S_.noalias() -= half.transpose().lazyProduct(half);
  llt.matrixU().solveInPlace(half);
  picture.by_leds = half;
  return true;
}

bool LedLearner::step() {
  if (pictures_.size() < 2) return false;
  const Eigen::Index n = 3 * leds_.size();
  S_.setZero(n, n);
  g_.setZero(n);
  for (Picture& picture : pictures_) {
    if (add_to_normal_equations(picture)) continue;
    pictures_.clear();
    return false;
  }
  const double prior = 1 / (led_sd_m_ * led_sd_m_);
  LedVector off(n);
  for (int i = 0; i < leds_.size(); ++i) {
    off.segment<3>(3 * i) = leds_.p_BL(i) - nominal_.p_BL(i);
  }
  S_.diagonal().array() += prior;
  g_ -= prior * off;
  const Eigen::LLT<LedCovariance> llt(S_);
  if (llt.info() != Eigen::Success) return false;
  const LedVector change = llt.solve(g_);
  const LedVector now = off + change;
  const auto coordinates = static_cast<double>(n);
  const double most = config_.led_sd_max_m;
  if (!(now.squaredNorm() < kOffMost * most * most * coordinates)) {
    pictures_.clear();
    return false;
  }
  for (int i = 0; i < leds_.size(); ++i) {
    leds_.leds[static_cast<std::size_t>(i)].p_BL =
        nominal_.p_BL(i) + now.segment<3>(3 * i);
  }
  for (Picture& picture : pictures_) {
    const Vector6 d = picture.change - picture.by_leds * change;
    picture.X_NB.translation() += d.head<3>();
    picture.X_NB.linear() = picture.X_NB.linear() * so3_exp(d.tail<3>());
  }
  cov_ = kCaution * llt.solve(LedCovariance::Identity(n, n));
  // How far LEDs are off is itself learnt (expectation maximization).
  const double supposed = config_.led_sd_m * config_.led_sd_m;
  const double found = now.squaredNorm() + cov_.trace();
  led_sd_m_ = std::min(
      std::sqrt((found + kSupposedWeight * supposed) / (coordinates + kSupposedWeight)),
      most);
  return true;
}

}  // namespace alight
