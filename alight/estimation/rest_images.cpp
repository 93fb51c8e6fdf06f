#include "alight/estimation/rest_images.h"

#include <cassert>

namespace alight {
namespace {

constexpr double kElsewhere_px = 2;
constexpr int kStaysFor = 5;  // pictures in a row

}  // namespace

void RestImages::add(int led, const Vector2& uv) {
  assert(led >= 0 && led < kMaxLeds && uv.allFinite());
  Led& seen = leds_[static_cast<std::size_t>(led)];
  const bool elsewhere =
      seen.count > 0 && (uv - seen.sum / seen.count).norm() > kElsewhere_px;
  if (elsewhere && ++seen.elsewhere < kStaysFor) return;
  if (elsewhere) seen = {};
  seen.elsewhere = 0;
  seen.sum += uv;
  ++seen.count;
}

std::optional<Vector2> RestImages::mean(int led, int pictures) const {
  assert(led >= 0 && led < kMaxLeds && pictures > 0);
  const Led& seen = leds_[static_cast<std::size_t>(led)];
  if (seen.count < pictures) return std::nullopt;
  return Vector2(seen.sum / seen.count);
}

}  // namespace alight
