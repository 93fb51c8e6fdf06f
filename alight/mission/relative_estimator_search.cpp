// How RelativeEstimator finds a pose in a whole picture, and when it believes one.
#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>
#include <utility>

#include "alight/mission/relative_estimator.h"
#include "alight/vision/blobs_apart.h"
#include "alight/vision/lights_fitted.h"

namespace alight {
namespace {

constexpr double kGammaUsual = 2.2;  // of pictures for people to look at
// LEDs taken for others may fit this much worse than the best answer and still be
// right.
constexpr double kRivalRms = 3;
// One that has followed them through pictures is wrong if others fit so many times
// better.
constexpr double kMisreadRms = 2;
// So many lights in the colours of their LEDs are no lamps.
constexpr int kColored = 3;
// White lights that fit exactly and are so many are none either.
constexpr std::size_t kNoLamps = 6;
constexpr double kOwnLight_px = 3;  // from an LED, its blob's middle
// By so many lights pixels tell one pose from others, unless these fit so much worse.
constexpr std::size_t kLeadLights = 2;
constexpr double kLeadRms = 2;
// Four, so few that several readings fit them (PoseDoubt), do, some of them in their
// LEDs' colours, where they fit so exactly, by pixels and by what noise leaves of them,
// and others so many times worse: where LEDs are off any of several poses fits once in
// a while. No light's place is known better than the least.
constexpr int kFourColored = 2;
constexpr double kFourRms_px = 0.08, kFourChi2 = 5, kFourLeadRms = 4;
constexpr double kFourLeast_px = 0.015;
// Pictures in a row with LEDs missing after which the whole picture is searched for a
// pose that explains more: then, after twice as many, and so on, at last after every so
// many.
constexpr unsigned kDoubtAfter = 4, kDoubtEvery = 256;
constexpr std::size_t kHandful = 24;  // Lights: a thorough search costs little.
constexpr double kRestReach = 4;      // sd of its place, from where it is expected
constexpr int kRestLeds = 4;          // of a drone at rest that do to start with
constexpr double kReachSds = 3;  // Where nobody tells how it moves it may be far off.
// Another drone is the same from picture to picture; one that leans as it should is
// not.
constexpr double kOtherWithin = 0.3, kOtherTurns = 12 * kDegree;
constexpr Seconds kOtherStays = 3;
constexpr double kFlies = 0.5;  // With at least so much of its weight in thrust.

Covariance9 covariance_of(const PoseFit& fit, double velocity_sd) {
  Covariance9 cov = Covariance9::Zero();
  cov.topLeftCorner<6, 6>() = fit.cov;
  cov.topLeftCorner<3, 3>().diagonal().array() += 1e-8;
  cov.block<3, 3>(3, 3).diagonal().array() += 1e-7;
  cov.bottomRightCorner<3, 3>().diagonal().setConstant(velocity_sd * velocity_sd);
  return cov;
}

bool near(const Pose& a, const Pose& b, double distance, double turn) {
  return (a.translation() - b.translation()).norm() < distance &&
         so3_log(a.linear().transpose() * b.linear()).norm() < turn;
}

/// Which of `blobs` shows which LED, as found in them.
Assignment shown_by(const LedFrame& found, BlobSpan blobs) {
  Assignment match;
  for (const LedObservation& o : found.seen) {
    const auto blob = std::find_if(blobs.begin(), blobs.end(),
                                   [&](const Blob& b) { return b.uv == o.uv; });
    if (blob == blobs.end()) continue;
    ++match.blobs;
    for (std::size_t i = 0; i < kMaxLeds; ++i) {
      if (!((o.leds >> i) & 1)) continue;
      match.blob[i] = static_cast<int>(blob - blobs.begin());
      ++match.leds;
    }
  }
  return match;
}

/// How many of its lights are of the colour of their LEDs.
int in_own_color(const Constellation& leds, const LedFrame& frame, BlobSpan blobs) {
  int count = 0;
  for (const LedObservation& o : frame.seen) {
    const LedColor own = leds.color(std::countr_zero(o.leds));
    count += own != LedColor::white && own != LedColor::none &&
             std::any_of(blobs.begin(), blobs.end(), [&](const Blob& b) {
               return b.color == own && (b.uv - o.uv).norm() < kOwnLight_px;
             });
  }
  return count;
}

}  // namespace

void RelativeEstimator::search_either_way(const CameraFrame& stored,
                                          const MotionSource& motion, FrameReport& out,
                                          Probe* probe) {
  const auto contrary = [&] { return std::pair(confirmations_, X_NB_contrary_); };
  const auto before = contrary();
  if (search(stored, motion, out, probe)) {
    unfound_ = 0;
    return;
  }
  ++unfound_;
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

// It may be anywhere, and four lamps look like four of its LEDs sooner or later.
bool RelativeEstimator::forgotten_in_flight() const {
  return config_.reach_m_s > 0 && !filter_.initialized() && !expecting_ &&
         beyond_doubt_;
}

bool RelativeEstimator::beyond_doubt(const Result<FoundLeds>& found) const {
  if (!found || !config_.tell_apart) return found.has_value();
  return found->frame.seen.size() >= kTellingLeds && exact(*found);
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
  const OtherPose* better = doubt_.better();
  if (better == nullptr) return;
  FoundLeds found;
  found.frame.t = out.t;
  found.frame.seen = better->seen;
  found.fit = better->fit;
  go_on_from(found, out.t, out);
  // The same lights as before, by another reading: no lamps far from the drone.
  found_again_ = false;
}

bool RelativeEstimator::place_by_pixels(const CameraFrame& frame, BlobSpan blobs,
                                        FoundLeds& found) {
  TrackDetail detail;
  LedFrame leds =
      tracker_.track(blobs, found.fit.X_NB, 4 * found.fit.cov, frame.captured, &detail);
  const bool fewer = leds.led_count() < found.frame.led_count();
  if (leds.seen.size() < found.frame.seen.size()) {
    // Lights that run together are paler than those the tracker takes where others show
    // their colours.
    leds = found.frame;
    detail.match = shown_by(found.frame, blobs);
    detail.images = led_images(camera_, leds_, found.fit.X_NB);
    if (detail.images.count < leds_.size()) return true;
  }
  FixedVector<Vector2, kMaxLeds> still;  // its speed is not known yet
  for (int i = 0; i < leds_.size(); ++i) still.push_back(Vector2::Zero());
  resolver_.resolve(frame.color, blobs, detail, {still.data(), still.size()}, leds);
  // Of five whose pixels speak against one the other four are no better for that.
  if (leds.seen.size() < found.frame.seen.size()) return false;
  if (leds.seen.size() < 4) return true;  // Three always fit.
  const auto fit = refine_pose(camera_, leds_, {leds.seen.data(), leds.seen.size()},
                               found.fit.X_NB, nullptr, 10);
  if (!fit || !near(fit->X_NB, found.fit.X_NB, config_.placed_within_m,
                    config_.placed_within_deg * kDegree)) {
    return true;
  }
  // That an LED shares its blob with another is a guess, which explains one more, but
  // must not fit worse, unless so many come of it that it is none.
  const bool plain = leds.seen.size() >= kNoLamps && exact(fit->rms_px);
  if (fewer && !plain && fit->rms_px > found.fit.rms_px) return true;
  found.frame = leds;
  found.fit = *fit;
  return true;
}

void RelativeEstimator::leave_out_misfit(FoundLeds& found) const {
  const auto& seen = found.frame.seen;
  if (exact(found) || seen.size() <= kTellingLeds || found.in_color <= kColored) return;
  std::optional<PoseFit> best;
  std::size_t out = 0;
  for (std::size_t n = 0; n < seen.size(); ++n) {
    FixedVector<LedObservation, kMaxLeds> others = seen;
    others.erase(n);
    const auto fit = refine_pose(camera_, leds_, {others.data(), others.size()},
                                 found.fit.X_NB, nullptr, 10);
    if (!fit || fit->rms_px > config_.placed_sd_px) continue;
    if (best && best->rms_px <= fit->rms_px) continue;
    best = *fit;
    out = n;
  }
  if (!best) return;
  found.frame.refused.push_back({seen[out].uv, Refusal::off_constellation});
  found.frame.seen.erase(out);
  found.frame.groups.clear();
  found.fit = *best;
  --found.in_color;
}

std::optional<FoundLeds> RelativeEstimator::told_by_pixels(const CameraFrame& frame,
                                                           BlobSpan blobs,
                                                           const Rivals& open) {
  if (open.empty()) return std::nullopt;
  const LedResolver as_known = resolver_;
  LedResolver learnt = as_known;
  struct Fit {
    std::size_t lights = 0;
    double rms_px = 0;
  };
  FixedVector<Fit, RivalPoses::kMost> exactly;
  std::optional<std::size_t> best;
  FoundLeds told;
  for (const LedRival& rival : open) {
    resolver_ = as_known;
    FoundLeds found;
    found.fit.X_NB = rival.X_NB;
    found.fit.cov = rival.cov;
    place_by_pixels(frame, blobs, found);
    const std::size_t lights = found.frame.seen.size();
    if (lights == 0 || !exact(found)) continue;
    // So many of many lamps fit as exactly sooner or later.
    const int in_color = in_own_color(leds_, found.frame, blobs);
    const bool colored = in_color >= kColored;
    if (rival.by_chance && !colored) continue;
    exactly.push_back({lights, found.fit.rms_px});
    const bool four = lights == PoseDoubt::kFew && in_color >= kFourColored &&
                      !rival.by_chance && found.fit.rms_px < kFourRms_px &&
                      found.fit.chi2 < kFourChi2;
    if (!four && lights < (colored ? kTellingLeds : kNoLamps)) continue;
    if (best && exactly[*best].lights > lights) continue;
    if (four && best && exactly[*best].rms_px <= found.fit.rms_px) continue;
    best = exactly.size() - 1;
    told = found;
    learnt = resolver_;
  }
  resolver_ = as_known;
  if (!best) return std::nullopt;
  const Fit& own = exactly[*best];
  const double rival_px = own.lights == PoseDoubt::kFew
                              ? kFourLeadRms * std::max(own.rms_px, kFourLeast_px)
                              : kLeadRms * own.rms_px;
  for (const Fit& other : exactly) {
    // Noise makes one light two.
    if (&other != &own && other.lights + kLeadLights > own.lights &&
        other.rms_px < rival_px) {
      return std::nullopt;
    }
  }
  resolver_ = learnt;
  return told;
}

double RelativeEstimator::placed_rms_max_px(const Pose& X_NB) const {
  const double range = (X_NB.translation() - camera_.X_NC.translation()).norm();
  const double led_px =
      config_.finder.led_sd_m * camera_.intrinsics.fx / std::max(range, 0.05);
  return config_.placed_sds * std::hypot(config_.placed_sd_px, led_px);
}

double RelativeEstimator::rest_rms_max_px(const Pose& X_NB) const {
  return std::max(config_.reprojection_max_px, placed_rms_max_px(X_NB));
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
  const auto found =
      associate_at_rest(config_.rest, camera_written_, leds_written_,
                        {lights.data(), lights.size()}, X_NB_expected_, leds_least);
  if (!found) return fail(found.error());
  Assignment match;
  for (std::size_t i = 0; i < kMaxLeds; ++i) {
    const int light = (*found)[i];
    if (light >= 0) match.blob[i] = blob_of[static_cast<std::size_t>(light)];
  }
  frame.seen = observations(match, images, blobs, 0);
  return alight::calibrate_at_rest(config_.rest, camera_written_, leds_written_,
                                   {frame.seen.data(), frame.seen.size()},
                                   X_NB_expected_);
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
