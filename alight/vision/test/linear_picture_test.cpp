#include "alight/vision/linear_picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alight/geometry/stored_light.h"
#include "alight/vision/test/scene.h"

namespace alight {
namespace {

using test::Picture;

/// Each pixel of another colour.
Picture colorful(int channels, int width = 40, int height = 30) {
  Picture picture(channels, width, height);
  for (std::size_t i = 0; i < picture.bytes.size(); ++i) {
    picture.bytes[i] = static_cast<std::uint8_t>(i * 37 % 256);
  }
  return picture;
}

TEST(LinearPicture, OfALinearCameraIsThePictureItself) {
  const Picture picture = colorful(3);
  LinearPicture linear(picture.width, picture.height, 1);
  EXPECT_EQ(linear.of(picture.view()).data, picture.bytes.data());
  EXPECT_EQ(linear.of(picture.view(), {3, 4, 9, 12}).data, picture.bytes.data());
}

TEST(LinearPicture, HasLightInTheBoxAndIsBlackAround) {
  for (const int channels : {1, 3}) {
    Picture picture = colorful(channels);
    // Rows with a gap after them, as of a picture cut out of another.
    std::vector<std::uint8_t> gaps(static_cast<std::size_t>(30 * (40 * channels + 7)),
                                   9);
    ImageView view = picture.view();
    view.data = gaps.data();
    view.stride = 40 * channels + 7;
    for (int v = 0; v < 30; ++v) {
      std::copy_n(picture.view().row(v), 40 * channels, gaps.data() + v * view.stride);
    }
    const GreyTable light = light_of_stored(2.2);
    LinearPicture linear(40, 30, 2.2);
    // One after the other: nothing of an earlier box is left.
    for (const Roi& box : {Roi{5, 6, 12, 20}, Roi{-4, -9, 8, 10}, Roi{30, 20, 99, 99},
                           Roi{50, 5, 60, 9}, Roi{7, 9, 7, 12}, Roi{0, 0, 40, 30}}) {
      const ImageView out = linear.of(view, box);
      ASSERT_EQ(out.width, 40);
      ASSERT_EQ(out.channels, channels);
      for (int v = 0; v < 30; ++v) {
        for (int u = 0; u < 40; ++u) {
          const bool inside = u >= box.u0 && u < box.u1 && v >= box.v0 && v < box.v1;
          for (int c = 0; c < channels; ++c) {
            const int at = u * channels + c;
            ASSERT_EQ(out.row(v)[at], inside ? light[view.row(v)[at]] : 0);
          }
        }
      }
    }
  }
}

TEST(LinearPicture, OfOtherChannelsLeavesNothingBehind) {
  const Picture grey = colorful(1), color = colorful(3);
  for (const bool grey_first : {true, false}) {
    const Picture &first = grey_first ? grey : color, &then = grey_first ? color : grey;
    LinearPicture linear(40, 30, 2.2);
    (void)linear.of(first.view(), {18, 8, 35, 28});
    const ImageView out = linear.of(then.view(), {5, 6, 12, 20});
    ASSERT_EQ(out.channels, then.channels);
    for (int v = 0; v < 30; ++v) {
      for (int u = 0; u < 40; ++u) {
        if (u >= 5 && u < 12 && v >= 6 && v < 20) continue;
        for (int c = 0; c < out.channels; ++c) {
          ASSERT_EQ(out.row(v)[u * out.channels + c], 0);
        }
      }
    }
  }
}

TEST(LinearPicture, ChangesWithGamma) {
  const Picture picture = colorful(3);
  LinearPicture linear(picture.width, picture.height, 1);
  linear.set_gamma(1.8);
  EXPECT_EQ(linear.gamma(), 1.8);
  const GreyTable light = light_of_stored(1.8);
  EXPECT_EQ(linear.of(picture.view()).row(3)[5], light[picture.view().row(3)[5]]);
}

// What is told of noise as stored is what one finds in the picture of light.
TEST(LinearPicture, TellsTheNoiseThatItHas) {
  for (const double gamma : {1.43, 2.2}) {
    for (const int level : {30, 60, 120}) {
      Picture picture(3, 424, 240);
      Rng rng(static_cast<std::uint64_t>(level));
      for (auto& b : picture.bytes) {
        b = static_cast<std::uint8_t>(std::lround(level + 6 * rng.normal()));
      }
      LinearPicture linear(424, 240, gamma);
      const PictureNoise told = linear.of(picture_noise(picture.view()));
      const PictureNoise seen = picture_noise(linear.of(picture.view()));
      EXPECT_NEAR(told.dark, seen.dark, 1) << gamma << ", " << level;
      EXPECT_NEAR(told.grey_sd, seen.grey_sd, 0.3 * seen.grey_sd + 0.5);
      EXPECT_NEAR(std::sqrt(told.luminance_variance),
                  std::sqrt(seen.luminance_variance),
                  0.15 * std::sqrt(seen.luminance_variance) + 0.2)
          << gamma << ", " << level;
    }
  }
}

}  // namespace
}  // namespace alight
