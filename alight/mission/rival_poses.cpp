#include "alight/mission/rival_poses.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/base/median.h"

namespace alight {
namespace {

constexpr double kMost_chi2 = 9;    // that one blob says for or against a pose
constexpr double kUnexplained = 6;  // cost of a light that is none of its LEDs,
constexpr double kMissing = 1;      // and of an LED: what is dead is so all the time
constexpr double kStill_px = 1;     // sd of how a light that stands still is seen
constexpr double kFloor_px = 0.02;  // no light's place is known better
constexpr double kNoFit = 1000;     // chi2 of lights that no pose fits
constexpr int kSteps = 5;
constexpr double kShift_px = 12;     // farthest that lamps move between two pictures
constexpr std::size_t kCrowd = 12;   // lights from which on they tell how lamps move
constexpr double kVelocitySd = 1.5;  // m/s, of a pose just found

bool alike(const Pose& a, const Pose& b) {
  return (a.translation() - b.translation()).norm() < 0.15 &&
         angle_between(a.linear(), b.linear()) < 12 * kDegree;
}

}  // namespace

RivalPoses::RivalPoses(const RivalPosesConfig& config, const Camera& camera,
                       const RelativeFilter& filter)
    : config_(config), camera_(camera) {
  rivals_.assign(kMost, Rival(filter));
  shift_u_.reserve(kMaxBlobs);
  shift_v_.reserve(kMaxBlobs);
}

void RivalPoses::clear() {
  for (Rival& rival : rivals_) rival.alive = false;
  before_.clear();
}

void RivalPoses::set_rig(const Camera& camera, const RelativeFilter& filter) {
  camera_ = camera;
  clear();
  for (Rival& rival : rivals_) rival.filter = filter;
}

Vector2 RivalPoses::common_shift(BlobSpan blobs) const {
  return before_.size() < kCrowd || blobs.size() < kCrowd ? Vector2(0, 0) : shift_;
}

void RivalPoses::remember(BlobSpan blobs) {
  before_.clear();
  for (const Blob& blob : blobs) before_.push_back(blob.uv);
}

double RivalPoses::cost_of(const RelativeFilter& filter, const LedFrame& frame) const {
  FixedVector<LedObservation, kMaxLeds> seen = frame.seen;
  for (LedObservation& o : seen) o.cov += kFloor_px * kFloor_px * Matrix2::Identity();
  // By a fit of its own: a filter that has learnt to expect misfits forgives them.
  const auto fit = refine_pose(camera_, filter.leds(), {seen.data(), seen.size()},
                               filter.state().X_NB(), nullptr, kSteps);
  const auto lights = static_cast<double>(seen.size());
  const double misfit = std::log1p((fit ? fit->chi2 : kNoFit) / 2);
  return std::max(lights - 3, 0.0) * misfit - kUnexplained * lights -
         kMissing * (frame.led_count() - lights);
}

void RivalPoses::follow(Rival& rival, BlobSpan blobs, Time t, const LedTracker& tracker,
                        const MotionSource& motion, Time step) {
  RelativeFilter& filter = rival.filter;
  const auto carried = filter.predict_through(
      t, step, [&](Time at) { return motion.at(at, filter.state()); });
  if (!carried) {
    rival.alive = false;
    return;
  }
  const Matrix6 cov = filter.tracking_covariance().topLeftCorner<6, 6>();
  rival.seen = tracker.track(blobs, filter.state().X_NB(), cov, t);
  bool explained = rival.seen.led_count() >= 4 && rival.seen.seen.size() >= 3;
  double score = 0, moved = 0;
  if (explained) {
    const auto report = filter.update(rival.seen);
    explained = report && report->used >= 3;
    if (explained) {
      rival.rms_px = report->reprojection_px;
      const Vector2 shift = common_shift(blobs);
      for (const ObservationReport& seen : report->seen) {
        // The same place in the last picture, where a light that stands still was.
        double still = kMost_chi2;
        for (const Vector2& uv : before_) {
          const double d2 = (seen.uv - shift - uv).squaredNorm();
          still = std::min(still, d2 / (kStill_px * kStill_px));
        }
        score -= still;
        moved += still - std::min(seen.nis, kMost_chi2);
      }
      rival.fit = cost_of(filter, rival.seen);
      score += rival.fit;
    }
  }
  if (!explained) {
    if (++rival.misses > config_.misses_max) rival.alive = false;
    // As many lights may be its LEDs as the last time, if it can but tell them apart.
    rival.score = config_.remembers * rival.score + rival.last + kUnexplained;
    return;
  }
  rival.misses = 0;
  ++rival.pictures;
  rival.last = score;
  rival.score = config_.remembers * rival.score + score;
  rival.moved = config_.remembers * rival.moved + moved;
  const auto push = filter.push();
  rival.leans =
      push ? std::min(push->against(filter.state().R_NB.col(2), config_.across_sd),
                      config_.leans_most)
           : 0;
}

void RivalPoses::add(const LedRival& fresh, BlobSpan blobs, Time t,
                     const LedTracker& tracker) {
  Rival* place = nullptr;
  for (Rival& rival : rivals_) {
    if (rival.alive && alike(rival.filter.state().X_NB(), fresh.X_NB)) {
      rival.by_chance = rival.by_chance && fresh.by_chance;
      return;
    }
    if (!rival.alive) {
      if (place == nullptr || place->alive) place = &rival;
    } else if (rival.misses > 0 &&
               (place == nullptr || (place->alive && rival.score > place->score))) {
      // Who explains the pictures keeps his place.
      place = &rival;
    }
  }
  if (place == nullptr) return;
  RelativeState x;
  x.p_NB = fresh.X_NB.translation();
  x.R_NB = fresh.X_NB.linear();
  Covariance9 cov = Covariance9::Zero();
  cov.topLeftCorner<6, 6>() = fresh.cov;
  cov.diagonal().head<6>().array() += 1e-6;
  cov.bottomRightCorner<3, 3>().diagonal().setConstant(kVelocitySd * kVelocitySd);
  place->filter.reset(t, x, cov);
  // What one picture alone is enough to propose starts level with who came before it:
  // that the finder did not think of it earlier is no evidence. How it fits is, for so
  // it would have fitted all the time.
  const Rival* first = nullptr;
  for (const Rival& rival : rivals_) {
    if (!rival.alive || &rival == place || rival.score >= 0) continue;
    if (first == nullptr || rival.score < first->score) first = &rival;
  }
  place->alive = true;
  place->by_chance = fresh.by_chance;
  place->pictures = place->misses = 0;
  place->fit = cost_of(place->filter, tracker.track(blobs, fresh.X_NB, fresh.cov, t));
  place->score = place->last = place->leans = place->moved = 0;
  if (first == nullptr || fresh.by_chance) return;
  place->score =
      first->score + std::max(place->fit - first->fit, 0.0) / (1 - config_.remembers);
}

Result<FoundLeds> RivalPoses::decide(BlobSpan blobs, Time t,
                                     std::span<const LedRival> fresh,
                                     const LedTracker& tracker,
                                     const MotionSource& motion, Time step) {
  const double silent = to_seconds(t - last_);
  if (!(silent > 0 && silent < config_.silence_max_s)) clear();
  last_ = t;
  shift_u_.clear();
  shift_v_.clear();
  for (const Blob& blob : blobs) {
    double nearest = kShift_px;
    Vector2 by = Vector2::Zero();
    for (const Vector2& uv : before_) {
      const double d = (blob.uv - uv).norm();
      if (d >= nearest) continue;
      nearest = d;
      by = blob.uv - uv;
    }
    if (nearest >= kShift_px) continue;
    shift_u_.push_back(by.x());
    shift_v_.push_back(by.y());
  }
  shift_ = shift_u_.empty() ? Vector2(0, 0)
                            : Vector2(median(shift_u_.begin(), shift_u_.end()),
                                      median(shift_v_.begin(), shift_v_.end()));

  for (Rival& rival : rivals_) {
    if (rival.alive) follow(rival, blobs, t, tracker, motion, step);
  }
  // Two that came to the same are one.
  for (Rival& rival : rivals_) {
    for (Rival& other : rivals_) {
      if (&rival == &other || !rival.alive || !other.alive ||
          !alike(rival.filter.state().X_NB(), other.filter.state().X_NB())) {
        continue;
      }
      Rival& younger = rival.pictures < other.pictures ? rival : other;
      Rival& older = &younger == &rival ? other : rival;
      older.by_chance = older.by_chance && younger.by_chance;
      younger.alive = false;
    }
  }
  for (const LedRival& rival : fresh) add(rival, blobs, t, tracker);
  remember(blobs);
  return verdict();
}

Result<FoundLeds> RivalPoses::verdict() const {
  const Rival* best = nullptr;
  for (const Rival& rival : rivals_) {
    const int needed = rival.by_chance ? config_.pictures_by_chance : config_.pictures;
    if (!rival.alive || rival.pictures < needed || rival.misses > 0) continue;
    if (best == nullptr || rival.total() < best->total()) best = &rival;
  }
  if (best == nullptr) return fail(Fault::too_few_points);
  if (best->by_chance && best->moved < config_.own_motion) {
    return fail(Fault::ambiguous);
  }
  for (const Rival& rival : rivals_) {
    // Who has not yet explained one more picture is no rival to who explained many.
    if (!rival.alive || &rival == best || rival.pictures == 0) continue;
    if (rival.total() < best->total() + config_.margin) return fail(Fault::ambiguous);
  }
  FoundLeds found;
  found.frame = best->seen;
  found.fit.X_NB = best->filter.state().X_NB();
  found.fit.cov = best->filter.covariance().topLeftCorner<6, 6>();
  found.fit.rms_px = best->rms_px;
  found.score = best->total();
  found.runner_up_score = std::numeric_limits<double>::infinity();
  const double range =
      (found.fit.X_NB.translation() - camera_.X_NC.translation()).norm();
  const double turn = std::sqrt(found.fit.cov.diagonal().tail<3>().maxCoeff());
  const double place = std::sqrt(found.fit.cov.diagonal().head<3>().maxCoeff());
  if (turn > config_.turn_sd_max_deg * kDegree ||
      place > config_.place_sd_max_share * range) {
    return fail(Fault::ambiguous);
  }
  return found;
}

}  // namespace alight
