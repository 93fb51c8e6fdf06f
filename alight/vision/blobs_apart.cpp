#include "alight/vision/blobs_apart.h"

#include <cstddef>

namespace alight {
namespace {

// Larger ones are near, where LEDs stand farther apart, or they are lamps.
constexpr double kAreaMost_px = 100;

bool within(const Blob& blob, const Roi& box) {
  return blob.uv.x() >= box.u0 && blob.uv.x() <= box.u1 && blob.uv.y() >= box.v0 &&
         blob.uv.y() <= box.v1;
}

}  // namespace

void take_apart(BlobSpan dim, FixedVector<Blob, kMaxBlobs>& bright) {
  FixedVector<bool, kMaxBlobs> kept;
  for (std::size_t i = 0; i < bright.size(); ++i) kept.push_back(false);
  FixedVector<bool, kMaxBlobs> whole;
  for (const Blob& light : dim) {
    int parts = 0;
    double sum = 0;
    for (const Blob& part : bright) {
      if (!within(part, light.box)) continue;
      ++parts;
      sum += part.brightness;
    }
    const bool several = parts > 1 && light.area_px <= kAreaMost_px && sum > 0;
    whole.push_back(!several);
    for (std::size_t i = 0; several && i < bright.size(); ++i) {
      if (kept[i] || !within(bright[i], light.box)) continue;
      kept[i] = true;
      bright[i].brightness *= light.brightness / sum;
    }
  }
  std::size_t count = 0;
  for (std::size_t i = 0; i < bright.size(); ++i) {
    if (kept[i]) bright[count++] = bright[i];
  }
  bright.truncate(count);
  for (std::size_t i = 0; i < dim.size(); ++i) {
    if (whole[i] && !bright.push_back(dim[i])) break;
  }
}

}  // namespace alight
