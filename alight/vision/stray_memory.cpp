#include "alight/vision/stray_memory.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr int kKnownAfter = 3;  // pictures: its way has been foretold once
// How near to where it is expected it is, px, once its way is known: a platform that
// turns faster and faster, and noise; and how far it may have come before.
constexpr double kOnItsWay = 0.75, kFirstStep = 6;
// Nothing so near to an LED, px beyond the size of its own image, tells of strays it
// does not know; and what is half as near may be the LED, or both run together.
constexpr double kApart = 8;
constexpr Seconds kHidden = 0.1;  // and it is still expected

}  // namespace

bool StrayMemory::Stray::known() const { return pictures >= kKnownAfter; }

BlobSpan StrayMemory::mark(BlobSpan blobs, Time t) {
  if (std::none_of(strays_.begin(), strays_.end(),
                   [](const Stray& s) { return s.known(); })) {
    return blobs;
  }
  marked_.clear();
  for (const Blob& blob : blobs) {
    marked_.push_back(blob);
    marked_.back().stray =
        std::any_of(strays_.begin(), strays_.end(), [&](const Stray& s) {
          return s.known() && (blob.uv - s.at(t)).norm() < kOnItsWay;
        });
  }
  return {marked_.data(), marked_.size()};
}

void StrayMemory::remember(BlobSpan blobs, const LedImages& leds, bool sure, Time t) {
  anew_.clear();
  for (const Blob& blob : blobs) {
    if (blob.cut) continue;
    double to_led = 1e9;
    for (std::size_t i = 0; i < kMaxLeds; ++i) {
      if (leds.in_front[i]) to_led = std::min(to_led, (blob.uv - leds.uv[i]).norm());
    }
    const double apart = kApart + std::sqrt(blob.area_px);
    const bool far = to_led > apart;
    if (!far && !(blob.stray && to_led > apart / 2)) continue;
    const Stray* before = nullptr;
    double nearest = kFirstStep;
    for (const Stray& s : strays_) {
      const double d = (blob.uv - s.at(t)).norm();
      if (d >= (s.pictures > 1 ? std::min(kOnItsWay, nearest) : nearest)) continue;
      nearest = d;
      before = &s;
    }
    if (before == nullptr && !(sure && far)) continue;
    Stray s;
    s.uv = blob.uv;
    s.seen = t;
    if (before != nullptr) {
      s.way = (blob.uv - before->uv) / std::max(to_seconds(t - before->seen), 1e-3);
      s.pictures = before->pictures + 1;
    }
    anew_.push_back(s);
  }
  for (const Stray& s : strays_) {
    const auto same = [&](const Stray& other) {
      return (other.uv - s.at(t)).norm() < kOnItsWay;
    };
    if (!s.known() || to_seconds(t - s.seen) > kHidden ||
        std::any_of(anew_.begin(), anew_.end(), same)) {
      continue;
    }
    anew_.push_back(s);
  }
  strays_ = anew_;
}

}  // namespace alight
