// When RelativeEstimator believes a pose that was found.
#include <algorithm>
#include <cmath>

#include "alight/geometry/near.h"
#include "alight/mission/relative_estimator.h"

namespace alight {
namespace {

// One that has followed them through pictures is wrong if others fit so many times
// better.
constexpr double kMisreadRms = 2;
constexpr double kReachSds = 3;  // Where nobody tells how it moves it may be far off.
// Another drone is the same from picture to picture; one that leans as it should is
// not.
constexpr double kOtherWithin = 0.3, kOtherTurns = 12 * kDegree;
constexpr Seconds kOtherStays = 3;
constexpr double kFlies = 0.5;  // With at least so much of its weight in thrust.

}  // namespace

// It may be anywhere, and four lamps look like four of its LEDs sooner or later.
bool RelativeEstimator::forgotten_in_flight() const {
  return config_.reach_m_s > 0 && !filter_.initialized() && !expecting_ &&
         beyond_doubt_;
}

bool RelativeEstimator::beyond_doubt(const Result<FoundLeds>& found) const {
  if (!found || !config_.tell_apart) return found.has_value();
  return found->frame.seen.size() >= kTellingLeds && exact(*found);
}

bool RelativeEstimator::misread(const FoundLeds& found) const {
  if (found.frame.seen.size() > PoseDoubt::kFew) return false;
  OtherPoses others;
  find_other_poses(camera_, leds_, config_.finder.use_color, finder_,
                   {found.frame.seen.data(), found.frame.seen.size()}, found.fit.X_NB,
                   found.fit.rms_px / kMisreadRms, others);
  return std::any_of(others.begin(), others.end(), [&](const OtherPose& other) {
    return !near(other.fit.X_NB, found.fit.X_NB, config_.placed_within_m,
                 config_.placed_within_deg * kDegree);
  });
}

double RelativeEstimator::placed_rms_max_px(const Pose& X_NB) const {
  const double range = (X_NB.translation() - camera_.X_NC.translation()).norm();
  const double led_px =
      config_.finder.led_sd_m * camera_.intrinsics.fx / std::max(range, 0.05);
  return config_.placed_sds * std::hypot(config_.placed_sd_px, led_px);
}

bool RelativeEstimator::believable(const FoundLeds& found, Time t) {
  // Just where it is expected no lamps stand by chance.
  if (near(filter_.state().X_NB(), found.fit.X_NB, config_.expected_within_m,
           config_.expected_within_deg * kDegree)) {
    confirmations_ = 0;
    return true;
  }
  // Lamps that look like the constellation do so less exactly than the LEDs did.
  if (usual_misfit_ > 0 && found.fit.rms_px > exact_px(found.fit.X_NB.translation())) {
    confirmations_ = 0;
    return false;
  }
  const Seconds unseen = to_seconds(t - last_sight_);
  const auto lights = static_cast<int>(found.frame.seen.size());
  if (near(filter_.state().X_NB(), found.fit.X_NB,
           config_.search_gate_m + config_.search_drift_m_s * unseen,
           config_.search_turn_deg * kDegree)) {
    // Among many lamps four lie by chance as four LEDs may, or as more that run
    // together, and in a row even five as those of six.
    if (lights <= config_.search_leds) return confirmed(found.fit.X_NB);
    confirmations_ = 0;
    return true;
  }
  return lights >= config_.search_leds && confirmed(found.fit.X_NB);
}

void RelativeEstimator::refuse(const Pose& X_NB, Time t) {
  forget();
  rivals_.clear();
  doubt_.clear();
  beyond_doubt_.reset();
  other_ = Seen{X_NB, t};
}

bool RelativeEstimator::is_other(const Pose& X_NB, Time t) {
  const bool there = other_ && to_seconds(t - other_->t) < kOtherStays &&
                     near(other_->X_NB, X_NB, kOtherWithin, kOtherTurns);
  if (there) other_ = Seen{X_NB, t};
  return there;
}

bool RelativeEstimator::within_reach(const Pose& X_NB, Time t) const {
  if (!filter_.initialized() || !beyond_doubt_ || config_.reach_m_s <= 0) return true;
  const double by_time =
      config_.reach_m + config_.reach_m_s * to_seconds(t - beyond_doubt_->t);
  const double reach = std::max(by_time, kReachSds * filter_.position_sd());
  const auto off = [&](const Vector3& p_NB) {
    return (X_NB.translation() - p_NB).norm();
  };
  // Something may hold it that set-points know nothing of.
  return off(filter_.state().p_NB) <= reach ||
         off(beyond_doubt_->X_NB.translation()) <= by_time;
}

// Telemetry tells how it leans however long it is out of sight. Lamps that look like
// LEDs look like those of a drone that leans anyhow.
bool RelativeEstimator::leans_as_known(const Matrix3& R_NB) const {
  if (lift_N_.norm() < kFlies || config_.search_lean_deg >= 180) return true;
  const double along = R_NB.col(2).dot(lift_N_.normalized());
  return along > std::cos(config_.search_lean_deg * kDegree);
}

bool RelativeEstimator::confirmed(const Pose& X_NB) {
  const bool again = near(X_NB_contrary_, X_NB, config_.search_gate_m,
                          config_.search_turn_deg * kDegree);
  confirmations_ = again ? confirmations_ + 1 : 1;
  X_NB_contrary_ = X_NB;
  return confirmations_ >= config_.search_confirmations;
}

}  // namespace alight
