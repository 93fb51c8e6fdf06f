#include "alight/vision/stray_memory.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr Time kFrame = 16'666'667;

Blob light(const Vector2& uv) {
  Blob blob;
  blob.uv = uv;
  blob.area_px = 12;
  return blob;
}

/// Six LEDs, their middle at `middle`.
LedImages leds_at(const Vector2& middle) {
  LedImages images;
  for (std::size_t i = 0; i < 6; ++i) {
    images.uv[i] = middle + Vector2(15.0 * (static_cast<double>(i) - 2.5),
                                    i % 2 == 0 ? 6.0 : -6.0);
    images.in_front[i] = true;
    ++images.count;
  }
  images.middle = middle;
  return images;
}

std::vector<Blob> picture(const LedImages& leds, const std::vector<Vector2>& lamps) {
  std::vector<Blob> blobs;
  for (std::size_t i = 0; i < 6; ++i) blobs.push_back(light(leds.uv[i]));
  for (const Vector2& lamp : lamps) blobs.push_back(light(lamp));
  return blobs;
}

bool known(BlobSpan blobs, const Vector2& uv) {
  return std::any_of(blobs.begin(), blobs.end(), [&](const Blob& b) {
    return b.stray && (b.uv - uv).norm() < 1e-9;
  });
}

std::ptrdiff_t strays(BlobSpan blobs) {
  return std::count_if(blobs.begin(), blobs.end(),
                       [](const Blob& b) { return b.stray; });
}

/// Runs LEDs past lamps that move by `way` px a picture; in the end the LEDs stand
/// right among them.
TEST(StrayMemory, KnowsLampsAgainWhereLedsComeNearThem) {
  for (const Vector2& way : {Vector2(0, 0), Vector2(3.5, -1), Vector2(-9, 4)}) {
    SCOPED_TRACE(way.transpose());
    StrayMemory memory;
    Rng rng(7);
    // Steps of less than half a row's distance: else it may go by any neighbour.
    const std::vector<Vector2> row = {{300, 200}, {324, 212}, {348, 224}, {372, 236}};
    const auto lamps = [&](int n) {
      std::vector<Vector2> out;
      for (const Vector2& lamp : row) {
        out.push_back(lamp + n * way + Vector2(rng.normal(), rng.normal()) * 0.05);
      }
      return out;
    };
    const Vector2 goal = Vector2(336, 218) + 20 * way;
    for (int n = 0; n <= 20; ++n) {
      const Time t = n * kFrame;
      const LedImages leds = leds_at(goal + (20 - n) * Vector2(12, 3));
      const auto at = lamps(n);
      const auto blobs = picture(leds, at);
      const BlobSpan marked = memory.mark({blobs.data(), blobs.size()}, t);
      ASSERT_EQ(marked.size(), blobs.size());
      const bool learnt = n >= 4 && way.norm() < 6;
      for (const Vector2& lamp : at) {
        EXPECT_TRUE(!learnt || known(marked, lamp)) << n;
      }
      for (std::size_t i = 0; i < 6; ++i) {
        bool beside = false;
        for (const Vector2& lamp : at) beside |= (lamp - leds.uv[i]).norm() < 1;
        EXPECT_TRUE(beside || !known(marked, leds.uv[i])) << n << " LED " << i;
      }
      memory.remember(marked, leds, true, t);
    }
  }
}

TEST(StrayMemory, WithoutASurePoseNothingBecomesAStray) {
  StrayMemory memory;
  const auto blobs = picture(leds_at({200, 200}), {{400, 100}, {420, 130}});
  for (int n = 0; n < 10; ++n) {
    const BlobSpan marked = memory.mark({blobs.data(), blobs.size()}, n * kFrame);
    EXPECT_EQ(strays(marked), 0);
    // A pose on the lamps: the LEDs stand apart from it.
    memory.remember(marked, leds_at({410, 115}), false, n * kFrame);
  }
}

TEST(StrayMemory, ALampThatWasHiddenIsKnownWhereItShouldBe) {
  const Vector2 way(2, 1);
  for (const int hidden : {1, 5, 12, 20}) {
    SCOPED_TRACE(hidden);
    StrayMemory memory;
    const LedImages leds = leds_at({200, 200});
    const auto at = [&](int n) { return Vector2(Vector2(400, 100) + n * way); };
    int n = 0;
    const auto see = [&](bool lamp) {
      const auto blobs =
          picture(leds, lamp ? std::vector<Vector2>{at(n)} : std::vector<Vector2>{});
      const BlobSpan marked = memory.mark({blobs.data(), blobs.size()}, n * kFrame);
      const auto found = strays(marked);
      memory.remember(marked, leds, true, n * kFrame);
      ++n;
      return found;
    };
    for (int k = 0; k < 5; ++k) see(true);
    for (int k = 0; k < hidden; ++k) EXPECT_EQ(see(false), 0);
    EXPECT_EQ(see(true), hidden <= 5 ? 1 : 0) << "at last it is forgotten";
  }
}

// A lamp's image, or an LED's own in the pad, runs into an LED that then stands there.
TEST(StrayMemory, AnLedThatALampHasMetIsOneAgain) {
  StrayMemory memory;
  const LedImages leds = leds_at({200, 200});
  int wrong = 0;
  for (int n = 0; n < 150; ++n) {
    const Vector2 lamp = leds.uv[2] + Vector2(0, 40 * std::exp(-0.08 * n));
    std::vector<Vector2> lamps;
    if ((lamp - leds.uv[2]).norm() > 0.7) lamps.push_back(lamp);  // then they are one
    const auto blobs = picture(leds, lamps);
    const BlobSpan marked = memory.mark({blobs.data(), blobs.size()}, n * kFrame);
    for (std::size_t i = 0; i < 6; ++i) wrong += marked[i].stray;
    memory.remember(marked, leds, true, n * kFrame);
  }
  EXPECT_LE(wrong, 7) << "as long as a lamp that is hidden is expected";
}

TEST(StrayMemory, ForgetsWhenTold) {
  StrayMemory memory;
  const auto blobs = picture(leds_at({200, 200}), {{400, 100}});
  for (int n = 0; n < 5; ++n) {
    memory.remember({blobs.data(), blobs.size()}, leds_at({200, 200}), true,
                    n * kFrame);
  }
  EXPECT_EQ(strays(memory.mark({blobs.data(), blobs.size()}, 5 * kFrame)), 1);
  memory.forget();
  EXPECT_EQ(strays(memory.mark({blobs.data(), blobs.size()}, 5 * kFrame)), 0);
}

TEST(StrayMemory, HoldsAsManyAsItCanOfAPictureFullOfLamps) {
  StrayMemory memory;
  std::vector<Vector2> lamps;
  for (int i = 0; i < 200; ++i)
    lamps.push_back({20.0 + 30 * (i % 20), 300.0 + 18 * (i / 20)});
  const auto blobs = picture(leds_at({200, 100}), lamps);
  for (int n = 0; n < 6; ++n) {
    const BlobSpan marked = memory.mark({blobs.data(), blobs.size()}, n * kFrame);
    EXPECT_EQ(marked.size(), blobs.size());
    memory.remember(marked, leds_at({200, 100}), true, n * kFrame);
  }
  EXPECT_EQ(strays(memory.mark({blobs.data(), blobs.size()}, 6 * kFrame)), 64);
}

}  // namespace
}  // namespace alight
