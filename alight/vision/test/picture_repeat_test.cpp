#include "alight/vision/picture_repeat.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace alight {
namespace {

struct Picture {
  std::vector<std::uint8_t> pixels = std::vector<std::uint8_t>(320 * 240 * 3);
  ImageView view() const { return {pixels.data(), 320, 240, 3, 960}; }
  /// An LED of 3 x 3 pixels.
  void light(int u, int v) {
    for (int y = v - 1; y <= v + 1; ++y) {
      for (int x = 3 * (u - 1); x < 3 * (u + 2); ++x) {
        pixels[static_cast<std::size_t>(960 * y + x)] = 255;
      }
    }
  }
};

Picture noise(unsigned seed) {
  std::mt19937 rng(seed);
  Picture p;
  for (auto& pixel : p.pixels) pixel = static_cast<std::uint8_t>(rng() % 4);
  return p;
}

TEST(PictureRepeat, CountsPicturesThatAreAlike) {
  PictureRepeat repeat;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Picture p = noise(seed);
    for (int k = 1; k <= 4; ++k) {
      const Picture copy = p;
      EXPECT_EQ(repeat.look(copy.view()), k);
      repeat.found(copy.view(), {});
    }
  }
}

// Without noise nothing but the LEDs changes, and these by a pixel or by shining up.
TEST(PictureRepeat, TellsNoiselessPicturesApartByTheirLeds) {
  std::mt19937 rng(1);
  for (int k = 0; k < 200; ++k) {
    const int u = 20 + static_cast<int>(rng() % 280);
    const int v = 20 + static_cast<int>(rng() % 200);
    Picture dark, first, moved;
    first.light(u, v);
    moved.light(u + 1, v);
    PictureRepeat repeat;
    const Vector2 led(u, v);
    EXPECT_EQ(repeat.look(dark.view()), 1);
    repeat.found(dark.view(), {});
    EXPECT_EQ(repeat.look(first.view()), 1) << u << ", " << v << ": it shines up";
    repeat.found(first.view(), {&led, 1});
    EXPECT_EQ(repeat.look(moved.view()), 1) << u << ", " << v << ": it moves";
    repeat.found(moved.view(), {&led, 1});
    EXPECT_EQ(repeat.look(moved.view()), 2);
  }
}

TEST(PictureRepeat, LedsAtTheBorderAreNoTrouble) {
  PictureRepeat repeat;
  const Picture p = noise(7);
  for (const Vector2& led : {Vector2(0, 0), Vector2(319, 239), Vector2(-5, 120)}) {
    repeat.look(noise(8).view());
    repeat.found(noise(8).view(), {});
    EXPECT_EQ(repeat.look(p.view()), 1);
    repeat.found(p.view(), {&led, 1});
    EXPECT_EQ(repeat.look(p.view()), 2);
  }
}

}  // namespace
}  // namespace alight
