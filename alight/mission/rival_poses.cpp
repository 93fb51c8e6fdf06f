#include "alight/mission/rival_poses.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/base/median.h"

namespace alight {
namespace {

constexpr double kMost_chi2 = 9;     // that one blob says for or against a pose
constexpr double kMissing = 6;       // cost of an LED that is not seen
constexpr double kStill_px = 1;      // sd of how a light that stands still is seen
constexpr double kExact_px = 0.3;    // sd by which LEDs as written leave their places
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
      int leds = 0;
      for (const ObservationReport& seen : report->seen) {
        // The same place in the last picture, where a light that stands still was.
        double still = kMost_chi2;
        for (const Vector2& uv : before_) {
          const double d2 = (seen.uv - shift - uv).squaredNorm();
          still = std::min(still, d2 / (kStill_px * kStill_px));
        }
        const double nis = std::min(seen.nis, kMost_chi2);
        // A filter that has learnt to expect misfits forgives them.
        const double off2 = seen.residual_px.squaredNorm();
        score += nis - still + std::min(off2 / (kExact_px * kExact_px), kMost_chi2);
        moved += still - nis;
        leds += __builtin_popcount(seen.leds);
      }
      score -= kMissing * leds;
    }
  }
  if (!explained) {
    if (++rival.misses > config_.misses_max) rival.alive = false;
    rival.score += kMissing;
    return;
  }
  rival.misses = 0;
  ++rival.pictures;
  rival.score = config_.remembers * rival.score + score;
  rival.moved = config_.remembers * rival.moved + moved;
}

void RivalPoses::add(const LedRival& fresh, Time t) {
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
  // that the finder did not think of it earlier is no evidence.
  double level = 0;
  for (const Rival& rival : rivals_) {
    if (rival.alive && &rival != place) level = std::min(level, rival.score);
  }
  place->alive = true;
  place->by_chance = fresh.by_chance;
  place->pictures = place->misses = 0;
  place->score = fresh.by_chance ? 0 : level;
  place->moved = 0;
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
  for (const LedRival& rival : fresh) add(rival, t);
  remember(blobs);
  return verdict();
}

Result<FoundLeds> RivalPoses::verdict() const {
  const Rival* best = nullptr;
  for (const Rival& rival : rivals_) {
    const int needed = rival.by_chance ? config_.pictures_by_chance : config_.pictures;
    if (!rival.alive || rival.pictures < needed || rival.misses > 0) continue;
    if (best == nullptr || rival.score < best->score) best = &rival;
  }
  if (best == nullptr) return fail(Fault::too_few_points);
  if (best->by_chance && best->moved < config_.own_motion) {
    return fail(Fault::ambiguous);
  }
  for (const Rival& rival : rivals_) {
    // Who has not yet explained one more picture is no rival to who explained many.
    if (!rival.alive || &rival == best || rival.pictures == 0) continue;
    if (rival.score < best->score + config_.margin) return fail(Fault::ambiguous);
  }
  FoundLeds found;
  found.frame = best->seen;
  found.fit.X_NB = best->filter.state().X_NB();
  found.fit.cov = best->filter.covariance().topLeftCorner<6, 6>();
  found.fit.rms_px = best->rms_px;
  found.score = best->score;
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
