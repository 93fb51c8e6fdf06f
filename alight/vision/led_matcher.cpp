#include "alight/vision/led_matcher.h"

#include <algorithm>
#include <cmath>

namespace alight {

LedImages led_images(const Camera& camera, const Constellation& leds,
                     const Pose& X_NB) {
  LedImages out;
  for (int i = 0; i < leds.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    const auto uv = project_led(camera, X_NB, leds.p_BL(i));
    out.in_front[n] = uv.has_value();
    out.uv[n] = uv.value_or(Vector2::Zero());
    if (!uv) continue;
    out.middle += *uv;
    ++out.count;
  }
  if (out.count > 0) out.middle /= out.count;
  for (int i = 0; i < leds.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    if (!out.in_front[n]) continue;
    out.size_px = std::max(out.size_px, (out.uv[n] - out.middle).norm());
  }
  return out;
}

namespace {

/// Whether the blob that shows LED k shows LED i as well.
bool shows_both(const Blob& blob, const Vector2& uv_k, const Vector2& uv_i) {
  const Vector2 apart = uv_i - uv_k;
  const double d = apart.norm();
  if (d < 1) return true;
  const double alone = (blob.uv - uv_k).norm();
  const double both = (blob.uv - (uv_k + uv_i) / 2).norm();
  // Two lights d apart are d^2 / 4 wider along their line than across it.
  const Vector2 along = apart / d;
  const Vector2 across(-along.y(), along.x());
  const double wider =
      along.dot(blob.spread * along) - across.dot(blob.spread * across);
  const double shape = wider / (d * d / 4);  // 1: both, 0: one
  // Shape decides where it speaks clearly (the place of a blob that a pose was fitted
  // to as one LED is no witness against it); between, the place does.
  return both - alone < 2 * (shape - 0.35) * d;
}

}  // namespace

Assignment match_leds(const LedImages& images, const Constellation& leds,
                      BlobSpan blobs, std::span<const int> candidates,
                      const MatchRule& rule) {
  struct Pair {
    double cost;
    int led, blob;
  };
  std::array<Pair, 128> pairs;
  std::size_t count = 0;
  const double reach2 = rule.tolerance_px * rule.tolerance_px;
  for (int i = 0; i < leds.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    if (!images.in_front[n]) continue;
    for (const int j : candidates) {
      const Blob& blob = blobs[static_cast<std::size_t>(j)];
      const double d2 = (blob.uv - images.uv[n]).squaredNorm();
      if (d2 > reach2 || count == pairs.size()) continue;
      double cost = d2;
      if (rule.use_color) {
        if (!colors_agree(blob.color, leds.color(i), rule.white_is_any)) continue;
        const bool washed = blob.color == LedColor::white &&
                            leds.color(i) != LedColor::white &&
                            leds.color(i) != LedColor::none;
        if (washed) cost += reach2 / 2;
      }
      pairs[count++] = {cost, i, j};
    }
  }
  std::sort(pairs.begin(), pairs.begin() + static_cast<std::ptrdiff_t>(count),
            [](const Pair& a, const Pair& b) {
              if (a.cost != b.cost) return a.cost < b.cost;
              return a.led != b.led ? a.led < b.led : a.blob < b.blob;
            });
  Assignment out;
  const auto taken = [&](int blob) {
    return std::find(out.blob.begin(), out.blob.end(), blob) != out.blob.end();
  };
  for (std::size_t k = 0; k < count; ++k) {
    int& slot = out.blob[static_cast<std::size_t>(pairs[k].led)];
    if (slot >= 0 || taken(pairs[k].blob)) continue;
    slot = pairs[k].blob;
    ++out.blobs;
    ++out.leds;
  }
  const Assignment single = out;
  for (int i = 0; i < leds.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    if (single.blob[n] >= 0 || !images.in_front[n]) continue;
    double nearest = rule.merge_px;
    for (int k = 0; k < leds.size(); ++k) {
      const auto m = static_cast<std::size_t>(k);
      if (single.blob[m] < 0) continue;
      const double apart = (images.uv[m] - images.uv[n]).norm();
      if (apart >= nearest) continue;
      const Blob& blob = blobs[static_cast<std::size_t>(single.blob[m])];
      if (rule.use_color && !colors_agree(blob.color, leds.color(i), rule.white_is_any))
        continue;
      if (!shows_both(blob, images.uv[m], images.uv[n])) continue;
      nearest = apart;
      out.blob[n] = single.blob[m];
    }
    if (out.blob[n] >= 0) ++out.leds;
  }
  return out;
}

FixedVector<LedObservation, kMaxLeds> observations(const Assignment& assignment,
                                                   const LedImages& images,
                                                   BlobSpan blobs, double imbalance) {
  FixedVector<LedObservation, kMaxLeds> out;
  for (std::size_t i = 0; i < kMaxLeds; ++i) {
    const int j = assignment.blob[i];
    if (j < 0) continue;
    const auto first = std::find(assignment.blob.begin(), assignment.blob.end(), j);
    if (first != assignment.blob.begin() + static_cast<std::ptrdiff_t>(i)) continue;
    const Blob& blob = blobs[static_cast<std::size_t>(j)];
    LedObservation o;
    o.uv = blob.uv;
    o.cov = blob.cov;
    o.depth_m = blob.depth_m;
    Vector2 sum = Vector2::Zero();
    Matrix2 square = Matrix2::Zero();
    int count = 0;
    for (std::size_t k = i; k < kMaxLeds; ++k) {
      if (assignment.blob[k] != j) continue;
      o.leds = static_cast<std::uint16_t>(o.leds | (1u << k));
      sum += images.uv[k];
      square += images.uv[k] * images.uv[k].transpose();
      ++count;
    }
    if (count > 1) {
      const Vector2 mean = sum / count;
      o.cov += imbalance * imbalance * 4 * (square / count - mean * mean.transpose());
    }
    out.push_back(o);
  }
  return out;
}

}  // namespace alight
