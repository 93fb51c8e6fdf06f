// What RelativeEstimator learns of the camera and the LEDs while it follows the drone.
#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "alight/mission/relative_estimator.h"

namespace alight {
namespace {

constexpr int kLearnerSteps = 2;  // for each picture that it keeps
// Residuals of LEDs that were learnt are noise. Where they are more than this, and
// these times as large as with the LEDs as written, in so many pictures in a row, what
// was learnt is wrong.
constexpr double kUnexplained_px = 0.15, kWrittenBetter = 3;
constexpr int kWrittenPictures = 4;
constexpr double kGammaKept = 0.07;    // change of its logarithm that does not matter
constexpr double kGammaBlur_px = 0.7;  // streaks are no round lights

using FewLights = FixedVector<Vector2, GammaLearner::kLightsMost>;

/// The two lights of one LED each that stand nearest to one another among those that
/// tell a gamma, with one more that may stand beside them; none: empty.
FewLights lights_side_by_side(const FrameReport& report, const Constellation& leds,
                              double sd_px) {
  FixedVector<LedObservation, kMaxLeds> seen;
  for (const LedUse& use : report.leds) {
    if (std::has_single_bit(use.observation.leds)) seen.push_back(use.observation);
  }
  const auto color_of = [&](const LedObservation& o) {
    return leds.color(std::countr_zero(o.leds));
  };
  const double alone_px = GammaLearner::kAlone * sd_px;
  const auto group_of = [&](const LedObservation& a, const LedObservation& b) {
    const auto beside = [&](const Vector2& uv) {
      return (uv - a.uv).norm() < alone_px || (uv - b.uv).norm() < alone_px;
    };
    FewLights group;
    for (const LedObservation& o : seen) {
      if (!beside(o.uv)) continue;
      if (color_of(o) != color_of(a) || !group.push_back(o.uv)) return FewLights();
    }
    for (const RefusedBlob& blob : report.refused) {
      if (beside(blob.uv)) return FewLights();
    }
    return group;
  };
  FewLights best;
  double nearest = GammaLearner::kFarthest * sd_px;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const double apart = (seen[i].uv - seen[k].uv).norm();
      if (apart < GammaLearner::kNearest * sd_px || apart > nearest) continue;
      const FewLights group = group_of(seen[i], seen[k]);
      if (group.empty()) continue;
      best = group;
      nearest = apart;
    }
  }
  return best;
}

}  // namespace

void RelativeEstimator::take_gamma(double gamma) {
  linear_.set_gamma(gamma);
  resolver_.forget_lights();
  if (config_.heed_noise) set_noise();
}

void RelativeEstimator::learn_gamma(const ImageView& stored, const FrameReport& out) {
  if (gamma_learner_.busy()) {
    gamma_learner_.step();
    if (gamma_learner_.busy()) return;
    const auto found = gamma_learner_.gamma();
    if (!found) return;
    if (std::abs(std::log(*found / linear_.gamma())) > kGammaKept) take_gamma(*found);
    return;
  }
  if (!out.tracked || gamma_learner_.settled() || stored.mosaic != Mosaic::none) return;
  const double sd_px = std::sqrt(resolver_.spread().variance_px2 * linear_.gamma());
  const FewLights lights = lights_side_by_side(out, leds_, sd_px);
  if (lights.empty()) return;
  for (const Vector2& blur_px : image_motion(filter_.state().X_NB())) {
    if (blur_px.norm() > kGammaBlur_px) return;
  }
  gamma_learner_.look(stored, {lights.data(), lights.size()}, sd_px, noise_);
}

void RelativeEstimator::learn_leds(const LedFrame& leds, const UpdateReport& report) {
  FixedVector<LedLearner::Image, kMaxLeds> images;
  for (const ObservationReport& used : report.seen) {
    if (!std::has_single_bit(used.leds) || !used.alone) continue;
    for (const LedObservation& o : leds.seen) {
      if (o.leds != used.leds) continue;
      const double variance = filter_.image_noise() * o.cov.trace() / 2;
      images.push_back({std::countr_zero(o.leds), o.uv, variance});
    }
  }
  if (learner_.offer(filter_.state().X_NB(), {images.data(), images.size()})) {
    steps_ = kLearnerSteps;
  }
  if (!learning_ || steps_ == 0) return;
  --steps_;
  if (!learner_.step()) return;
  take_leds(learner_.leds(), learner_.cov());
}

std::optional<PoseFit> RelativeEstimator::written_fits_better() {
  const int before = std::exchange(written_better_, 0);
  if (!learning_ || seen_.size() < PoseDoubt::kFew) return {};
  const ObservationSpan seen(seen_.data(), seen_.size());
  const Pose X_NB = filter_.state().X_NB();
  const auto own = refine_pose(camera_, leds_, seen, X_NB);
  if (!own || own->rms_px < kUnexplained_px) return {};
  const double rms_max = own->rms_px / kWrittenBetter;
  const Constellation& written = learner_.written();
  std::optional<PoseFit> best;
  if (const auto near = refine_pose(camera_, written, seen, X_NB)) best = *near;
  if (!best || best->rms_px > rms_max) {
    best = mirrored_pose(camera_, written, seen, X_NB);
  }
  if (!best || best->rms_px > rms_max || !finder_.plausible(best->X_NB)) return {};
  written_better_ = before + 1;
  return written_better_ < kWrittenPictures ? std::nullopt : best;
}

void RelativeEstimator::learn_led_errors(const LedInformation& told, Time t) {
  const Seconds since = std::clamp(to_seconds(t - last_told_of_leds_), 0.0, 60.0);
  last_told_of_leds_ = t;
  (void)errors_.add(told, since);
  take_leds(errors_.leds(), errors_.cov());
}

void RelativeEstimator::take_leds(const Constellation& leds, const LedCovariance& cov) {
  leds_ = leds;
  filter_.correct_leds(leds_, cov);
  tracker_.set_rig(camera_, leds_);
  resolver_.set_rig(camera_, leds_);
  leds_moved_ = true;
}

}  // namespace alight
