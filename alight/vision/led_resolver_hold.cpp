// How LedResolver goes on beside lamps that cover LEDs.
#include <algorithm>
#include <bit>
#include <cmath>

#include "alight/vision/led_resolver_parts.h"

namespace alight {
namespace {

constexpr int kHoldMargin = 1;        // px around a lamp that its light reaches
constexpr double kHoldGate = 3;       // standard deviations, besides
constexpr double kHoldSlack = 0.4;    // px
constexpr double kHoldPlaceSd = 0.5;  // px; a worse place may be a lamp's doing
constexpr double kHoldChi2 = 3;       // per pixel, times what is usual
constexpr double kHoldHeight = 2.5;   // factor by which an LED's light may change
constexpr double kFull = 200;         // grey levels; brighter LEDs may look white

}  // namespace

bool LedResolver::is_its_own(const Blob& blob, int led, const Vector2& blur_px) const {
  const double height = heights_[static_cast<std::size_t>(led)];
  const bool may_be_white = height == 0 || height > kFull;
  if (config_.use_color && !colors_agree(blob.color, leds_.color(led), may_be_white)) {
    return false;
  }
  const double widest = 2 * spot_reach_px(spread_, blur_px) + 2;
  return !blob.cut && !blob.stray && blob.area_px <= config_.area_max_px &&
         blob.box.u1 - blob.box.u0 <= widest && blob.box.v1 - blob.box.v0 <= widest;
}

LedFrame LedResolver::hold(const ImageView& image, BlobSpan blobs,
                           const Pose& X_NB_predicted, const Matrix6& cov,
                           double slack_px, std::span<const Vector2> blur_px, Time t) {
  LedFrame out;
  out.t = t;
  const LedImages images = led_images(camera_, leds_, X_NB_predicted);
  if (images.count < leds_.size()) return out;
  const auto count = static_cast<std::size_t>(leds_.size());
  std::array<double, kMaxLeds> variance{};  // of the expected images, px^2
  for (std::size_t i = 0; i < count; ++i) {
    Matrix26 J;
    project_led(camera_, X_NB_predicted, leds_.p_BL(static_cast<int>(i)), &J);
    const Matrix2 S = J * cov * J.transpose();
    variance[i] = S.trace();
    if (!(variance[i] <= 2 * kHoldSd * kHoldSd)) return out;
  }

  // An LED's own blob stands where it is expected, or half way to a neighbour with
  // which it runs together.
  const double touch = config_.touch * spot_reach_px(spread_, Vector2::Zero());
  Assignment match;
  std::uint16_t beside_lamp = 0;
  for (std::size_t i = 0; i < count; ++i) {
    double aside = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double d = (images.uv[k] - images.uv[i]).norm();
      if (k != i && d < touch) aside = std::max(aside, d / 2);
    }
    double reach = kHoldGate * std::sqrt(variance[i]) + kHoldSlack + slack_px + aside;
    for (std::size_t j = 0; j < blobs.size(); ++j) {
      const double d = (blobs[j].uv - images.uv[i]).norm();
      if (d >= reach) continue;
      if (is_its_own(blobs[j], static_cast<int>(i), blur_px[i])) {
        reach = d;
        match.blob[i] = static_cast<int>(j);
      } else if (blobs[j].area_px > config_.area_max_px && !blobs[j].stray &&
                 (heights_[i] == 0 || heights_[i] > kFull)) {
        return out;  // near the lens LEDs are as large as lamps
      }
    }
    if (match.blob[i] >= 0) continue;
    for (const Blob& blob : blobs) {
      const Vector2& uv = images.uv[i];
      if (uv.x() > blob.box.u0 - touch && uv.x() < blob.box.u1 + touch &&
          uv.y() > blob.box.v0 - touch && uv.y() < blob.box.v1 + touch) {
        beside_lamp = static_cast<std::uint16_t>(beside_lamp | (1u << i));
      }
    }
  }

  std::uint16_t lit = 0;
  Look look = look_at(image, blobs, match, images, blur_px, kHoldMargin);
  Patches patches = this->patches(images, blobs, match, nullptr);
  fit_all(look, patches, [](const Patch&) { return true; });
  compare_lights(look, patches, X_NB_predicted);
  for (const Patch& patch : patches) {
    if (!patch.fit || patch.fit->chi2_per_pixel > kHoldChi2 * std::max(noise_, 1.0)) {
      continue;
    }
    LedFrame seen;
    add(patch, blobs, match, seen);
    bool sure = !seen.seen.empty();
    for (const LedObservation& o : seen.seen) {
      const auto i = static_cast<std::size_t>(std::countr_zero(o.leds));
      const double most =
          kHoldGate * std::sqrt(variance[i] + o.cov.trace()) + kHoldSlack + slack_px;
      sure = sure && (o.uv - images.uv[i]).norm() < most &&
             o.cov.trace() < 2 * kHoldPlaceSd * kHoldPlaceSd;
      const auto member =
          std::find(patch.members.begin(), patch.members.end(), static_cast<int>(i)) -
          patch.members.begin();
      const double usual = heights_[i];
      const double now = patch.fit->height[static_cast<std::size_t>(member)];
      // Without a blob only a light that is known.
      sure = sure && (usual > 0 ? now < kHoldHeight * usual && usual < kHoldHeight * now
                                : match.blob[i] >= 0);
    }
    if (!sure) continue;
    for (OverlappingLeds group : seen.groups) {
      group.first += static_cast<int>(out.seen.size());
      out.groups.push_back(group);
    }
    for (const LedObservation& o : seen.seen) {
      out.seen.push_back(o);
      lit = static_cast<std::uint16_t>(lit | o.leds);
    }
  }
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    if (!is_used(match, static_cast<int>(j))) {
      out.refused.push_back(unmatched(blobs[j]));
    }
  }
  // What a lamp covers shines on.
  lit_ = static_cast<std::uint16_t>(lit | (lit_ & beside_lamp));
  return out;
}

}  // namespace alight
