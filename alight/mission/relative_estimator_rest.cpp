// What RelativeEstimator makes of a drone that stands where it is told to stand.
#include <algorithm>
#include <bit>
#include <cmath>

#include "alight/mission/relative_estimator.h"

namespace alight {
namespace {

constexpr double kRestReach = 4;  // sd of its place, from where it is expected
// LEDs that are off by more than the rig is supposed to be would be taken for their
// neighbours: which is which is asked of a rig that is this many times worse.
constexpr double kRigDoubt = 2;

RestCalibrationConfig doubted(RestCalibrationConfig config) {
  config.led_sd_m *= kRigDoubt;
  return config;
}

/// By the rig as well as it is supposed to be known, or else half as well.
Result<RestFit> measure_at_rest(const RestCalibrationConfig& config,
                                const Camera& camera, const Constellation& leds,
                                std::span<const LedObservation> seen,
                                const Pose& X_NB_rest) {
  auto fit = calibrate_at_rest(config, camera, leds, seen, X_NB_rest);
  return fit ? fit : calibrate_at_rest(doubted(config), camera, leds, seen, X_NB_rest);
}

}  // namespace

void RelativeEstimator::remember_rest(const LedFrame& leds) {
  for (const LedObservation& o : leds.seen) {
    if (std::has_single_bit(o.leds)) rest_images_.add(std::countr_zero(o.leds), o.uv);
  }
}

Result<RestFit> RelativeEstimator::calibrate_at_rest() {
  if (!config_.calibrate_at_rest || !expecting_ || !filter_.initialized()) {
    return fail(Fault::too_few_points);
  }
  FixedVector<LedObservation, kMaxLeds> seen;
  for (int i = 0; i < leds_.size(); ++i) {
    const auto uv = rest_images_.mean(i, config_.rest_pictures);
    if (!uv) continue;
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << i);
    o.uv = *uv;
    seen.push_back(o);
  }
  const auto fit = measure_at_rest(config_.rest, camera_written_, leds_written_,
                                   {seen.data(), seen.size()}, X_NB_expected_);
  if (!fit) return fail(fit.error());
  take_rest(*fit, static_cast<int>(seen.size()), filter_.time());
  return fit;
}

void RelativeEstimator::take_rest(const RestFit& fit, int leds_seen, Time t) {
  camera_ = fit.camera;
  leds_ = fit.leds;
  errors_.measured(leds_, fit.led_cov);
  // One that was not seen at rest is known no better than before.
  const bool all = leds_seen == leds_.size();
  const double led_sd_m = all ? config_.rest_led_sd_m : config_.rest.led_sd_m;
  config_.finder.led_sd_m = led_sd_m;
  tracker_.set_rig(camera_, leds_, led_sd_m);
  finder_.set_rig(camera_, leds_, led_sd_m);
  resolver_.set_rig(camera_, leds_);
  forget_past();
  filter_.set_rig(camera_, leds_, led_sd_m);
  rivals_.set_rig(camera_, filter_);
  // What one side of the drone has shown of its LEDs, others go on to correct.
  learner_ = LedLearner(config_.learner, camera_, leds_);
  learning_ = config_.learn_leds;
  leds_moved_ = false;
  rig_measured_ = true;
  rest_leds_ = leds_seen;
  X_NB_rest_ = fit.X_NB;
  // They fit where it stands, whatever is wrong with them elsewhere.
  misfit_least_ = led_sd_m * camera_.intrinsics.fx;
  RelativeState x;
  x.p_NB = fit.X_NB.translation();
  x.R_NB = fit.X_NB.linear();
  Covariance9 cov = Covariance9::Zero();
  cov.diagonal() << Vector3::Constant(2.5e-5), Vector3::Constant(1e-3),
      Vector3::Constant(1e-4);
  if (config_.learn_led_errors) filter_.correct_leds(leds_, errors_.cov());
  filter_.reset(t, x, cov);
}

double RelativeEstimator::rest_rms_max_px(const Pose& X_NB) const {
  return std::max(config_.reprojection_max_px, placed_rms_max_px(X_NB));
}

bool RelativeEstimator::believable_on_floor(const FoundLeds& found) {
  const Pose& X_NB = found.fit.X_NB;
  return found.frame.led_count() >= config_.search_leds &&
         X_NB.linear()(2, 2) > std::cos(config_.floor_tilt_deg * kDegree) &&
         X_NB.translation().z() < config_.floor_height_m && confirmed(X_NB);
}

bool RelativeEstimator::start_at_rest(BlobSpan blobs, Time t, int leds_least,
                                      FrameReport& out) {
  if (!config_.tell_apart || !config_.calibrate_at_rest) return false;
  LedFrame frame;
  const BlobSpan alone = without_twins(blobs);
  auto fit = find_at_rest(alone, leds_least, frame);
  const bool twins = !fit;
  if (twins && alone.size() < blobs.size())
    fit = find_at_rest(blobs, leds_least, frame);
  if (!fit) return false;
  ignores_twins_ = !twins;
  frame.t = t;
  take_rest(*fit, static_cast<int>(frame.seen.size()), t);
  FoundLeds found;
  found.frame = frame;
  found.fit.X_NB = fit->X_NB;
  found.fit.rms_px = fit->rms_px;
  fresh_ = found_again_ = false;
  usual_misfit_ = 0;
  start_from(found, t, out);
  return true;
}

Result<RestFit> RelativeEstimator::find_at_rest(BlobSpan blobs, int leds_least,
                                                LedFrame& frame) const {
  const LedImages images = led_images(camera_written_, leds_written_, X_NB_expected_);
  const double reach_px =
      images.size_px + kRestReach * config_.rest.place_sd_m *
                           camera_written_.intrinsics.fx /
                           lens_distance(X_NB_expected_.translation());
  FixedVector<RestLight, kMaxRestLights> lights;
  FixedVector<int, kMaxRestLights> blob_of;
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    const Blob& blob = blobs[j];
    if ((blob.uv - images.middle).norm() > reach_px) continue;
    RestLight light{blob.uv, 0};
    for (int i = 0; i < leds_.size(); ++i) {
      const bool may_be =
          !config_.finder.use_color || colors_agree(blob.color, leds_.color(i), true);
      light.may_be = static_cast<std::uint16_t>(light.may_be | may_be << i);
    }
    if (blob.cut || light.may_be == 0) continue;
    if (!lights.push_back(light)) return fail(Fault::ambiguous);
    blob_of.push_back(static_cast<int>(j));
  }
  const auto associated = [&](const RestCalibrationConfig& config) {
    return associate_at_rest(config, camera_written_, leds_written_,
                             {lights.data(), lights.size()}, X_NB_expected_,
                             leds_least);
  };
  auto found = associated(doubted(config_.rest));
  if (!found) found = associated(config_.rest);
  if (!found) return fail(found.error());
  Assignment match;
  for (std::size_t i = 0; i < kMaxLeds; ++i) {
    const int light = (*found)[i];
    if (light >= 0) match.blob[i] = blob_of[static_cast<std::size_t>(light)];
  }
  frame.seen = observations(match, images, blobs, 0);
  return measure_at_rest(config_.rest, camera_written_, leds_written_,
                         {frame.seen.data(), frame.seen.size()}, X_NB_expected_);
}

Result<FoundLeds> RelativeEstimator::find_expected(BlobSpan blobs, Time t,
                                                   const Pose& X_NB,
                                                   const Matrix6& cov) const {
  const Matrix6 information = cov_expected_.inverse();
  const auto fit_of = [&](const LedFrame& frame) {
    FixedVector<LedObservation, kMaxLeds> seen = frame.seen;
    // By the lens what LEDs are off by is far more than what pictures are: without it
    // the fit would turn the drone over to explain it.
    const double off_px = config_.rest.led_sd_m * camera_.intrinsics.fx /
                          lens_distance(X_NB_expected_.translation());
    for (LedObservation& o : seen) o.cov += off_px * off_px * Matrix2::Identity();
    return refine_pose(camera_, leds_, {seen.data(), seen.size()}, X_NB_expected_,
                       &information);
  };
  FoundLeds found;
  found.frame = tracker_.track(blobs, X_NB, cov, t);
  auto fit = fit_of(found.frame);
  if (fit && found.frame.led_count() < leds_.size()) {
    // Where those stand, others may be that are far from where they were expected.
    LedFrame again = tracker_.track(blobs, fit->X_NB, fit->cov, t);
    if (again.led_count() > found.frame.led_count()) {
      found.frame = again;
      fit = fit_of(found.frame);
    }
  }
  if (found.frame.led_count() < std::max(4, leds_.size() - 1)) {
    return fail(Fault::too_few_points);
  }
  if (!fit) return fail(fit.error());
  if (fit->rms_px > rest_rms_max_px(fit->X_NB)) return fail(Fault::degenerate);
  if (!stands_as_expected(fit->X_NB)) return fail(Fault::ambiguous);
  found.fit = *fit;
  return found;
}

bool RelativeEstimator::stands_as_expected(const Pose& X_NB) const {
  Vector6 off;
  off << X_NB.translation() - X_NB_expected_.translation(),
      so3_log(X_NB_expected_.linear().transpose() * X_NB.linear());
  // Six degrees of freedom: beyond this the drone stands elsewhere.
  return off.dot(cov_expected_.llt().solve(off)) < 22.5;
}

}  // namespace alight
