#include "alight/vision/blobs_apart.h"

#include <gtest/gtest.h>

namespace alight {
namespace {

Blob light(double u, double v, int half, double brightness) {
  Blob blob;
  blob.uv = Vector2(u, v);
  blob.box = {static_cast<int>(u) - half, static_cast<int>(v) - half,
              static_cast<int>(u) + half + 1, static_cast<int>(v) + half + 1};
  blob.area_px = (2 * half + 1) * (2 * half + 1);
  blob.brightness = brightness;
  return blob;
}

TEST(BlobsApart, TakesLightsApartThatRunTogetherAmongDimPixels) {
  FixedVector<Blob, kMaxBlobs> lights{light(98, 50, 1, 30), light(102, 50, 1, 10),
                                      light(200, 80, 1, 20)};
  const std::array<Blob, 3> dim{light(100, 50, 4, 400), light(200.2, 80.1, 2, 90),
                                light(300, 90, 1, 5)};
  take_apart(dim, lights);
  ASSERT_EQ(lights.size(), 4u);
  EXPECT_EQ(lights[0].uv, Vector2(98, 50));
  EXPECT_EQ(lights[1].uv, Vector2(102, 50));
  EXPECT_DOUBLE_EQ(lights[0].brightness, 300);
  EXPECT_DOUBLE_EQ(lights[1].brightness, 100);
  // One is seen best with all of its pixels, and dim ones are seen at all.
  EXPECT_EQ(lights[2].uv, dim[1].uv);
  EXPECT_EQ(lights[3].uv, dim[2].uv);
}

TEST(BlobsApart, LeavesRowsOfLampsThatRunTogether) {
  FixedVector<Blob, kMaxBlobs> lights{light(90, 50, 3, 900), light(110, 50, 3, 900)};
  const std::array<Blob, 1> dim{light(100, 50, 15, 4000)};
  take_apart(dim, lights);
  ASSERT_EQ(lights.size(), 1u);
  EXPECT_EQ(lights[0].brightness, 4000);
}

}  // namespace
}  // namespace alight
