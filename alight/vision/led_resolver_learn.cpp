// What LedResolver learns of the lights of a drone from the pictures of them.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "alight/vision/led_resolver_parts.h"

namespace alight {
namespace {

constexpr double kSpreadLeast = 0.3, kSpreadMost = 9;  // px^2
constexpr int kSkirtEvery = 4;                         // pictures, once it is known
constexpr double kSkirtBlur = 1;  // px; a longer streak has another skirt
constexpr int kColorMemory = 30;  // times an LED is seen alone
constexpr int kLampReach = 3;     // px around a lamp that its light reaches

}  // namespace

void LedResolver::learn(const Patch& patch) {
  if (!patch.fit) return;
  const SpotFit& fit = *patch.fit;
  for (std::size_t k = 0; k < patch.members.size(); ++k) {
    heights_[static_cast<std::size_t>(patch.members[k])] = fit.height[k];
  }
  if (fit.count == 1 && known(fit.color)) learn_color(patch.members[0], fit.color);
  // How large residuals are that this camera leaves: its noise, and what the model of
  // a light lacks.
  judged_ = std::min(judged_ + 1, config_.spread_memory);
  noise_ +=
      (std::clamp(fit.chi2_per_pixel, kNoiseLeast, kNoiseMost) - noise_) / judged_;
}

void LedResolver::learn_color(int led, const LightColor& color) {
  const auto i = static_cast<std::size_t>(led);
  colors_seen_[i] = std::min(colors_seen_[i] + 1, kColorMemory);
  for (std::size_t c = 0; c < color.size(); ++c) {
    colors_[i][c] += (color[c] - colors_[i][c]) / static_cast<float>(colors_seen_[i]);
  }
  if (colors_seen_[i] > 1) return;
  // LEDs that are written down alike look alike, until they have been looked at.
  for (int k = 0; k < leds_.size(); ++k) {
    const auto n = static_cast<std::size_t>(k);
    if (colors_seen_[n] == 0 && !known(colors_[n]) &&
        leds_.color(k) == leds_.color(led)) {
      colors_[n] = colors_[i];
    }
  }
}

void LedResolver::compare_lights(const Look& look, const Patches& patches,
                                 const Pose& X_NB) {
  LightShare::Heights heights{}, areas_px{};
  for (const Patch& patch : patches) {
    for (std::size_t k = 0; k < patch.members.size(); ++k) {
      const auto i = static_cast<std::size_t>(patch.members[k]);
      const int j = look.match.blob[i];
      if (patch.fit) {
        heights[i] = patch.fit->height[k];
      } else if (j >= 0 && patch.members.size() == 1) {
        const Blob& blob = look.blobs[static_cast<std::size_t>(j)];
        if (!runs_on(blob, look.blur_px[i])) areas_px[i] = blob.area_px;
      }
    }
  }
  const double range_m = (X_NB.translation() - camera_.X_NC.translation()).norm();
  share_.look(heights, range_m);
  area_share_.look(areas_px, range_m);
}

Matrix2 LedResolver::displacement(int led, const Blob& blob) const {
  // An even disc has half its radius for standard deviation.
  const double off =
      area_share_.displaced_px(led, std::sqrt(blob.area_px / std::numbers::pi) / 2);
  return off * off * Matrix2::Identity();
}

void LedResolver::learn_spread(const Patch& patch) {
  if (!patch.fit) return;
  const SpotFit& fit = *patch.fit;
  if (!(fit.variance_information > 0)) return;
  const double own = 1 / fit.variance_information;  // variance of what it found
  const double share = config_.spread_share * spread_.variance_px2;
  if (own > share * share) return;
  known_ = std::min(known_ + 1, config_.spread_memory);
  spread_.variance_px2 += (fit.variance_px2 - spread_.variance_px2) / (known_ + 1);
  spread_.variance_px2 = std::clamp(spread_.variance_px2, kSpreadLeast, kSpreadMost);
  // Lights differ by their distance and brightness: it is never known exactly.
  spread_.share_sd = std::max(config_.spread_share / std::sqrt(known_ + 1), 0.08);
}

void LedResolver::learn_skirt(const Look& look, const Patches& patches) {
  ++pictures_;
  if (skirt_.settled() && pictures_ % kSkirtEvery != 0) return;
  next_ = (next_ + 1) % static_cast<std::size_t>(leds_.size());
  look_around(look, patches, next_);
}

void LedResolver::look_around(const Look& look, const Patches& patches,
                              std::size_t led) {
  const Vector2 middle = look.lights[led].uv;
  FixedVector<LightBeside, kMaxLeds> lights;
  bool seen = false;
  for (const Patch& patch : patches) {
    for (std::size_t k = 0; k < patch.members.size(); ++k) {
      const auto i = static_cast<std::size_t>(patch.members[k]);
      if (!patch.fit) {
        if ((look.images.uv[i] - middle).norm() < 2 * kSkirtBox) return;
        continue;
      }
      seen = seen || i == led;
      const LightBeside light{patch.fit->uv[k], patch.fit->height[k],
                              look.lights[i].color};
      if ((light.uv - middle).norm() < 3 * kSkirtBox) lights.push_back(light);
    }
  }
  if (!seen || look.blur_px[led].norm() > kSkirtBlur) return;
  for (std::size_t j = 0; j < look.blobs.size(); ++j) {
    const Roi& box = look.blobs[j].box;
    const int reach = kSkirtBox + kLampReach;
    const bool near = box.u0 < middle.x() + reach && box.u1 > middle.x() - reach &&
                      box.v0 < middle.y() + reach && box.v1 > middle.y() - reach;
    const auto& own = look.match.blob;
    if (near && std::find(own.begin(), own.end(), static_cast<int>(j)) == own.end()) {
      return;
    }
  }
  const auto found =
      look_at_skirt(look.image, middle, {lights.data(), lights.size()}, spread_);
  if (!found) return;
  skirt_.add(*found, spread_);
}

void LedResolver::learn_from(const Look& look, const Patches& patches) {
  for (const Patch& patch : patches) {
    learn(patch);
    learn_spread(patch);
  }
  learn_skirt(look, patches);
  share_.learn();
  area_share_.learn();
}

}  // namespace alight
