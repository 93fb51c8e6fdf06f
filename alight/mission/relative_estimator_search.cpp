// How RelativeEstimator finds a pose in a whole picture.
#include <algorithm>
#include <bit>
#include <tuple>
#include <utility>

#include "alight/geometry/near.h"
#include "alight/mission/relative_estimator.h"
#include "alight/vision/blobs_apart.h"
#include "alight/vision/lights_fitted.h"

namespace alight {
namespace {

constexpr double kGammaUsual = 2.2;  // of pictures for people to look at
// LEDs taken for others may fit this much worse than the best answer and still be
// right.
constexpr double kRivalRms = 3;
// Pictures in a row with LEDs missing after which the whole picture is searched for a
// pose that explains more: then, after twice as many, and so on, at last after every so
// many.
constexpr unsigned kDoubtAfter = 4, kDoubtEvery = 256;
// Pictures in a row of lights that nothing explains after which what has been learnt of
// the LEDs is no longer believed.
constexpr int kUnexplainedMost = 60;
constexpr std::size_t kHandful = 24;  // Lights: a thorough search costs little.
constexpr int kRestLeds = 4;          // of a drone at rest that do to start with

Covariance9 covariance_of(const PoseFit& fit, double velocity_sd) {
  Covariance9 cov = Covariance9::Zero();
  cov.topLeftCorner<6, 6>() = fit.cov;
  cov.topLeftCorner<3, 3>().diagonal().array() += 1e-8;
  cov.block<3, 3>(3, 3).diagonal().array() += 1e-7;
  cov.bottomRightCorner<3, 3>().diagonal().setConstant(velocity_sd * velocity_sd);
  return cov;
}

}  // namespace

void RelativeEstimator::search_either_way(const CameraFrame& stored,
                                          const MotionSource& motion, FrameReport& out,
                                          Probe* probe) {
  const auto contrary = [&] { return std::pair(confirmations_, X_NB_contrary_); };
  const auto before = contrary();
  if (search(stored, motion, out, probe)) {
    unfound_ = unexplained_ = 0;
    return;
  }
  ++unfound_;
  doubt_learnt_leds(out);
  const bool may_suppose = config_.suppose_gamma_after > 0 && config_.learn_gamma &&
                           !expecting_ && !gamma_learner_.gamma();
  if (!may_suppose || unfound_ % config_.suppose_gamma_after != 0) return;
  const FrameReport as_searched = out;
  const double believed = linear_.gamma();
  const LedResolver as_believed = resolver_;
  const RivalPoses rivals = rivals_;
  const auto after = contrary();
  // One picture confirms once.
  std::tie(confirmations_, X_NB_contrary_) = before;
  take_gamma(believed == 1 ? kGammaUsual : 1);
  if (search(stored, motion, out, probe, true)) {
    unfound_ = 0;
    return;
  }
  take_gamma(believed);
  resolver_ = as_believed;
  rivals_ = rivals;
  std::tie(confirmations_, X_NB_contrary_) = after;
  out = as_searched;
}

void RelativeEstimator::doubt_learnt_leds(const FrameReport& out) {
  const bool lights = out.blobs >= static_cast<int>(PoseDoubt::kFew);
  unexplained_ = lights && !filter_.initialized() ? unexplained_ + 1 : 0;
  if (!learning_ || unexplained_ < kUnexplainedMost) return;
  begin_anew();
  unexplained_ = 0;
}

bool RelativeEstimator::search(const CameraFrame& stored, const MotionSource& motion,
                               FrameReport& out, Probe* probe, bool only_certain) {
  CameraFrame frame = stored;
  if (leds_moved_) {
    finder_.set_rig(camera_, leds_, config_.finder.led_sd_m);
    rivals_.set_rig(camera_, filter_);
    leds_moved_ = false;
  }
  Result<BlobSpan> blobs = fail(Fault::invalid_input);
  {
    const ProbeScope scope(probe, Stage::detect);
    frame.color = linear_.of(stored.color);
    blobs = detector_.detect(frame.color, frame.depth);
  }
  if (!blobs) {
    out.why_not = "the picture cannot be read";
    return false;
  }
  out.blobs = static_cast<int>(blobs->size());
  Result<FoundLeds> found = fail(Fault::too_few_points);
  {
    const ProbeScope scope(probe, Stage::associate);
    const bool at_rest = expecting_ && !filter_.initialized();
    if (at_rest && start_at_rest(*blobs, frame.captured, leds_.size(), out))
      return true;
    Rivals open;
    found = find_anywhere(frame, at_rest, *blobs, open);
    // Near the lens LEDs that are off fit no better where they are than moved on by
    // one: of a drone that stands where it should, the way it stands tells which is
    // which.
    if (at_rest) {
      if (start_at_rest(*blobs, frame.captured, kRestLeds, out)) return true;
      const auto explain = [&](BlobSpan lights) {
        auto expected =
            find_expected(lights, frame.captured, X_NB_expected_, cov_expected_);
        if (!found || !stands_as_expected(found->fit.X_NB)) return expected;
        // So far from where it is expected LEDs may be that only the finder tells them
        // from one another.
        auto again =
            find_expected(lights, frame.captured, found->fit.X_NB, found->fit.cov);
        const bool more = again && (!expected || again->frame.led_count() >
                                                     expected->frame.led_count());
        return more ? again : expected;
      };
      auto expected = explain(*blobs);
      // Turned about its way ahead a drone fits its own LEDs on one side and the twins
      // of the others on the other.
      const BlobSpan alone = without_twins(*blobs);
      auto again = explain(alone);
      ignores_twins_ = again && (!expected || again->frame.led_count() >=
                                                  expected->frame.led_count());
      if (ignores_twins_) expected = std::move(again);
      if (expected && config_.tell_apart) {
        place_by_pixels(frame, ignores_twins_ ? alone : *blobs, *expected);
      }
      if (expected &&
          (!found || expected->frame.led_count() >= found->frame.led_count())) {
        found = expected;
      }
    }
    // Lamps in a row look like white LEDs that are somewhat off, picture after picture.
    // A drone at rest where it is known to stand does not move either. Six that fit
    // exactly are not somewhat off.
    if (found && config_.keep_rivals && !filter_.initialized() && !expecting_ &&
        found->in_color < kColored && found->fit.rms_px > config_.placed_sd_px &&
        !(found->frame.seen.size() >= kNoLamps && exact(*found))) {
      open.push_back({found->fit.X_NB, found->fit.cov,
                      static_cast<int>(found->frame.seen.size()), true});
      found = fail(Fault::ambiguous);
    }
    if (found) open.clear();
    if (found && found->another && !filter_.initialized() && !expecting_ &&
        !on_floor_) {
      confirmations_ = 0;
      out.why_not = "two drones are in view";
      return false;
    }
    if (found && config_.keep_rivals && !filter_.initialized()) {
      open = rivals_of(*found);
      if (!open.empty()) found = fail(Fault::ambiguous);
    }
    if (!found && config_.tell_apart && !at_rest && !only_certain) {
      if (auto told = told_by_pixels(frame, *blobs, open)) found = std::move(*told);
    }
    if (!found && config_.keep_rivals) {
      const auto left = rivals_.decide(
          *blobs, frame.captured, {open.data(), open.size()}, tracker_, motion, step_);
      if (left) found = left;
      if (left && config_.tell_apart) {
        place_by_pixels(frame, *blobs, *found);
        if (misread(*found)) found = fail(Fault::ambiguous);
      }
    }
  }
  if (found && only_certain && !beyond_doubt(found)) found = fail(Fault::ambiguous);
  if (!found) {
    confirmations_ = 0;
    out.why_not = found.error().fault == Fault::ambiguous
                      ? "two poses explain the picture"
                      : "no pose explains the picture";
    return false;
  }
  if (config_.tell_apart && found->fit.rms_px > placed_rms_max_px(found->fit.X_NB)) {
    out.why_not = "lights that fit worse than the LEDs' places are known";
    return false;
  }
  if (!leans_as_known(found->fit.X_NB.linear())) {
    confirmations_ = 0;
    out.why_not = "lights that lean otherwise than the drone";
    return false;
  }
  // Where a drone is known to stand four that are off will do.
  const bool few = found->frame.seen.size() < kTellingLeds && !expecting_;
  if (!filter_.initialized() && !exact(*found) &&
      (few || !confirmed(found->fit.X_NB))) {
    out.why_not = "not yet sure: lights that fit less exactly than LEDs should";
    return false;
  }
  if (forgotten_in_flight() && !beyond_doubt(found)) {
    confirmations_ = 0;
    out.why_not = "too few LEDs to be sure after so long";
    return false;
  }
  if (is_other(found->fit.X_NB, frame.captured)) {
    confirmations_ = 0;
    out.why_not = "the LEDs of another drone";
    return false;
  }
  if (!within_reach(found->fit.X_NB, frame.captured)) {
    confirmations_ = 0;
    out.why_not = "LEDs where the drone cannot be";
    return false;
  }
  if (filter_.initialized() && !believable(*found, frame.captured)) {
    out.why_not = "a pose that contradicts the prediction";
    return false;
  }
  if (!filter_.initialized() && on_floor_ && !believable_on_floor(*found)) {
    out.why_not = "not yet sure that it is the drone on the floor";
    return false;
  }
  if (fresh_ && filter_.initialized() &&
      accept(found->frame, found->frame.seen.size(),
             std::max(exact_px(found->fit.X_NB.translation()), found->fit.rms_px), out,
             probe)) {
    // Where it is now and where it was tell its speed.
    misses_ = 0;
    return true;
  }
  go_on_from(*found, frame.captured, out);
  return true;
}

Result<FoundLeds> RelativeEstimator::find_anywhere(const CameraFrame& frame,
                                                   bool at_rest, BlobSpan& blobs,
                                                   Rivals& open) {
  using Look = LedFinder::Look;
  const bool dims = config_.blobs.dim_threshold > 0;
  const bool takes_apart = config_.tell_apart && !at_rest;
  const LedResolver as_known = resolver_;
  // A picture teaches once, and by the answer that is believed.
  const auto find_in = [&](BlobSpan lights, Look look) {
    resolver_ = as_known;
    auto found = finder_.find(lights, frame.captured, look);
    if (found && config_.tell_apart) {
      place_by_pixels(frame, lights, *found);
      leave_out_misfit(*found);
    }
    return found;
  };
  // A thorough search of many lights takes as long as all the rest: only what is known
  // of them in the end is searched so, and of few what was known before.
  FixedVector<FixedVector<Blob, kHandful>, 2> before;
  const auto take_for_now = [&](BlobSpan lights) {
    if (lights.size() > kHandful) return;
    before.push_back({});
    before.back().assign(lights.begin(), lights.end());
  };
  auto found = find_in(blobs, dims || takes_apart ? Look::glance : Look::thorough);
  if (beyond_doubt(found) || !(dims || takes_apart)) return found;
  Answer first{std::move(found), resolver_};
  take_for_now(blobs);
  apart_.assign(blobs.begin(), blobs.end());
  Result<FoundLeds> in_the_end = fail(Fault::too_few_points);
  if (dims) {
    // LEDs may be too dim to stand out as what is bright does.
    const auto dim =
        detector_.detect(frame.color, frame.depth, {}, BlobDetector::LookFor::dim);
    if (dim) take_apart(*dim, apart_);
    blobs = BlobSpan(apart_.data(), apart_.size());
    in_the_end = find_in(blobs, takes_apart ? Look::glance : Look::thorough);
    if (beyond_doubt(in_the_end)) return in_the_end;
    if (takes_apart) take_for_now(blobs);
  }
  if (takes_apart) {
    // LEDs that run together are as many lights, and a light of its own is one LED.
    fit_lights(frame.color, as_known.spread(), detector_, apart_);
    blobs = BlobSpan(apart_.data(), apart_.size());
    in_the_end = find_in(blobs, Look::thorough);
    if (beyond_doubt(in_the_end)) return in_the_end;
  }
  const Answer last{std::move(in_the_end), resolver_};
  for (const LedRival& rival : finder_.left_open()) {
    if (!open.push_back(rival)) break;
  }
  for (const auto& lights : before) {
    auto then = find_in({lights.data(), lights.size()}, Look::thorough);
    if (beyond_doubt(then)) return then;
    first = better(first, {std::move(then), resolver_});
  }
  const Answer best = better(first, last);
  resolver_ = best.learnt;
  return best.found;
}

RelativeEstimator::Answer RelativeEstimator::better(const Answer& bright,
                                                    const Answer& dim) const {
  if (!bright.found || !dim.found) return bright.found ? bright : dim;
  if (dim.found->frame.seen.size() > bright.found->frame.seen.size()) return dim;
  if (!near(bright.found->fit.X_NB, dim.found->fit.X_NB, config_.placed_within_m,
            config_.placed_within_deg * kDegree)) {
    return {fail(Fault::ambiguous), dim.learnt};
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
  if (!found_again_) beyond_doubt_.reset();
  fresh_ = config_.tell_apart;
  double velocity_sd = config_.found_sd_m_s;
  Vector3 d_N = Vector3::Zero(), b_N = Vector3::Zero();
  if (filter_.initialized() &&
      (filter_.state().p_NB - x.p_NB).norm() < config_.search_gate_m) {
    x.v_NB = filter_.state().v_NB;
    d_N = filter_.motion_state().d_N;
    // What pushes it does so however it leans.
    if (filter_.push()) d_N += kGravity * (filter_.state().R_NB - x.R_NB).col(2);
    b_N = filter_.motion_state().b_N;
    velocity_sd = std::max(0.3, 2 * filter_.velocity_sd());
  }
  filter_.reset(t, x, covariance_of(found.fit, velocity_sd), d_N, b_N, &found.frame);
  start_from(found, t, out);
}

void RelativeEstimator::start_from(const FoundLeds& found, Time t, FrameReport& out) {
  const Vector3 p_NB = found.fit.X_NB.translation();
  last_told_ = t;
  last_sight_ = t;
  if (config_.tell_apart && found.frame.seen.size() >= kTellingLeds) {
    usual_misfit_ = std::max(
        {usual_misfit_, misfit_least_, found.fit.rms_px * lens_distance(p_NB)});
  }
  remember_fit(found.frame.led_count(), found.fit.rms_px);
  misfit_ = fits_ = 0;
  forget_past();
  rivals_.clear();
  doubt_.clear();
  misses_ = 0;
  confirmations_ = 0;
  doubts_ = 0;
  sure_ = false;
  strays_.forget();
  out.leds.clear();
  for (const LedObservation& seen : found.frame.seen) out.leds.push_back({seen, 0});
  out.refused = found.frame.refused;
  out.reprojection_px = found.fit.rms_px;
  out.tracked = !config_.tell_apart || well_known();
  out.initialized = true;
  out.why_not = out.tracked ? "" : "not yet known well enough";
}

bool RelativeEstimator::contradicted(const CameraFrame& stored, FrameReport& out,
                                     Probe* probe) {
  if (!config_.tell_apart || expecting_) return false;
  int used = 0;
  for (const LedUse& use : out.leds) used += std::popcount(use.observation.leds);
  // No other LEDs look like six that fit exactly, nor do lamps.
  const bool plain =
      used >= leds_.size() || (seen_alone_ >= kNoLamps && exact(out.reprojection_px));
  doubts_ = plain ? 0 : doubts_ + 1;
  const auto pictures = static_cast<unsigned>(doubts_);
  const bool time_to_look = pictures >= kDoubtAfter && (std::has_single_bit(pictures) ||
                                                        pictures % kDoubtEvery == 0);
  if (doubts_ == 0 || !(time_to_look || confirmations_ > 0)) return false;
  const LedResolver as_followed = resolver_;
  CameraFrame frame = stored;
  Result<FoundLeds> found = fail(Fault::too_few_points);
  {
    const ProbeScope scope(probe, Stage::associate);
    frame.color = linear_.of(stored.color);
    const auto blobs = detector_.detect(frame.color, frame.depth);
    if (blobs) found = finder_.find(*blobs, frame.captured);
    if (found && !place_by_pixels(frame, *blobs, *found)) {
      found = fail(Fault::ambiguous);
    }
  }
  const auto contrary = [&] {
    const Pose X_NB = filter_.state().X_NB();
    // Among many lamps four lie by chance as four LEDs may.
    const std::size_t least = sure_ ? kTellingLeds : PoseDoubt::kFew;
    // What has been followed since there was no doubt, and still shows that many, is
    // the drone, if somewhat turned or shifted: farther off there are but lamps.
    const bool far = !near(X_NB, found->fit.X_NB, config_.search_gate_m,
                           config_.search_turn_deg * kDegree);
    if (far && sure_ && seen_.size() >= PoseDoubt::kFew) return false;
    return found->frame.seen.size() > seen_.size() &&
           found->frame.seen.size() >= least &&
           leans_as_known(found->fit.X_NB.linear()) &&
           within_reach(found->fit.X_NB, frame.captured) &&
           !is_other(found->fit.X_NB, frame.captured) &&
           !near(X_NB, found->fit.X_NB, config_.expected_within_m,
                 config_.expected_within_deg * kDegree) &&
           found->fit.rms_px <= exact_px(found->fit.X_NB.translation());
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
  doubt_.feel(filter_.push());
  if (no_doubt(out)) {
    doubt_.be_sure({seen_.data(), seen_.size()});
  } else {
    // Where none fits, a colour may be that of a neighbour.
    const bool colored = config_.finder.use_color && exact(out.reprojection_px);
    doubt_.look(camera_, leds_, colored, finder_, {seen_.data(), seen_.size()},
                filter_.state().X_NB());
  }
  FoundLeds found;
  found.frame.t = out.t;
  if (const auto as_written = written_fits_better()) {
    found.frame.seen = seen_;
    found.fit = *as_written;
    begin_anew();
  } else if (const OtherPose* better = doubt_.better()) {
    found.frame.seen = better->seen;
    found.fit = better->fit;
  } else {
    return;
  }
  go_on_from(found, out.t, out);
  // The same lights as before, by another reading: no lamps far from the drone.
  found_again_ = false;
}

BlobSpan RelativeEstimator::without_twins(BlobSpan blobs) {
  no_twins_.clear();
  for (const Blob& blob : blobs) {
    const auto is_light = [&](const Blob& light) {
      return light.brightness > blob.brightness &&
             colors_agree(blob.color, light.color, false) &&
             mirror_.may_mirror(light.uv, blob.uv);
    };
    if (!mirror_.shows(blob.uv) || std::none_of(blobs.begin(), blobs.end(), is_light)) {
      no_twins_.push_back(blob);
    }
  }
  return {no_twins_.data(), no_twins_.size()};
}

}  // namespace alight
