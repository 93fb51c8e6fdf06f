#include "alight/mission/pose_doubt.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace alight {
namespace {

// Other readings are looked for in the first picture of few LEDs, the second, the
// fourth and so on, at last in every so many.
constexpr unsigned kLookEvery = 64;
// or, while the drone leans as none does that flies so, in more.
constexpr unsigned kLookEveryInDoubt = 8;
constexpr double kAcrossSds = 3;
constexpr double kRms = 3;  // times the pose's own, of a reading worth a look,
constexpr double kRmsLeast_px = 0.3;  // or so much
constexpr double kEvidenceMost = 20;
// One that pictures speak against is asked again only now and then.
constexpr double kUnlikely = -6;
constexpr unsigned kUnlikelyEvery = 8;
constexpr int kSteps = 5;
// Pictures in a row that show too few of a reading's lights to ask it.
constexpr int kUnaskedMost = 16;
// In which another reading must have held before it counts.
constexpr int kPictures = 4;

}  // namespace

void PoseDoubt::clear() {
  rivals_.clear();
  open_ = false;
  sure_ = looked_ = pictures_ = 0;
}

unsigned PoseDoubt::leds_of(ObservationSpan seen) {
  unsigned leds = 0;
  for (const LedObservation& o : seen) leds |= o.leds;
  return leds;
}

double PoseDoubt::word(double chi2, double other_chi2) const {
  // How exact rig and pixels are is not known: what counts is how many times worse
  // one of them fits.
  return config_.weight * std::log((2 + chi2) / (2 + other_chi2));
}

double PoseDoubt::leans(const Pose& other, const Pose& X_NB) const {
  if (!push_) return 0;
  const double more = push_->against(X_NB.linear().col(2), config_.across_sd) -
                      push_->against(other.linear().col(2), config_.across_sd);
  return std::clamp(more / 2, -config_.across_most, config_.across_most);
}

bool PoseDoubt::apart(const Pose& a, const Pose& b) const {
  return (a.translation() - b.translation()).norm() > config_.apart_m ||
         angle_between(a.linear(), b.linear()) > config_.apart_deg * kDegree;
}

void PoseDoubt::add(const OtherPose& pose, ObservationSpan seen, const Pose& X_NB) {
  Rival rival;
  rival.mirrored = true;
  for (std::size_t n = 0; n < seen.size(); ++n) {
    const auto led = static_cast<std::size_t>(std::countr_zero(seen[n].leds));
    rival.instead[led] = pose.seen[n].leds;
    rival.mirrored = rival.mirrored && seen[n].leds == pose.seen[n].leds;
  }
  for (const Rival& other : rivals_) {
    if (other.instead == rival.instead && !apart(other.pose.fit.X_NB, pose.fit.X_NB)) {
      return;
    }
  }
  rival.pose = pose;
  rival.p_NB_base = X_NB.translation();
  if (rivals_.push_back(rival)) return;
  Rival& least = *std::min_element(
      rivals_.begin(), rivals_.end(),
      [](const Rival& a, const Rival& b) { return a.evidence < b.evidence; });
  if (least.evidence < 0) least = rival;
}

bool PoseDoubt::follow(Rival& rival, const Camera& camera, const Constellation& leds,
                       const LedFinder& plausible, ObservationSpan seen,
                       const Pose& X_NB, double chi2) {
  auto& lights = rival.pose.seen;
  lights.clear();
  FixedVector<LedObservation, kMaxLeds> own;
  unsigned used = 0;
  for (const LedObservation& o : seen) {
    const std::uint16_t instead =
        rival.instead[static_cast<std::size_t>(std::countr_zero(o.leds))];
    if ((used & instead) != 0) return false;
    if (instead == 0) continue;
    used |= instead;
    own.push_back(o);
    lights.push_back(o);
    lights.back().leds = instead;
  }
  if (lights.size() < kFew) return ++rival.unasked < kUnaskedMost;
  rival.unasked = 0;
  if (lights.size() < seen.size()) {
    const auto fit =
        refine_pose(camera, leds, {own.data(), own.size()}, X_NB, nullptr, kSteps);
    if (!fit) return false;
    chi2 = fit->chi2;
  }
  Pose X_NB_0 = rival.pose.fit.X_NB;
  X_NB_0.translation() += X_NB.translation() - rival.p_NB_base;
  rival.p_NB_base = X_NB.translation();
  const auto fit = refine_pose(camera, leds, {lights.data(), lights.size()}, X_NB_0,
                               nullptr, kSteps);
  if (!fit || !plausible.plausible(fit->X_NB)) return false;
  rival.pose.fit = *fit;
  if (rival.mirrored && !apart(fit->X_NB, X_NB)) return false;
  ++rival.pictures;
  rival.evidence =
      std::clamp(config_.remembers * rival.evidence + word(chi2, fit->chi2),
                 -kEvidenceMost, kEvidenceMost);
  return true;
}

void PoseDoubt::look(const Camera& camera, const Constellation& leds, bool use_color,
                     const LedFinder& plausible, ObservationSpan given,
                     const Pose& X_NB) {
  // A light that was none of the LEDs until now may be one of those that are missing.
  const unsigned leds_seen = leds_of(given);
  const bool sure = (leds_seen & ~sure_) == 0;
  if (given.size() < kFew || (sure && given.size() > kFew)) return;
  if ((leds_seen & ~looked_) != 0) pictures_ = 0;
  looked_ |= leds_seen;
  FixedVector<LedObservation, kMaxLeds> exact;
  for (const LedObservation& o : given) {
    exact.push_back(o);
    exact.back().cov += config_.floor_px * config_.floor_px * Matrix2::Identity();
  }
  const ObservationSpan seen(exact.data(), exact.size());
  auto own = refine_pose(camera, leds, seen, X_NB, nullptr, kSteps);
  if (!own) return;
  if (apart(own->X_NB, X_NB)) {
    // The same LEDs say something else, if the filter would only listen.
    const OtherPose other{exact, *own};
    add(other, seen, X_NB);
    own = refine_pose(camera, leds, seen, X_NB, nullptr, 0);
    if (!own) return;
  }
  const double across = push_ ? push_->across(X_NB.linear().col(2)) : 0;
  for (std::size_t n = rivals_.size(); n-- > 0;) {
    if (rivals_[n].evidence < kUnlikely && pictures_ % kUnlikelyEvery != 0) continue;
    if (!follow(rivals_[n], camera, leds, plausible, seen, X_NB, own->chi2)) {
      rivals_.erase(n);
      continue;
    }
    rivals_[n].leans = leans(rivals_[n].pose.fit.X_NB, X_NB);
  }
  ++pictures_;
  const double rms_max = std::max(kRms * own->rms_px, kRmsLeast_px);
  const unsigned every =
      across > kAcrossSds * config_.across_sd ? kLookEveryInDoubt : kLookEvery;
  const bool looks =
      !sure && (std::has_single_bit(pictures_) || pictures_ % every == 0);
  if (looks) {
    OtherPoses others;
    find_other_poses(camera, leds, use_color, plausible, seen, own->X_NB, rms_max,
                     others);
    for (const OtherPose& other : others) add(other, seen, X_NB);
  }
  const auto is_mirrored = [](const Rival& rival) { return rival.mirrored; };
  if (std::none_of(rivals_.begin(), rivals_.end(), is_mirrored)) {
    const auto fit = mirrored_pose(camera, leds, seen, own->X_NB);
    if (fit && plausible.plausible(fit->X_NB) && fit->rms_px < rms_max &&
        apart(fit->X_NB, X_NB)) {
      const OtherPose other{exact, *fit};
      add(other, seen, X_NB);
    }
  }
  open_ = false;
  for (const Rival& rival : rivals_) {
    // One that fits better counts at once where it is not known which LEDs these are,
    // as long as they are seen.
    const bool counts = rival.pictures >= kPictures
                            ? rival.for_it() > -config_.open
                            : !sure && rival.evidence > 0 && rival.unasked == 0;
    open_ = open_ || (counts && apart(rival.pose.fit.X_NB, X_NB));
  }
}

const OtherPose* PoseDoubt::better() const {
  const Rival* best = nullptr;
  for (const Rival& rival : rivals_) {
    if (rival.for_it() < config_.refuted || rival.pictures < kPictures) continue;
    if (best == nullptr || rival.for_it() > best->for_it()) best = &rival;
  }
  return best == nullptr ? nullptr : &best->pose;
}

}  // namespace alight
