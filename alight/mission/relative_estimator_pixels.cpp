// What pixels say of poses that were found from blobs.
#include <algorithm>
#include <bit>

#include "alight/geometry/near.h"
#include "alight/mission/relative_estimator.h"

namespace alight {
namespace {

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

}  // namespace alight
