#include "alight/mission/relative_estimator.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "alight/geometry/row_delay.h"

namespace alight {
namespace {

constexpr double kAnyFit = 1e9;  // px
// Few lights fit anywhere; they are LEDs only as near to where these are expected as
// chance lets them be: 999 of 1000 by chi-square of 6 degrees of freedom.
constexpr double kMovedMost = 22.5;
constexpr double kNearestLens = 0.1;  // m
constexpr double kSoundNis = 2;       // mean NIS of LEDs seen well, 1 by the model
constexpr double kUsualMemory = 20;   // fits
constexpr int kMisfits = 10;          // pictures in a row that show LEDs to be off
// With no more than these there is little misfit, wherever the LEDs are,
constexpr int kFewLeds = 3;
// and with a misfit of more than this, px, they tell another pose than more do.
constexpr double kJumpPx = 1;
// Unseen for so long, be it that no picture came, the drone may not be where the
// prediction has it.
constexpr Seconds kLongUnseen = 0.15;
// Standard deviation of the place from which a prediction does not tell LEDs from
// lamps, and of one up to which what is not there is not elsewhere but hidden.
constexpr double kVaguePlace_m = 0.15, kClosePlace_m = 0.02;
constexpr double kAround_px = 15;  // of the LEDs, where lamps may hide them
// A velocity of longer ago says little of what the drone does by now.
constexpr Time kReckonedBack = 250'000'000;  // ns
// Pictures in a row in which one LED contradicts the others and is not believed.
constexpr int kContradictions = 20;
// Pictures after which a drone at rest of which an LED was missing is looked at anew.
constexpr unsigned kLookAgainEvery = 8;
// So many pictures in a row, each another than the one before: the camera has noise, or
// what it sees moves. More than a drone that was put down takes to come to rest.
constexpr int kNoisyPictures = 30;
// m/s, and sd of what is known of it: so fast it is seen to move.
constexpr double kMoves = 0.05, kMovesSds = 3;
constexpr int kAroundRoi_px = 24;  // that fits to lights in it look at

Roi grown(const Roi& roi, int px) {
  return {roi.u0 - px, roi.v0 - px, roi.u1 + px, roi.v1 + px};
}

}  // namespace

PredictionInput NoMotion::at(Time t, const RelativeState&) const {
  PredictionInput input;
  input.platform.t = t;
  input.f_N = Vector3(0, 0, kGravity);
  return input;
}

RelativeEstimator::RelativeEstimator(const RelativeEstimatorConfig& config,
                                     const Rig& rig, BlobDetector detector,
                                     LedFinder finder, LedTracker tracker,
                                     LedResolver resolver, RelativeFilter filter)
    : config_(config),
      step_(from_seconds(config.prediction_step_ms * 1e-3)),
      camera_(rig.camera),
      leds_(rig.leds),
      camera_written_(rig.camera),
      leds_written_(rig.leds),
      mosaic_(rig.mosaic),
      exposure_(rig.timing.exposure_ms * 1e-3),
      readout_(rig.timing.readout_ms * 1e-3),
      linear_(rig.camera.intrinsics.width, rig.camera.intrinsics.height,
              rig.gamma > 0 ? rig.gamma : 1),
      detector_(std::move(detector)),
      finder_(std::move(finder)),
      tracker_(std::move(tracker)),
      resolver_(std::move(resolver)),
      filter_(std::move(filter)),
      rivals_(config.rivals, rig.camera, filter_),
      doubt_(config.doubt),
      errors_(config.errors, rig.leds, std::max(config.filter.led_position_sd_m, 1e-4)),
      learner_(config.learner, rig.camera, rig.leds),
      mirror_(rig.camera, rig.pad.size_m) {
  if (rig.gamma > 0) config_.learn_gamma = false;
  if (config.learn_led_errors) filter_.correct_leds(errors_.leds(), errors_.cov());
}

Result<RelativeEstimator> RelativeEstimator::create(
    const RelativeEstimatorConfig& config, const Rig& rig) {
  if (auto good = rig.validate(); !good) return fail(good.error());
  if (auto good = config.validate(); !good) return fail(good.error());
  auto detector = BlobDetector::create(config.blobs, rig.camera.intrinsics.width,
                                       rig.camera.intrinsics.height);
  if (!detector) return fail(detector.error());
  auto finder = LedFinder::create(config.finder, rig.camera, rig.leds, rig.pad.size_m);
  if (!finder) return fail(finder.error());
  auto tracker = LedTracker::create(config.tracker, rig.camera, rig.leds);
  if (!tracker) return fail(tracker.error());
  auto resolver = LedResolver::create(config.resolver, rig.camera, rig.leds);
  if (!resolver) return fail(resolver.error());
  RelativeFilterConfig filtering = config.filter;
  if (config.tell_led_frame) filtering.led_frame = rig.led_frame;
  auto filter = RelativeFilter::create(filtering, rig.camera, rig.leds);
  if (!filter) return fail(filter.error());
  return RelativeEstimator(config, rig, std::move(*detector), std::move(*finder),
                           std::move(*tracker), std::move(*resolver),
                           std::move(*filter));
}

void RelativeEstimator::advance(Time t, const MotionSource& motion) {
  if (!filter_.initialized() || t <= filter_.time()) return;
  const auto done = filter_.predict_through(
      t, step_, [&](Time at) { return motion.at(at, filter_.state()); });
  if (!done) filter_.stop();
}

void RelativeEstimator::reckon(Time t, const Vector3& v_NB,
                               const MotionSource& motion) {
  if (!filter_.initialized() || t < filter_.time() - kReckonedBack) return;
  advance(t, motion);
  const MotionState since =
      carried_on(filter_.motion_state(), t, filter_.time(), motion);
  const Vector3 gained = since.x.v_NB - filter_.state().v_NB;
  filter_.update_velocity(v_NB + gained, config_.reckoned_sd_m_s);
}

bool RelativeEstimator::fuse(const CameraFrame& given, const MotionSource& motion,
                             FrameReport& out, Probe* probe) {
  CameraFrame frame = given;
  frame.color.mosaic = frame.color.channels == 3 ? mosaic_ : Mosaic::none;
  out = FrameReport{};
  out.t = frame.captured;
  if (frame.captured <= last_frame_) {
    out.why_not = "not newer than the last picture";
    return false;
  }
  if (!detector_.takes(frame.color, frame.depth)) {
    out.why_not = "the picture is damaged";
    return false;
  }
  last_frame_ = frame.captured;
  if (filter_.initialized() && frame.captured < filter_.time()) {
    out.why_not = "older than what the autopilot has told since";
    return true;
  }

  if (config_.heed_noise) {
    noise_ = picture_noise(frame.color);
    set_noise();
  }
  if (config_.frozen_pictures > 0) {
    const int alike = repeat_.look(frame.color);
    unlike_ = alike > 1 ? 0 : unlike_ + 1;
    noisy_ = noisy_ || unlike_ >= kNoisyPictures;
    repeats_ = alike >= config_.frozen_pictures;
  }
  // A camera without noise sees the same again and again while nothing moves.
  const bool flies = config_.told_when_it_rests ? !expecting_ && !on_floor_ : moves();
  frozen_ = repeats_ && (flies || noisy_);
  const bool held = frozen_ && config_.coast_s <= 0;
  if (filter_.initialized()) {
    const ProbeScope scope(probe, Stage::filter);
    // What is no sight leaves the filter to what the autopilot tells, if it does.
    if (!held) advance(frame.captured, motion);
    if (to_seconds(frame.captured - last_sight_) > config_.forget_after_s) {
      filter_.stop();
    }
  }
  lift_N_ = motion.at(frame.captured, filter_.state()).lift_N;

  if (!frozen_) shift_to_drone(frame.captured, motion);
  if (frozen_) {
    ++misses_;
    out.why_not = "the camera repeats its picture";
  } else if (filter_.initialized()) {
    // Just found, a prediction without speed says little of where LEDs are next.
    fresh_ = fresh_ && filter_.velocity_sd() > config_.known_sd_m_s;
    const bool lost = missed(frame.captured);
    sure_ = sure_ && !lost;
    if (lost && taken_up_ == 0 && config_.tell_apart) before_taken_up_ = filter_;
    const bool followed = follow(frame, out, probe);
    if (followed && lost && to_be_confirmed()) {
      ++taken_up_;
      out.tracked = false;
      out.why_not = "too few LEDs to be sure at once";
    } else if (followed) {
      taken_up_ = 0;
      misses_ = 0;
      if (out.tracked && seen_soundly()) sound_ = filter_;
      if (!contradicted(frame, out, probe)) {
        confirmations_ = 0;
        doubt(out);
      }
    } else if (++misses_; fresh_ || missed(frame.captured)) {
      if (taken_up_ > 0) {
        // They were none: the prediction goes on as if they had not been seen.
        taken_up_ = 0;
        go_back_to(*before_taken_up_, frame.captured, motion);
      } else if (misses_ == config_.misses_before_search && sound_ &&
                 to_seconds(last_sight_ - sound_->time()) < config_.sound_s) {
        // What hides LEDs one by one first hides parts of them.
        go_back_to(*sound_, frame.captured, motion);
      }
      search_either_way(frame, motion, out, probe);
    }
  } else {
    search_either_way(frame, motion, out, probe);
  }
  if (!frozen_) shift_back(frame.captured, motion);
  if (config_.learn_gamma && !frozen_) learn_gamma(frame.color, out);
  if (out.tracked) {
    last_sight_ = frame.captured;
  } else if (coasts(frame.captured)) {
    out.tracked = true;
    out.why_not = "";
  }
  if (out.tracked && doubt_.open()) {
    out.tracked = false;
    out.why_not = "two poses explain the pictures";
  }
  if (filter_.initialized() && !held) report_state(out);
  // A drone that stands where it is known to stand tells more of its rig than that.
  // The first pictures' noise looks like LEDs that are off.
  const bool off = filter_.led_sd_seen_m() > config_.learn_leds_from_m;
  misfits_ = off ? misfits_ + 1 : 0;
  learning_ = learning_ || (config_.learn_leds && !expecting_ && misfits_ >= kMisfits);
  if (config_.frozen_pictures > 0) {
    FixedVector<Vector2, kMaxLeds> leds_px;
    if (out.tracked) {
      for (const LedUse& use : out.leds) leds_px.push_back(use.observation.uv);
    }
    repeat_.found(frame.color, {leds_px.data(), leds_px.size()});
  }
  if (out.tracked && config_.told_sd_m > 0 && !expecting_) {
    // Far away it is vague by LEDs that are off, however well it is followed.
    const bool sure = seen_.size() >= PoseDoubt::kFew && exact(out.reprojection_px);
    out.tracked = largest_sd(out.cov.block<3, 3>(0, 0)) < config_.told_sd_m &&
                  largest_sd(out.cov.block<3, 3>(3, 3)) < config_.told_sd_deg * kDegree;
    if (!out.tracked) out.why_not = "followed, but not known well enough to be told";
    if (out.tracked || sure) last_told_ = frame.captured;
    if (to_seconds(frame.captured - last_told_) > config_.forget_after_s) begin_anew();
  }
  return true;
}

void RelativeEstimator::set_noise() {
  const PictureNoise noise = linear_.of(noise_);
  detector_.set_noise(noise);
  resolver_.set_noise(noise);
}

bool RelativeEstimator::unseen_for_long(Time t) const {
  return to_seconds(t - last_sight_) > kLongUnseen;
}

bool RelativeEstimator::coasts(Time t) const {
  return to_seconds(t - last_sight_) < config_.coast_s && filter_.initialized() &&
         !expecting_ && !fresh_ && well_known();
}

bool RelativeEstimator::moves() const {
  return filter_.initialized() &&
         filter_.state().v_NB.norm() >
             std::max(kMoves, kMovesSds * filter_.velocity_sd());
}

bool RelativeEstimator::missed(Time t) const {
  return misses_ >= config_.misses_before_search || unseen_for_long(t);
}

bool RelativeEstimator::to_be_confirmed() const {
  if (!config_.tell_apart || taken_up_ >= config_.search_confirmations - 1)
    return false;
  // Of lamps in a row five lie like those of six LEDs, somewhere within half a metre.
  const bool vague = before_taken_up_->position_sd() > kVaguePlace_m;
  return filter_.last_report().used < config_.search_leds + (vague ? 1 : 0);
}

bool RelativeEstimator::no_doubt(const FrameReport& out) const {
  return out.tracked && seen_alone_ >= kTellingLeds && exact(out.reprojection_px);
}

bool RelativeEstimator::seen_soundly() const {
  const UpdateReport& report = filter_.last_report();
  double nis = 0;
  for (const ObservationReport& o : report.seen) nis += o.nis;
  return config_.tell_apart && report.used >= config_.sound_leds &&
         nis < kSoundNis * 2 * report.used && resolver_.whole();
}

void RelativeEstimator::go_back_to(const RelativeFilter& then, Time t,
                                   const MotionSource& motion) {
  filter_ = then;
  // LEDs have been learnt since.
  if (config_.learn_led_errors) {
    filter_.correct_leds(leds_, errors_.cov());
  } else if (learning_) {
    filter_.correct_leds(leds_, learner_.cov());
  }
  const auto done = filter_.predict_through(
      t, step_, [&](Time at) { return motion.at(at, filter_.state()); });
  if (!done) filter_.stop();
}

void RelativeEstimator::forget_past() {
  sound_.reset();
  before_taken_up_.reset();
  taken_up_ = 0;
}

bool RelativeEstimator::follow(const CameraFrame& stored, FrameReport& out,
                               Probe* probe) {
  const Roi roi = tracker_.roi(filter_.state().X_NB(),
                               filter_.tracking_covariance().topLeftCorner<6, 6>());
  if (roi.empty()) {
    out.why_not = "expected outside the picture";
    return false;
  }
  CameraFrame frame = stored;
  Result<BlobSpan> blobs = fail(Fault::invalid_input);
  {
    const ProbeScope scope(probe, Stage::detect);
    frame.color = linear_.of(stored.color, grown(roi, kAroundRoi_px));
    blobs = detector_.detect(frame.color, frame.depth, roi);
  }
  if (!blobs) {
    out.why_not = "the picture cannot be read";
    return false;
  }
  out.blobs = static_cast<int>(blobs->size());
  if (expecting_ && ignores_twins_) *blobs = without_twins(*blobs);
  if (!config_.tell_apart) return follow_among(*blobs, frame, out, probe);
  if (rig_measured_ && expecting_ && rest_leds_ < leds_.size() &&
      ++incomplete_ % kLookAgainEvery == 0 &&
      start_at_rest(*blobs, frame.captured, rest_leds_ + 1, out)) {
    return true;
  }
  if (expecting_ && !stands_as_expected(filter_.state().X_NB())) {
    // Most LEDs of a rig that is off may fit a drone that stands otherwise better.
    const auto expected =
        find_expected(*blobs, frame.captured, X_NB_expected_, cov_expected_);
    if (expected && expected->frame.led_count() > filter_.last_report().used) {
      go_on_from(*expected, frame.captured, out);
      return out.tracked;
    }
  }
  const BlobSpan marked = strays_.mark(*blobs, frame.captured);
  if (!follow_among(marked, frame, out, probe)) return false;
  const bool no_doubt = this->no_doubt(out);
  if (no_doubt) {
    sure_ = true;
    beyond_doubt_ = Seen{filter_.state().X_NB(), frame.captured};
  }
  strays_.remember(marked, led_images(camera_, leds_, filter_.state().X_NB()), no_doubt,
                   frame.captured);
  return true;
}

bool RelativeEstimator::follow_among(BlobSpan blobs, const CameraFrame& frame,
                                     FrameReport& out, Probe* probe) {
  const Pose X_NB = filter_.state().X_NB();
  const Matrix6 cov = filter_.tracking_covariance().topLeftCorner<6, 6>();
  FixedVector<Vector2, kMaxLeds> blur;
  if (config_.tell_apart) blur = image_motion(X_NB);
  // Out of sight for a while, the prediction is vague enough for any lamp or two to
  // pass for LEDs.
  // So it is while its speed is hardly known, just after it was found again.
  found_again_ = found_again_ && filter_.velocity_sd() > config_.known_sd_m_s;
  const bool missed = found_again_ || this->missed(frame.captured);
  // Four lamps always lie as four LEDs do, somewhere within half a metre.
  const int again = missed && filter_.position_sd() > kVaguePlace_m
                        ? std::max(config_.search_leds, config_.leds_after_misses)
                        : config_.leds_after_misses;
  const auto needed = static_cast<std::size_t>(missed ? again : 0);
  const double rms_max = usual_misfit_ > 0 ? exact_px(X_NB.translation())
                         : fresh_          ? placed_rms_max_px(X_NB)
                                           : kAnyFit;
  if (config_.tell_apart && misses_ == 0 && !missed) {
    std::optional<LedFrame> leds;
    {
      const ProbeScope scope(probe, Stage::associate);
      leds = resolver_.follow(frame.color, blobs, X_NB, config_.direct_gate_px,
                              {blur.data(), blur.size()}, frame.captured);
    }
    if (leds &&
        accept(*leds, leds->seen.size(), fresh_ ? rms_max : kAnyFit, out, probe)) {
      return true;
    }
  }
  std::optional<LedFrame> held;
  bool hidden = false;
  if (config_.tell_apart) {
    const ProbeScope scope(probe, Stage::associate);
    held = resolver_.hold(frame.color, blobs, X_NB, cov,
                          3 * usual_rms_px(X_NB.translation()),
                          {blur.data(), blur.size()}, frame.captured);
    hidden = filter_.position_sd() < kClosePlace_m && held->seen.empty() &&
             among_lamps(*held, X_NB);
    if (held->seen.size() < needed) held.reset();
  }
  const auto accept_held = [&] {
    return held && !held->seen.empty() &&
           accept(*held, held->seen.size(), fresh_ ? rms_max : kAnyFit, out, probe);
  };
  // With fewer the tracker may do better.
  if (held && held->seen.size() >= config_.held_leds) {
    const bool enough = accept_held();
    // Once fused, there is nothing left to fuse, be it enough for a pose or not.
    if (enough || filter_.last_update() == frame.captured) return enough;
    held.reset();
  }
  // Among many lights some lie as LEDs would by chance.
  if (missed && out.blobs > config_.lights_after_misses * leds_.size()) {
    out.why_not = "too many lights to be sure";
    return false;
  }
  LedFrame leds;
  int by_blobs = 0;  // LEDs that the tracker saw; dim ones beside them prove nothing
  {
    const ProbeScope scope(probe, Stage::associate);
    TrackDetail detail;
    leds = tracker_.track(blobs, X_NB, cov, frame.captured, &detail);
    by_blobs = leds.led_count();
    if (config_.tell_apart && !leds.seen.empty()) {
      resolver_.resolve(frame.color, blobs, detail, {blur.data(), blur.size()}, leds);
    }
  }
  // What the tracker sees of so few is made of the lamps that hide them.
  if (hidden && leds.seen.size() < 3) {
    out.why_not = "no LED where one is expected";
    return false;
  }
  if (held && held->seen.size() >= leds.seen.size()) {
    const bool enough = accept_held();
    if (enough || filter_.last_update() == frame.captured) return enough;
    held.reset();
  }
  if (missed && (by_blobs < again || !accept(leds, needed, rms_max, out, probe))) {
    out.why_not = "too few LEDs to be sure";
    return false;
  }
  if (missed || accept(leds, 0, rms_max, out, probe)) return true;
  return filter_.last_update() != frame.captured && accept_held();
}

bool RelativeEstimator::among_lamps(const LedFrame& seen, const Pose& X_NB) const {
  const LedImages images = led_images(camera_, leds_, X_NB);
  const auto near = [&](const RefusedBlob& blob) {
    return (blob.uv - images.middle).norm() < images.size_px + kAround_px;
  };
  return std::any_of(seen.refused.begin(), seen.refused.end(), near);
}

double RelativeEstimator::lens_distance(const Vector3& p_NB) const {
  return std::max((p_NB - camera_.X_NC.translation()).norm(), kNearestLens);
}

double RelativeEstimator::usual_rms_px(const Vector3& p_NB) const {
  return usual_misfit_ / lens_distance(p_NB);
}

double RelativeEstimator::exact_px(const Vector3& p_NB) const {
  return std::max(config_.search_rms_px,
                  config_.search_rms_factor * usual_rms_px(p_NB));
}

double RelativeEstimator::misfit_max_px() const {
  // By few pictures it is not known how well LEDs fit.
  if (!config_.tell_apart || fits_ < kUsualMemory) return 0;
  return std::max(config_.search_rms_px, config_.search_rms_factor * misfit_ /
                                             lens_distance(filter_.state().p_NB));
}

bool RelativeEstimator::well_known() const {
  const auto P = filter_.tracking_covariance();
  const double p_sd = std::sqrt(P.topLeftCorner<3, 3>().trace());
  const double turn_sd = std::sqrt(P.block<3, 3>(3, 3).trace());
  return p_sd < config_.known_sd_m && turn_sd < config_.known_sd_deg * kDegree;
}

bool RelativeEstimator::accept(const LedFrame& given, std::size_t agreeing,
                               double rms_max_px, FrameReport& out, Probe* probe) {
  const ProbeScope scope(probe, Stage::filter);
  std::optional<LedFrame> at_once;
  if (readout_ > 0) at_once = seen_at_once(given);
  const LedFrame& leds = at_once ? *at_once : given;
  if (would_jump(leds)) {
    out.why_not = "too few LEDs are left for a rig that is this far off";
    return false;
  }
  const bool lost = unseen_for_long(leds.t);
  const bool vague = (lost || misses_ > 0) && leds.led_count() < config_.search_leds;
  if (rms_max_px < kAnyFit || lost || vague) before_update_ = filter_;
  LedInformation told;
  // Lights that are yet to be confirmed may be none of its LEDs: they teach nothing.
  const bool known = !missed(leds.t);
  const bool teaches = !expecting_ && known;
  const bool telling = config_.learn_led_errors && teaches;
  // What goes on contradicting is no lamp that passes, but LEDs that are off.
  const double most_px = expecting_ ? 0 : misfit_max_px();
  const bool strict = contradictions_ < kContradictions;
  auto report =
      filter_.update(leds, agreeing, telling ? &told : nullptr, strict ? most_px : 0);
  if (report &&
      (report->reprojection_px > rms_max_px || (vague && report->moved > kMovedMost) ||
       (lost && !leans_as_known(filter_.state().R_NB)))) {
    filter_ = *before_update_;
    report = fail(Fault::ambiguous);
  }
  if (!report && agreeing > 0) return false;
  seen_.clear();
  for (const LedObservation& o : leds.seen) {
    if (std::has_single_bit(o.leds)) seen_.push_back(o);
  }
  seen_alone_ = seen_.size();
  for (const OverlappingLeds& group : leds.groups) {
    seen_alone_ -= static_cast<std::size_t>(group.count);
  }
  if (expecting_) remember_rest(leds);
  out.refused = leds.refused;
  if (!report) {
    out.why_not = leds.seen.empty() ? "no LED where one is expected"
                                    : "picture and prediction contradict each other";
    return false;
  }
  // What LEDs are off by does not average out as the filter takes it to: told with each
  // picture, how it stands weighs against it what it weighs in one.
  if (expecting_ && config_.tell_apart && stands_as_expected(filter_.state().X_NB())) {
    filter_.update_pose(X_NB_rest_, cov_expected_);
  }
  const auto contradicts = [](const RefusedBlob& blob) {
    return blob.reason == Refusal::off_constellation;
  };
  const bool misfits =
      report->contradicts || (!strict && report->reprojection_px > most_px) ||
      std::any_of(report->refused.begin(), report->refused.end(), contradicts);
  if (known) contradictions_ = misfits ? contradictions_ + 1 : 0;
  for (const ObservationReport& seen : report->seen) {
    LedUse use;
    use.observation.leds = seen.leds;
    use.observation.uv = seen.uv;
    for (std::size_t k = 0; at_once && k < given.seen.size(); ++k) {
      if (given.seen[k].leds == seen.leds) use.observation.uv = given.seen[k].uv;
    }
    use.nis = seen.nis;
    out.leds.push_back(use);
  }
  for (const RefusedBlob& refused : report->refused) out.refused.push_back(refused);
  out.reprojection_px = report->reprojection_px;
  // Fewer than three directions leave the pose to the prediction.
  const double worst_px = expecting_ ? rest_rms_max_px(filter_.state().X_NB())
                                     : config_.reprojection_max_px;
  out.tracked =
      report->reprojection_px < worst_px &&
      ((report->used >= 3 && !fresh_) || (config_.tell_apart && well_known()));
  if (!out.tracked) out.why_not = "too few LEDs fit";
  if (out.tracked && known) remember_fit(leds.led_count(), out.reprojection_px);
  if (out.tracked && known && static_cast<std::size_t>(report->used) >= kTellingLeds) {
    const double misfit = report->reprojection_px * lens_distance(filter_.state().p_NB);
    usual_misfit_ +=
        usual_misfit_ > 0 ? (misfit - usual_misfit_) / kUsualMemory : misfit;
    usual_misfit_ = std::max(usual_misfit_, misfit_least_);
    fits_ = std::min(fits_ + 1, kUsualMemory);
    misfit_ += (misfit - misfit_) / fits_;
  }
  if (out.tracked && config_.learn_leds && teaches) learn_leds(leds, *report);
  if (out.tracked && telling && !report->contradicts &&
      static_cast<std::size_t>(leds.led_count()) >= kTellingLeds) {
    learn_led_errors(told, leds.t);
  }
  return out.tracked;
}

void RelativeEstimator::remember_fit(int leds, double rms_px) {
  fitted_leds_ = leds;
  if (leds <= kFewLeds) return;
  // LEDs that are off misfit in every picture, what was taken for one in a single one.
  const double misfit = rms_px * lens_distance(filter_.state().p_NB);
  fitted_misfit_ = std::min(misfit, last_misfit_);
  last_misfit_ = misfit;
}

// What the pose owes to LEDs that are not where the rig says changes as they leave the
// picture one by one: a jump that the filter would take for speed.
bool RelativeEstimator::would_jump(const LedFrame& leds) const {
  const int count = leds.led_count();
  return config_.tell_apart && !expecting_ && count < fitted_leds_ &&
         count < static_cast<int>(kTellingLeds) &&
         fitted_misfit_ > kJumpPx * lens_distance(filter_.state().p_NB);
}

void RelativeEstimator::begin_anew() {
  learner_.forget();
  leds_ = learner_.leds();
  filter_.set_rig(camera_, leds_, config_.filter.led_position_sd_m);
  tracker_.set_rig(camera_, leds_, config_.tracker.led_sd_m);
  resolver_.set_rig(camera_, leds_);
  errors_.forget();
  if (config_.learn_led_errors) filter_.correct_leds(leds_, errors_.cov());
  leds_moved_ = true;
  learning_ = false;
  forget_past();
  usual_misfit_ = 0;
  remember_fit(0, 0);
}

FixedVector<Vector2, kMaxLeds> RelativeEstimator::image_motion(const Pose& X_NB) const {
  FixedVector<Vector2, kMaxLeds> out;
  for (int i = 0; i < leds_.size(); ++i) {
    Matrix26 J;
    Vector2 way = Vector2::Zero();
    if (project_led(camera_, X_NB, leds_.p_BL(i), &J)) {
      way = exposure_ * (J.leftCols<3>() * filter_.state().v_NB);
    }
    out.push_back(way);
  }
  return out;
}

Seconds RelativeEstimator::delay_of(const Pose& X_NB) const {
  const int height = camera_.intrinsics.height;
  const LedImages images = led_images(camera_, leds_, X_NB);
  if (images.count == 0) return 0;
  return row_delay(std::clamp(images.middle.y(), 0.0, height - 1.0), height, readout_);
}

void RelativeEstimator::shift_to_drone(Time t, const MotionSource& motion) {
  delay_ = 0;
  if (readout_ <= 0 || !filter_.initialized()) return;
  const PredictionInput input = motion.at(t, filter_.state());
  delay_ = delay_of(filter_.state().X_NB());
  w_NB_B_ = filter_.turn_rate(input);
  filter_.shift(delay_, input);
}

void RelativeEstimator::shift_back(Time t, const MotionSource& motion) {
  if (readout_ <= 0 || !filter_.initialized()) return;
  // A drone just found may be elsewhere than it was expected.
  filter_.shift(-delay_of(filter_.state().X_NB()), motion.at(t, filter_.state()));
}

LedFrame RelativeEstimator::seen_at_once(const LedFrame& leds) const {
  LedFrame out = leds;
  if (readout_ <= 0) return out;
  const RelativeState& x = filter_.state();
  for (LedObservation& o : out.seen) {
    Matrix26 J;
    if (!project_observation(camera_, x.X_NB(), leds_, o.leds, &J)) continue;
    const Seconds later =
        row_delay(o.uv.y(), camera_.intrinsics.height, readout_) - delay_;
    o.uv -= later * (J.leftCols<3>() * x.v_NB + J.rightCols<3>() * w_NB_B_);
  }
  return out;
}

void RelativeEstimator::expect(const Pose& X_NB, const Matrix6& cov) {
  expecting_ = true;
  ignores_twins_ = false;
  X_NB_expected_ = X_NB_rest_ = X_NB;
  cov_expected_ = cov;
  rest_images_.forget();
}

void RelativeEstimator::report_state(FrameReport& out) const {
  out.x = filter_.state();
  out.cov = filter_.covariance();
}

MotionState RelativeEstimator::carried_to(Time t, const MotionSource& motion,
                                          Covariance9* cov) const {
  if (cov == nullptr) {
    return carried_on(filter_.motion_state(), filter_.time(), t, motion);
  }
  RelativeFilter ahead = filter_;
  (void)ahead.predict_through(t, 2 * step_,
                              [&](Time at) { return motion.at(at, ahead.state()); });
  *cov = ahead.covariance();
  return ahead.motion_state();
}

MotionState RelativeEstimator::carried_on(MotionState from, Time t_from, Time t,
                                          const MotionSource& motion) const {
  while (t_from < t) {
    const Time next = std::min(t, t_from + step_);
    from = extrapolate(from, motion.at(t_from, from.x), to_seconds(next - t_from),
                       config_.filter.motion());
    t_from = next;
  }
  return from;
}

void RelativeEstimator::restart_disturbance(const Vector3& d_N, const Vector3& b_N) {
  if (!filter_.initialized()) return;
  forget_past();
  filter_.restart_disturbance(d_N, b_N);
}

}  // namespace alight
