#include "alight/mission/relative_estimator.h"

#include <Eigen/Eigenvalues>
#include <bit>
#include <cmath>

namespace alight {
namespace {

constexpr double kAnyFit = 1e9;       // px
constexpr double kNearestLens = 0.1;  // m
constexpr double kUsualMemory = 20;   // fits
constexpr int kLearnerSteps = 2;      // for each picture that it keeps
// LEDs taken for others may fit this much worse than the best answer and still be
// right.
constexpr double kRivalRms = 3;
// So many LEDs leave more of their images' errors than the pose takes up by chance.
constexpr std::size_t kTellingLeds = 5;
// With no more than these there is little misfit, wherever the LEDs are,
constexpr int kFewLeds = 3;
// and with a misfit of more than this, px, they tell another pose than more do.
constexpr double kJumpPx = 1;
// So many lights in the colours of their LEDs are no lamps.
constexpr int kColored = 3;
// Pictures in a row with LEDs missing after which the whole picture is searched for a
// pose that explains more: then, after twice as many, and so on, at last after every so
// many.
constexpr unsigned kDoubtAfter = 4, kDoubtEvery = 256;
// Unseen for so long, be it that no picture came, the drone may not be where the
// prediction has it.
constexpr Seconds kLongUnseen = 0.15;
// So many pictures in a row, each another than the one before: the camera has noise, or
// what it sees moves. More than a drone that was put down takes to come to rest.
constexpr int kNoisyPictures = 30;

Covariance9 covariance_of(const PoseFit& fit, double velocity_sd) {
  Covariance9 cov = Covariance9::Zero();
  cov.topLeftCorner<6, 6>() = fit.cov;
  cov.topLeftCorner<3, 3>().diagonal().array() += 1e-8;
  cov.block<3, 3>(3, 3).diagonal().array() += 1e-7;
  cov.bottomRightCorner<3, 3>().diagonal().setConstant(velocity_sd * velocity_sd);
  return cov;
}

double largest_sd(const Matrix3& cov) {
  Eigen::SelfAdjointEigenSolver<Matrix3> solver;
  solver.computeDirect(cov, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

bool near(const Pose& a, const Pose& b, double distance, double turn) {
  return (a.translation() - b.translation()).norm() < distance &&
         so3_log(a.linear().transpose() * b.linear()).norm() < turn;
}

}  // namespace

Result<void> RelativeEstimatorConfig::validate() const {
  if (auto good = blobs.validate(); !good) return good;
  if (auto good = finder.validate(); !good) return good;
  if (auto good = tracker.validate(); !good) return good;
  if (auto good = resolver.validate(); !good) return good;
  if (auto good = filter.validate(); !good) return good;
  if (auto good = rest.validate(); !good) return good;
  if (auto good = learner.validate(); !good) return good;
  if (!(prediction_step_ms >= 1 && prediction_step_ms <= 50)) {
    return fail(Fault::invalid_config, "prediction_step_ms must lie in [1, 50]");
  }
  if (frozen_pictures < 0 || frozen_pictures == 1) {
    return fail(Fault::invalid_config, "frozen_pictures must be 0 or at least 2");
  }
  if (misses_before_search < 1) {
    return fail(Fault::invalid_config, "misses_before_search must be at least 1");
  }
  if (!(forget_after_s > 0 && reprojection_max_px > 0 && search_gate_m >= 0)) {
    return fail(
        Fault::invalid_config,
        "forget_after_s, reprojection_max_px and search_gate_m must be positive");
  }
  if (!(told_sd_m >= 0 && told_sd_deg >= 0)) {
    return fail(Fault::invalid_config,
                "told_sd_m and told_sd_deg must not be negative");
  }
  if (!(placed_sd_px > 0 && placed_sds > 0)) {
    return fail(Fault::invalid_config, "placed_sd_px and placed_sds must be positive");
  }
  return {};
}

RelativeEstimatorConfig RelativeEstimatorConfig::paper() {
  RelativeEstimatorConfig config;
  config.blobs.smooth = true;
  config.blobs.depth_threshold_m = 2.5;  // the effective landing distance
  config.blobs.grey_threshold = 150;     // its initialization bears no mirror image
  config.blobs.dim_threshold = 0;
  config.finder.profile = LedFinderConfig::Profile::paper;
  config.tracker.profile = LedTrackerConfig::Profile::paper;
  config.filter = RelativeFilterConfig::paper();
  config.reprojection_max_px = 10;
  config.calibrate_at_rest = false;
  config.tell_apart = false;
  config.keep_rivals = false;
  return config;
}

RelativeEstimatorConfig RelativeEstimatorConfig::camera_only() {
  RelativeEstimatorConfig config;
  config.prediction_step_ms = 50;  // nothing happens between pictures
  config.filter = RelativeFilterConfig::camera_only();
  config.learn_leds = true;
  // Three of them lie within the limits of a wrong pose, 0.15 m and 15 deg.
  config.told_sd_m = 0.05;
  config.told_sd_deg = 5;
  config.learn_leds_from_m = 0.0008;  // what noise may feign, seen from 3 m, is less
  return config;
}

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
      exposure_(rig.timing.exposure_ms * 1e-3),
      detector_(std::move(detector)),
      finder_(std::move(finder)),
      tracker_(std::move(tracker)),
      resolver_(std::move(resolver)),
      filter_(std::move(filter)),
      rivals_(config.rivals, rig.camera, filter_),
      doubt_(config.doubt),
      learner_(config.learner, rig.camera, rig.leds) {}

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
  auto filter = RelativeFilter::create(config.filter, rig.camera, rig.leds);
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

bool RelativeEstimator::fuse(const CameraFrame& frame, const MotionSource& motion,
                             FrameReport& out, Probe* probe) {
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
  if (filter_.initialized()) {
    const ProbeScope scope(probe, Stage::filter);
    const auto done = filter_.predict_through(
        frame.captured, step_, [&](Time t) { return motion.at(t, filter_.state()); });
    if (!done || to_seconds(frame.captured - last_sight_) > config_.forget_after_s) {
      filter_.stop();
    }
  }
  last_frame_ = frame.captured;

  if (config_.frozen_pictures > 0) {
    const int alike = repeat_.look(frame.color);
    unlike_ = alike > 1 ? 0 : unlike_ + 1;
    noisy_ = noisy_ || unlike_ >= kNoisyPictures;
    repeats_ = alike >= config_.frozen_pictures;
  }
  // A camera without noise sees the same again and again while nothing moves.
  const bool flies = !expecting_ && !on_floor_;
  frozen_ = repeats_ && (flies || noisy_);
  if (frozen_) {
    ++misses_;
    out.why_not = "the camera repeats its picture";
  } else if (filter_.initialized()) {
    // Just found, a prediction without speed says little of where LEDs are next.
    fresh_ = fresh_ && filter_.velocity_sd() > config_.known_sd_m_s;
    if (follow(frame, out, probe)) {
      misses_ = 0;
      if (!contradicted(frame, out, probe)) {
        confirmations_ = 0;
        doubt(out);
      }
    } else if (++misses_ >= config_.misses_before_search || fresh_ ||
               to_seconds(frame.captured - last_sight_) > kLongUnseen) {
      search(frame, motion, out, probe);
    }
  } else {
    search(frame, motion, out, probe);
  }
  if (out.tracked) last_sight_ = frame.captured;
  if (out.tracked && doubt_.open()) {
    out.tracked = false;
    out.why_not = "two poses explain the pictures";
  }
  if (filter_.initialized()) report_state(out);
  // A drone that stands where it is known to stand tells more of its rig than that.
  learning_ = learning_ || (config_.learn_leds && !expecting_ &&
                            filter_.led_sd_seen_m() > config_.learn_leds_from_m);
  if (config_.frozen_pictures > 0) {
    FixedVector<Vector2, kMaxLeds> leds_px;
    if (out.tracked) {
      for (const LedUse& use : out.leds) leds_px.push_back(use.observation.uv);
    }
    repeat_.found(frame.color, {leds_px.data(), leds_px.size()});
  }
  if (out.tracked && config_.told_sd_m > 0 && !expecting_) {
    out.tracked = largest_sd(out.cov.block<3, 3>(0, 0)) < config_.told_sd_m &&
                  largest_sd(out.cov.block<3, 3>(3, 3)) < config_.told_sd_deg * kDegree;
    if (!out.tracked) out.why_not = "followed, but not known well enough to be told";
    if (out.tracked) last_told_ = frame.captured;
    if (to_seconds(frame.captured - last_told_) > config_.forget_after_s) begin_anew();
  }
  return true;
}

bool RelativeEstimator::follow(const CameraFrame& frame, FrameReport& out,
                               Probe* probe) {
  const Pose X_NB = filter_.state().X_NB();
  const Matrix6 cov = filter_.tracking_covariance().topLeftCorner<6, 6>();
  const Roi roi = tracker_.roi(X_NB, cov);
  if (roi.empty()) {
    out.why_not = "expected outside the picture";
    return false;
  }
  Result<BlobSpan> blobs = fail(Fault::invalid_input);
  {
    const ProbeScope scope(probe, Stage::detect);
    blobs = detector_.detect(frame.color, frame.depth, roi);
  }
  if (!blobs) {
    out.why_not = "the picture cannot be read";
    return false;
  }
  out.blobs = static_cast<int>(blobs->size());
  FixedVector<Vector2, kMaxLeds> blur;
  if (config_.tell_apart) blur = image_motion(X_NB);
  // Out of sight for a while, the prediction is vague enough for any lamp or two to
  // pass for LEDs.
  // So it is while its speed is hardly known, just after it was found again.
  found_again_ = found_again_ && filter_.velocity_sd() > config_.known_sd_m_s;
  const bool missed = misses_ >= config_.misses_before_search || found_again_ ||
                      to_seconds(frame.captured - last_sight_) > kLongUnseen;
  const auto needed = static_cast<std::size_t>(missed ? config_.leds_after_misses : 0);
  const double rms_max = usual_misfit_ > 0 ? exact_px()
                         : fresh_          ? placed_rms_max_px(X_NB)
                                           : kAnyFit;
  if (config_.tell_apart && misses_ == 0 && !missed) {
    std::optional<LedFrame> leds;
    {
      const ProbeScope scope(probe, Stage::associate);
      leds = resolver_.follow(frame.color, *blobs, X_NB, config_.direct_gate_px,
                              {blur.data(), blur.size()}, frame.captured);
    }
    if (leds &&
        accept(*leds, leds->seen.size(), fresh_ ? rms_max : kAnyFit, out, probe)) {
      return true;
    }
  }
  std::optional<LedFrame> held;
  if (config_.tell_apart) {
    const ProbeScope scope(probe, Stage::associate);
    held = resolver_.hold(frame.color, *blobs, X_NB, cov, 3 * usual_rms_px(),
                          {blur.data(), blur.size()}, frame.captured);
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
    leds = tracker_.track(*blobs, X_NB, cov, frame.captured, &detail);
    by_blobs = leds.led_count();
    if (config_.tell_apart && !leds.seen.empty()) {
      resolver_.resolve(frame.color, *blobs, detail, {blur.data(), blur.size()}, leds);
    }
  }
  if (held && held->seen.size() >= leds.seen.size()) {
    const bool enough = accept_held();
    if (enough || filter_.last_update() == frame.captured) return enough;
    held.reset();
  }
  if (missed && (by_blobs < config_.leds_after_misses ||
                 !accept(leds, needed, rms_max, out, probe))) {
    out.why_not = "too few LEDs to be sure";
    return false;
  }
  if (missed || accept(leds, 0, rms_max, out, probe)) return true;
  return filter_.last_update() != frame.captured && accept_held();
}

double RelativeEstimator::lens_distance() const {
  const Vector3 p_CB = filter_.state().p_NB - camera_.X_NC.translation();
  return std::max(p_CB.norm(), kNearestLens);
}

double RelativeEstimator::usual_rms_px() const {
  return usual_misfit_ / lens_distance();
}

double RelativeEstimator::exact_px() const {
  return std::max(config_.search_rms_px, config_.search_rms_factor * usual_rms_px());
}

bool RelativeEstimator::well_known() const {
  const auto P = filter_.tracking_covariance();
  const double p_sd = std::sqrt(P.topLeftCorner<3, 3>().trace());
  const double turn_sd = std::sqrt(P.block<3, 3>(3, 3).trace());
  return p_sd < config_.known_sd_m && turn_sd < config_.known_sd_deg * kDegree;
}

bool RelativeEstimator::accept(const LedFrame& leds, std::size_t agreeing,
                               double rms_max_px, FrameReport& out, Probe* probe) {
  const ProbeScope scope(probe, Stage::filter);
  if (would_jump(leds)) {
    out.why_not = "too few LEDs are left for a rig that is this far off";
    return false;
  }
  std::optional<RelativeFilter> before;
  if (rms_max_px < kAnyFit) before = filter_;
  auto report = filter_.update(leds, agreeing);
  if (report && report->reprojection_px > rms_max_px) {
    filter_ = *before;
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
  for (const ObservationReport& seen : report->seen) {
    LedUse use;
    use.observation.leds = seen.leds;
    use.observation.uv = seen.uv;
    use.nis = seen.nis;
    out.leds.push_back(use);
  }
  for (const RefusedBlob& refused : report->refused) out.refused.push_back(refused);
  out.reprojection_px = report->reprojection_px;
  // Fewer than three directions leave the pose to the prediction.
  out.tracked =
      report->reprojection_px < config_.reprojection_max_px &&
      ((report->used >= 3 && !fresh_) || (config_.tell_apart && well_known()));
  if (!out.tracked) out.why_not = "too few LEDs fit";
  if (out.tracked) remember_fit(leds.led_count(), out.reprojection_px);
  if (out.tracked && static_cast<std::size_t>(report->used) >= kTellingLeds) {
    const double misfit = report->reprojection_px * lens_distance();
    usual_misfit_ +=
        usual_misfit_ > 0 ? (misfit - usual_misfit_) / kUsualMemory : misfit;
    usual_misfit_ = std::max(usual_misfit_, misfit_least_);
  }
  if (out.tracked && config_.learn_leds && !expecting_) learn_leds(leds, *report);
  return out.tracked;
}

void RelativeEstimator::remember_fit(int leds, double rms_px) {
  fitted_leds_ = leds;
  if (leds > kFewLeds) fitted_misfit_ = rms_px * lens_distance();
}

// What the pose owes to LEDs that are not where the rig says changes as they leave the
// picture one by one: a jump that the filter would take for speed.
bool RelativeEstimator::would_jump(const LedFrame& leds) const {
  const int count = leds.led_count();
  return config_.tell_apart && !expecting_ && count < fitted_leds_ &&
         count < static_cast<int>(kTellingLeds) &&
         fitted_misfit_ > kJumpPx * lens_distance();
}

void RelativeEstimator::begin_anew() {
  learner_.forget();
  leds_ = learner_.leds();
  filter_.set_rig(camera_, leds_, config_.filter.led_position_sd_m);
  tracker_.set_rig(camera_, leds_, config_.tracker.led_sd_m);
  resolver_.set_rig(camera_, leds_);
  leds_moved_ = true;
  learning_ = false;
  usual_misfit_ = 0;
  remember_fit(0, 0);
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
  leds_ = learner_.leds();
  filter_.correct_leds(leds_, learner_.cov());
  tracker_.set_rig(camera_, leds_, config_.tracker.led_sd_m);
  resolver_.set_rig(camera_, leds_);
  leds_moved_ = true;
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

void RelativeEstimator::search(const CameraFrame& frame, const MotionSource& motion,
                               FrameReport& out, Probe* probe) {
  if (leds_moved_) {
    finder_.set_rig(camera_, leds_, config_.finder.led_sd_m);
    rivals_.set_rig(camera_, filter_);
    leds_moved_ = false;
  }
  Result<BlobSpan> blobs = fail(Fault::invalid_input);
  {
    const ProbeScope scope(probe, Stage::detect);
    blobs = detector_.detect(frame.color, frame.depth);
  }
  if (!blobs) {
    out.why_not = "the picture cannot be read";
    return;
  }
  out.blobs = static_cast<int>(blobs->size());
  Result<FoundLeds> found = fail(Fault::too_few_points);
  {
    const ProbeScope scope(probe, Stage::associate);
    found = finder_.find(*blobs, frame.captured);
    if (found && config_.tell_apart) place_by_pixels(frame, *blobs, *found);
    if (!beyond_doubt(found) && config_.blobs.dim_threshold > 0) {
      // LEDs may be too dim to stand out as what is bright does.
      const auto dim =
          detector_.detect(frame.color, frame.depth, {}, BlobDetector::LookFor::dim);
      if (dim) {
        blobs = dim;
        auto again = finder_.find(*dim, frame.captured);
        if (again && config_.tell_apart) place_by_pixels(frame, *dim, *again);
        found = better(found, again);
      } else {
        blobs = detector_.detect(frame.color, frame.depth);
      }
    }
    if (!found && expecting_ && !filter_.initialized()) {
      if (auto expected = find_expected(*blobs, frame.captured)) {
        found = expected;
        if (config_.tell_apart) place_by_pixels(frame, *blobs, *found);
      }
    }
    Rivals open;
    for (const LedRival& rival : finder_.left_open()) {
      if (!found && open.size() < Rivals::capacity()) open.push_back(rival);
    }
    // Lamps in a row look like white LEDs that are somewhat off, picture after picture.
    // A drone at rest where it is known to stand does not move either.
    if (found && config_.keep_rivals && !filter_.initialized() && !expecting_ &&
        found->in_color < kColored && found->fit.rms_px > config_.placed_sd_px) {
      open.push_back({found->fit.X_NB, found->fit.cov,
                      static_cast<int>(found->frame.seen.size()), true});
      found = fail(Fault::ambiguous);
    }
    if (found && config_.keep_rivals && !filter_.initialized()) {
      open = rivals_of(*found);
      if (!open.empty()) found = fail(Fault::ambiguous);
    }
    if (!found && config_.keep_rivals) {
      const auto left = rivals_.decide(
          *blobs, frame.captured, {open.data(), open.size()}, tracker_, motion, step_);
      if (left) found = left;
      if (left && config_.tell_apart) place_by_pixels(frame, *blobs, *found);
    }
  }
  if (!found) {
    confirmations_ = 0;
    out.why_not = found.error().fault == Fault::ambiguous
                      ? "two poses explain the picture"
                      : "no pose explains the picture";
    return;
  }
  if (config_.tell_apart && found->fit.rms_px > placed_rms_max_px(found->fit.X_NB)) {
    out.why_not = "lights that fit worse than the LEDs' places are known";
    return;
  }
  if (!filter_.initialized() && !exact(*found) &&
      (found->frame.seen.size() < kTellingLeds || !confirmed(found->fit.X_NB))) {
    out.why_not = "not yet sure: lights that fit less exactly than LEDs should";
    return;
  }
  if (filter_.initialized() && !believable(*found, frame.captured)) {
    out.why_not = "a pose that contradicts the prediction";
    return;
  }
  if (!filter_.initialized() && on_floor_ && !believable_on_floor(*found)) {
    out.why_not = "not yet sure that it is the drone on the floor";
    return;
  }
  if (fresh_ && filter_.initialized() &&
      accept(found->frame, found->frame.seen.size(),
             std::max(exact_px(), found->fit.rms_px), out, probe)) {
    // Where it is now and where it was tell its speed.
    misses_ = 0;
    return;
  }
  go_on_from(*found, frame.captured, out);
}

bool RelativeEstimator::exact(const FoundLeds& found) const {
  return !config_.tell_apart ||
         found.fit.rms_px <= config_.placed_sds * config_.placed_sd_px;
}

bool RelativeEstimator::beyond_doubt(const Result<FoundLeds>& found) const {
  if (!found || !config_.tell_apart) return found.has_value();
  return found->frame.seen.size() >= kTellingLeds && exact(*found);
}

Result<FoundLeds> RelativeEstimator::better(const Result<FoundLeds>& bright,
                                            const Result<FoundLeds>& dim) const {
  if (!bright || !dim) return bright ? bright : dim;
  if (beyond_doubt(dim) || dim->frame.seen.size() > bright->frame.seen.size()) {
    return dim;
  }
  if (!near(bright->fit.X_NB, dim->fit.X_NB, config_.placed_within_m,
            config_.placed_within_deg * kDegree)) {
    return fail(Fault::ambiguous);
  }
  return bright;
}

RelativeEstimator::Rivals RelativeEstimator::rivals_of(FoundLeds& found) const {
  Rivals open;
  const bool few = found.frame.seen.size() <= PoseDoubt::kFew;
  if (!config_.tell_apart || (!few && exact(found))) return open;
  const auto rms_max = [&] {
    return std::min(placed_rms_max_px(found.fit.X_NB),
                    std::max(kRivalRms * found.fit.rms_px, config_.placed_sd_px));
  };
  OtherPoses others;
  // Where none fits, a colour may be that of a neighbour.
  find_other_poses(camera_, leds_, config_.finder.use_color && exact(found), finder_,
                   {found.frame.seen.data(), found.frame.seen.size()}, found.fit.X_NB,
                   rms_max(), others);
  if (!others.empty() && kRivalRms * others[0].fit.rms_px < found.fit.rms_px) {
    found.frame.seen = others[0].seen;
    found.frame.groups.clear();
    found.fit = others[0].fit;
  }
  const auto add = [&](const PoseFit& fit) {
    const auto same = [&](const LedRival& other) {
      return near(other.X_NB, fit.X_NB, config_.placed_within_m,
                  config_.placed_within_deg * kDegree);
    };
    if (fit.rms_px > rms_max() || std::any_of(open.begin(), open.end(), same)) return;
    open.push_back(
        {fit.X_NB, fit.cov, static_cast<int>(found.frame.seen.size()), false});
  };
  add(found.fit);
  const int leds = found.frame.led_count();
  for (const OtherPose& other : others) {
    // What explains fewer LEDs must do it far better.
    LedFrame frame;
    frame.seen = other.seen;
    if (few && frame.led_count() >= leds) add(other.fit);
  }
  if (open.size() == 1) open.clear();
  return open;
}

void RelativeEstimator::go_on_from(const FoundLeds& found, Time t, FrameReport& out) {
  RelativeState x;
  x.p_NB = found.fit.X_NB.translation();
  x.R_NB = found.fit.X_NB.linear();
  found_again_ = filter_.initialized();
  fresh_ = config_.tell_apart;
  double velocity_sd = 1.5;
  Vector3 d_N = Vector3::Zero(), b_N = Vector3::Zero();
  if (filter_.initialized() &&
      (filter_.state().p_NB - x.p_NB).norm() < config_.search_gate_m) {
    x.v_NB = filter_.state().v_NB;
    d_N = filter_.motion_state().d_N;
    b_N = filter_.motion_state().b_N;
    velocity_sd = std::max(0.3, 2 * filter_.velocity_sd());
  }
  filter_.reset(t, x, covariance_of(found.fit, velocity_sd), d_N, b_N, &found.frame);
  last_told_ = t;
  last_sight_ = t;
  if (config_.tell_apart && found.frame.seen.size() >= kTellingLeds) {
    usual_misfit_ =
        std::max({usual_misfit_, misfit_least_, found.fit.rms_px * lens_distance()});
  }
  remember_fit(found.frame.led_count(), found.fit.rms_px);
  rivals_.clear();
  doubt_.clear();
  misses_ = 0;
  confirmations_ = 0;
  doubts_ = 0;
  out.leds.clear();
  for (const LedObservation& seen : found.frame.seen) out.leds.push_back({seen, 0});
  out.refused = found.frame.refused;
  out.reprojection_px = found.fit.rms_px;
  out.tracked = !config_.tell_apart || well_known();
  out.initialized = true;
  out.why_not = out.tracked ? "" : "not yet known well enough";
}

bool RelativeEstimator::contradicted(const CameraFrame& frame, FrameReport& out,
                                     Probe* probe) {
  if (!config_.tell_apart || expecting_) return false;
  int used = 0;
  for (const LedUse& use : out.leds) used += std::popcount(use.observation.leds);
  doubts_ = used < leds_.size() ? doubts_ + 1 : 0;
  const auto pictures = static_cast<unsigned>(doubts_);
  const bool time_to_look = pictures >= kDoubtAfter && (std::has_single_bit(pictures) ||
                                                        pictures % kDoubtEvery == 0);
  if (doubts_ == 0 || !(time_to_look || confirmations_ > 0)) return false;
  const LedResolver as_followed = resolver_;
  Result<FoundLeds> found = fail(Fault::too_few_points);
  {
    const ProbeScope scope(probe, Stage::associate);
    const auto blobs = detector_.detect(frame.color, frame.depth);
    if (blobs) found = finder_.find(*blobs, frame.captured);
    if (found) place_by_pixels(frame, *blobs, *found);
  }
  const auto contrary = [&] {
    const Pose X_NB = filter_.state().X_NB();
    return found->frame.seen.size() > seen_.size() &&
           found->frame.seen.size() >= PoseDoubt::kFew &&
           !near(X_NB, found->fit.X_NB, config_.expected_within_m,
                 config_.expected_within_deg * kDegree) &&
           found->fit.rms_px <= std::max(config_.search_rms_px,
                                         config_.search_rms_factor * usual_rms_px());
  };
  if (!found || !contrary()) {
    resolver_ = as_followed;
    return false;
  }
  if (confirmed(found->fit.X_NB)) {
    go_on_from(*found, frame.captured, out);
  } else {
    resolver_ = as_followed;
  }
  return true;
}

void RelativeEstimator::doubt(FrameReport& out) {
  if (!config_.tell_apart || expecting_ || !out.tracked) return;
  const bool exact = out.reprojection_px <= config_.placed_sds * config_.placed_sd_px;
  if (exact && seen_alone_ >= kTellingLeds) {
    doubt_.be_sure({seen_.data(), seen_.size()});
  } else {
    // Where none fits, a colour may be that of a neighbour.
    doubt_.look(camera_, leds_, config_.finder.use_color && exact, finder_,
                {seen_.data(), seen_.size()}, filter_.state().X_NB());
  }
  const OtherPose* better = doubt_.better();
  if (better == nullptr) return;
  FoundLeds found;
  found.frame.t = out.t;
  found.frame.seen = better->seen;
  found.fit = better->fit;
  go_on_from(found, out.t, out);
}

void RelativeEstimator::place_by_pixels(const CameraFrame& frame, BlobSpan blobs,
                                        FoundLeds& found) {
  TrackDetail detail;
  LedFrame leds =
      tracker_.track(blobs, found.fit.X_NB, 4 * found.fit.cov, frame.captured, &detail);
  if (leds.led_count() < found.frame.led_count()) return;
  FixedVector<Vector2, kMaxLeds> still;  // its speed is not known yet
  for (int i = 0; i < leds_.size(); ++i) still.push_back(Vector2::Zero());
  resolver_.resolve(frame.color, blobs, detail, {still.data(), still.size()}, leds);
  // Three always fit.
  if (leds.seen.size() < 4) return;
  const auto fit = refine_pose(camera_, leds_, {leds.seen.data(), leds.seen.size()},
                               found.fit.X_NB, nullptr, 10);
  if (!fit || !near(fit->X_NB, found.fit.X_NB, config_.placed_within_m,
                    config_.placed_within_deg * kDegree)) {
    return;
  }
  found.frame = leds;
  found.fit = *fit;
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
  if (usual_misfit_ > 0 && found.fit.rms_px > exact_px()) {
    confirmations_ = 0;
    return false;
  }
  const Seconds unseen = to_seconds(t - last_sight_);
  if (near(filter_.state().X_NB(), found.fit.X_NB,
           config_.search_gate_m + config_.search_drift_m_s * unseen,
           config_.search_turn_deg * kDegree)) {
    // Among many lamps four lie by chance as four LEDs may.
    if (found.frame.led_count() < config_.search_leds) return confirmed(found.fit.X_NB);
    confirmations_ = 0;
    return true;
  }
  return found.frame.led_count() >= config_.search_leds && confirmed(found.fit.X_NB);
}

bool RelativeEstimator::believable_on_floor(const FoundLeds& found) {
  const Pose& X_NB = found.fit.X_NB;
  return found.frame.led_count() >= config_.search_leds &&
         X_NB.linear()(2, 2) > std::cos(config_.floor_tilt_deg * kDegree) &&
         X_NB.translation().z() < config_.floor_height_m && confirmed(X_NB);
}

bool RelativeEstimator::confirmed(const Pose& X_NB) {
  const bool again = near(X_NB_contrary_, X_NB, config_.search_gate_m,
                          config_.search_turn_deg * kDegree);
  confirmations_ = again ? confirmations_ + 1 : 1;
  X_NB_contrary_ = X_NB;
  return confirmations_ >= config_.search_confirmations;
}

void RelativeEstimator::expect(const Pose& X_NB, const Matrix6& cov) {
  expecting_ = true;
  X_NB_expected_ = X_NB;
  cov_expected_ = cov;
  rest_sum_.fill(Vector2::Zero());
  rest_count_.fill(0);
}

void RelativeEstimator::remember_rest(const LedFrame& leds) {
  for (const LedObservation& o : leds.seen) {
    if (!std::has_single_bit(o.leds)) continue;
    const auto i = static_cast<std::size_t>(std::countr_zero(o.leds));
    rest_sum_[i] += o.uv;
    ++rest_count_[i];
  }
}

Result<RestFit> RelativeEstimator::calibrate_at_rest() {
  if (!config_.calibrate_at_rest || !expecting_ || !filter_.initialized()) {
    return fail(Fault::too_few_points);
  }
  FixedVector<LedObservation, kMaxLeds> seen;
  for (std::size_t i = 0; i < kMaxLeds; ++i) {
    if (rest_count_[i] < config_.rest_pictures) continue;
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << i);
    o.uv = rest_sum_[i] / rest_count_[i];
    seen.push_back(o);
  }
  const auto fit = alight::calibrate_at_rest(
      config_.rest, camera_, leds_, {seen.data(), seen.size()}, X_NB_expected_);
  if (!fit) return fail(fit.error());
  camera_ = fit->camera;
  leds_ = fit->leds;
  // One that was not seen at rest is known no better than before.
  const bool all = static_cast<int>(seen.size()) == leds_.size();
  const double led_sd_m = all ? config_.rest_led_sd_m : config_.rest.led_sd_m;
  tracker_.set_rig(camera_, leds_, led_sd_m);
  finder_.set_rig(camera_, leds_, led_sd_m);
  resolver_.set_rig(camera_, leds_);
  const Time t = filter_.time();
  filter_.set_rig(camera_, leds_, led_sd_m);
  rivals_.set_rig(camera_, filter_);
  config_.learn_leds = learning_ = leds_moved_ = false;
  // They fit where it stands, whatever is wrong with them elsewhere.
  misfit_least_ = led_sd_m * camera_.intrinsics.fx;
  RelativeState x;
  x.p_NB = fit->X_NB.translation();
  x.R_NB = fit->X_NB.linear();
  Covariance9 cov = Covariance9::Zero();
  cov.diagonal() << Vector3::Constant(2.5e-5), Vector3::Constant(1e-3),
      Vector3::Constant(1e-4);
  filter_.reset(t, x, cov);
  return fit;
}

Result<FoundLeds> RelativeEstimator::find_expected(BlobSpan blobs, Time t) const {
  FoundLeds found;
  found.frame = tracker_.track(blobs, X_NB_expected_, cov_expected_, t);
  if (found.frame.led_count() < std::max(4, leds_.size() - 1)) {
    return fail(Fault::too_few_points);
  }
  const Matrix6 information = cov_expected_.inverse();
  auto fit =
      refine_pose(camera_, leds_, {found.frame.seen.data(), found.frame.seen.size()},
                  X_NB_expected_, &information);
  if (!fit) return fail(fit.error());
  if (fit->rms_px > config_.reprojection_max_px) return fail(Fault::degenerate);
  Vector6 off;
  off << fit->X_NB.translation() - X_NB_expected_.translation(),
      so3_log(X_NB_expected_.linear().transpose() * fit->X_NB.linear());
  // Six degrees of freedom: beyond this the drone stands elsewhere.
  if (off.dot(information * off) > 22.5) return fail(Fault::ambiguous);
  found.fit = *fit;
  return found;
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

void RelativeEstimator::restart_disturbance(const Vector3& b_N) {
  if (!filter_.initialized()) return;
  filter_.reset(filter_.time(), filter_.state(), filter_.tracking_covariance(),
                Vector3::Zero(), b_N);
}

}  // namespace alight
