#include "alight/vision/led_resolver.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "alight/base/bounds.h"
#include "alight/base/median.h"
#include "alight/vision/led_resolver_parts.h"

namespace alight {
namespace {

constexpr std::size_t kSureLeds = 3;   // with blobs of their own, before dim ones count
constexpr double kGoodChi2 = 3;        // per pixel; a worse fit is tried again
constexpr double kStrangerReach = 15;  // px around the constellation
// An edge covers parts of so many LEDs at once; where more are unlike LEDs they are
// blurred, all of them, and their middles still tell.
constexpr int kCoveredAtOnce = 2;
// A blob is an LED's own up to so many times the area of one that is as bright, nearly.
constexpr double kOutgrown = 1.8, kAsBright = 0.8;

}  // namespace

Result<void> LedResolverConfig::validate() const {
  return check_bounds({{"resolver.area_max_px", area_max_px, 0, 1e4},
                       {"resolver.touch", touch, 0.5, 4},
                       {"resolver.dim_reach_px", dim_reach_px, 0, 10},
                       {"resolver.sd_floor_px", sd_floor_px, 1e-3, 10},
                       {"resolver.spread_sd_px", spread_sd_px, 0.5, 3},
                       {"resolver.spread_share", spread_share, 0.01, 1},
                       {"resolver.spread_memory", spread_memory, 1, 1e6}});
}

Result<LedResolver> LedResolver::create(const LedResolverConfig& config,
                                        const Camera& camera,
                                        const Constellation& leds) {
  if (const auto valid = config.validate(); !valid) return fail(valid.error());
  return LedResolver(config, camera, leds);
}

LedResolver::LedResolver(const LedResolverConfig& config, const Camera& camera,
                         const Constellation& leds)
    : config_(config),
      camera_(camera),
      leds_(leds),
      spread_{config.spread_sd_px * config.spread_sd_px, config.spread_share} {}

void LedResolver::forget_lights() {
  LedResolver anew(config_, camera_, leds_);
  anew.lit_ = lit_;
  anew.dark_ = dark_;
  anew.spread_.noise_variance = spread_.noise_variance;
  *this = anew;
}

void LedResolver::set_noise(const PictureNoise& noise) {
  spread_.noise_variance = std::max(kNoiseUsual, noise.luminance_variance);
}

void LedResolver::resolve(const ImageView& image, BlobSpan blobs,
                          const TrackDetail& detail, std::span<const Vector2> blur_px,
                          LedFrame& frame) {
  const LedImages& images = detail.images;
  const Assignment& match = detail.match;

  // Patches with blobs first; what they say of the pose shows where to look for the
  // rest.
  bool all = true;
  const auto has_blob = [](const Patch& patch) { return patch.area_px > 0; };
  Look look = look_at(image, blobs, match, images, blur_px, 0);
  Patches patches = fitted(look, has_blob);
  if (judged_ == 0) {
    // What the first picture tells of the camera's lights, it tells of its own, too.
    for (const Patch& patch : patches) learn_spread(patch);
    for (std::size_t i = 0; i < static_cast<std::size_t>(leds_.size()); ++i) {
      look_around(look, patches, i);
    }
    fit_all(look, patches, has_blob);
    for (const Patch& patch : patches) learn(patch);
  }
  for (Patch& patch : patches) {
    all = all && patch.fit && patch.fit->chi2_per_pixel < kGoodChi2;
  }
  const auto collect = [&] {
    LedFrame out;
    const bool covered =
        std::count_if(patches.begin(), patches.end(), [&](const Patch& patch) {
          return misshapen(patch);
        }) <= kCoveredAtOnce;
    for (const Patch& patch : patches) {
      if (patch.fit) {
        add(patch, blobs, match, out);
        continue;
      }
      // Several LEDs in a blob that cannot be told apart: no place of any.
      for (const LedObservation& o : frame.seen) {
        const int first = std::countr_zero(o.leds);
        if (std::find(patch.members.begin(), patch.members.end(), first) !=
                patch.members.end() &&
            std::popcount(o.leds) == static_cast<int>(patch.members.size())) {
          const auto n = static_cast<std::size_t>(first);
          const int j = match.blob[n];
          if (patch.members.size() > 1 || j < 0) {
            out.seen.push_back(o);
            continue;
          }
          const Blob& blob = blobs[static_cast<std::size_t>(j)];
          if (runs_on(blob, blur_px[n]) || (covered && misshapen(patch)) ||
              outgrown(patch, patches)) {
            continue;
          }
          out.seen.push_back(o);
          out.seen.back().cov += displacement(first, blob);
        }
      }
    }
    return out;
  };
  compare_lights(look, patches, detail.X_NB_predicted);
  LedFrame out = collect();
  const bool sure = out.seen.size() >= kSureLeds;  // all of them have blobs so far
  if (!all && out.seen.size() >= 2) {
    const auto pose = refine_pose(camera_, leds_, {out.seen.data(), out.seen.size()},
                                  detail.X_NB_predicted, &detail.prior_information, 6);
    if (pose) {
      const LedImages again = led_images(camera_, leds_, pose->X_NB);
      Look anew{image, blobs, match, again, blur_px, 0, look.lights};
      for (Patch& patch : patches) {
        if (patch.fit && patch.fit->chi2_per_pixel < kGoodChi2) continue;
        if (patch.area_px == 0 && (patch.members.size() > 1 || !sure)) continue;
        fit(anew, patch);
      }
      compare_lights(look, patches, detail.X_NB_predicted);
      out = collect();
    }
  }
  learn_from(look, patches);
  for (const Patch& patch : patches) {
    const int j = match.blob[static_cast<std::size_t>(patch.members[0])];
    if (patch.fit || patch.members.size() > 1 || j < 0) continue;
    const Blob& blob = blobs[static_cast<std::size_t>(j)];
    if (runs_on(blob, blur_px[static_cast<std::size_t>(patch.members[0])]) ||
        outgrown(patch, patches)) {
      frame.refused.push_back({blob.uv, Refusal::too_large});
    }
  }
  frame.seen = out.seen;
  frame.groups = out.groups;
  std::uint16_t lit = 0;
  for (const LedObservation& o : out.seen) {
    if (std::has_single_bit(o.leds)) lit = static_cast<std::uint16_t>(lit | o.leds);
  }
  remember_lit(lit);
}

void LedResolver::remember_lit(std::uint16_t lit) {
  lit_ = lit;
  for (std::size_t i = 0; i < static_cast<std::size_t>(leds_.size()); ++i) {
    dark_[i] = ((lit >> i) & 1) != 0 ? 0 : std::min(dark_[i] + 1, kDeadAfter);
  }
}

std::optional<LedFrame> LedResolver::follow(const ImageView& image, BlobSpan blobs,
                                            const Pose& X_NB_predicted, double gate_px,
                                            std::span<const Vector2> blur_px, Time t) {
  LedImages images = led_images(camera_, leds_, X_NB_predicted);
  if (images.count < leds_.size()) return std::nullopt;
  // What all have in common: the middle of the shifts of LEDs that stand alone.
  const auto nearest = [&](const Vector2& uv, double reach) {
    int best = -1;
    for (std::size_t j = 0; j < blobs.size(); ++j) {
      const double d = (blobs[j].uv - uv).norm();
      if (blobs[j].cut || d >= reach) continue;
      reach = d;
      best = static_cast<int>(j);
    }
    return best;
  };
  const double alone = config_.touch * spot_reach_px(spread_, Vector2::Zero());
  FixedVector<double, kMaxLeds> du, dv;
  for (int i = 0; i < leds_.size(); ++i) {
    const Vector2& uv = images.uv[static_cast<std::size_t>(i)];
    bool single = true;
    for (int k = 0; k < leds_.size() && single; ++k) {
      single = k == i || (images.uv[static_cast<std::size_t>(k)] - uv).norm() > alone;
    }
    const int j = single ? nearest(uv, gate_px) : -1;
    if (j < 0) continue;
    du.push_back(blobs[static_cast<std::size_t>(j)].uv.x() - uv.x());
    dv.push_back(blobs[static_cast<std::size_t>(j)].uv.y() - uv.y());
  }
  if (du.size() >= 2) {
    const Vector2 shift(median(du.begin(), du.end()), median(dv.begin(), dv.end()));
    for (Vector2& uv : images.uv) uv += shift;
    images.middle += shift;
  }

  // Every blob in reach of an LED is its own, or nobody's business here.
  Assignment match;
  for (int i = 0; i < leds_.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    const int j = nearest(images.uv[n], alone);
    if (j < 0) continue;
    const Blob& blob = blobs[static_cast<std::size_t>(j)];
    if (blob.stray) return std::nullopt;
    if (config_.use_color && !colors_agree(blob.color, leds_.color(i), true)) {
      return std::nullopt;
    }
    match.blob[n] = j;
  }
  // A lamp in front of an LED is seen in its place.
  FixedVector<double, kMaxLeds> areas;
  const bool all_lit = std::popcount(lit_) == leds_.size();
  for (const int j : match.blob) {
    if (j < 0) continue;
    // LEDs that run together share theirs; dark ones cover nothing.
    const auto sharing = std::count(match.blob.begin(), match.blob.end(), j);
    areas.push_back(blobs[static_cast<std::size_t>(j)].area_px /
                    static_cast<double>(all_lit ? sharing : 1));
  }
  if (areas.size() > 0 && *std::max_element(areas.begin(), areas.end()) >
                              kLargestImage * median(areas.begin(), areas.end())) {
    return std::nullopt;
  }
  LedFrame out;
  out.t = t;
  Look look = look_at(image, blobs, match, images, blur_px, 0);
  Patches patches = fitted(look, [](const Patch&) { return true; });
  compare_lights(look, patches, X_NB_predicted);
  for (Patch& patch : patches) {
    if (patch.fit) {
      add(patch, blobs, match, out);
      continue;
    }
    if (patch.area_px == 0) continue;
    // A single large or full one stays what its blob says.
    const auto n = static_cast<std::size_t>(patch.members[0]);
    if (patch.members.size() > 1) return std::nullopt;
    const Blob& blob = blobs[static_cast<std::size_t>(match.blob[n])];
    if (patch.area_px <= config_.area_max_px && !blob.saturated) return std::nullopt;
    if (misshapen(patch) || outgrown(patch, patches)) return std::nullopt;
    if (runs_on(blob, blur_px[n])) return std::nullopt;
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << n);
    o.uv = blob.uv;
    o.cov = blob.cov + displacement(static_cast<int>(n), blob);
    o.depth_m = blob.depth_m;
    out.seen.push_back(o);
  }
  std::uint16_t lit = 0;
  for (const LedObservation& o : out.seen)
    lit = static_cast<std::uint16_t>(lit | o.leds);
  if (out.seen.size() < 4 || (lit_ & ~lit) != 0) return std::nullopt;
  const double around = images.size_px + kStrangerReach;
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    if (is_used(match, static_cast<int>(j))) continue;
    // It may be the LED that is missing.
    const double d = (blobs[j].uv - images.middle).norm();
    if (out.seen.size() < static_cast<std::size_t>(leds_.size()) && d < around &&
        !blobs[j].stray) {
      return std::nullopt;
    }
    out.refused.push_back(unmatched(blobs[j]));
  }
  remember_lit(lit);
  learn_from(look, patches);
  return out;
}

bool LedResolver::outgrown(const Patch& patch, const Patches& patches) const {
  const double height = heights_[static_cast<std::size_t>(patch.members[0])];
  if (patch.fit || patch.members.size() > 1 || height == 0) return false;
  double largest_px = 0;
  for (const Patch& other : patches) {
    if (!other.fit || other.members.size() > 1) continue;
    if (other.fit->height[0] > kAsBright * height) {
      largest_px = std::max(largest_px, other.area_px);
    }
  }
  return largest_px > 0 && patch.area_px > kOutgrown * largest_px;
}

bool LedResolver::misshapen(const Patch& patch) const {
  const auto led = static_cast<std::size_t>(patch.members[0]);
  return !patch.fit && patch.unlike && heights_[led] > 0;
}

}  // namespace alight
