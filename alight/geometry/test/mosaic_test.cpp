#include "alight/geometry/mosaic.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <vector>

namespace alight {
namespace {

constexpr Mosaic kMosaics[] = {Mosaic::rggb, Mosaic::bggr, Mosaic::grbg, Mosaic::gbrg};

TEST(Mosaic, IsCalledByItsFirstTwoRows) {
  const std::string letters = "bgr";
  for (const Mosaic mosaic : kMosaics) {
    std::string name;
    for (int v = 0; v < 2; ++v) {
      for (int u = 0; u < 2; ++u) {
        name += letters[static_cast<std::size_t>(channel_at(mosaic, u, v))];
        // Every second row and column again.
        EXPECT_EQ(channel_at(mosaic, u, v), channel_at(mosaic, u + 6, v + 4));
      }
    }
    EXPECT_EQ(name, to_string(mosaic));
  }
}

TEST(Mosaic, WhatPixelsSawStays) {
  constexpr int kWidth = 7, kHeight = 6;
  for (const Mosaic mosaic : kMosaics) {
    std::vector<std::uint8_t> raw(kWidth * kHeight), again(raw.size()),
        bgr(3 * raw.size());
    for (std::size_t i = 0; i < raw.size(); ++i) {
      raw[i] = static_cast<std::uint8_t>(37 * i * i % 251);
    }
    interpolate_colors(raw.data(), kWidth, kHeight, mosaic, bgr.data());
    take_own_colors(bgr.data(), kWidth, kHeight, mosaic, again.data());
    EXPECT_EQ(raw, again) << to_string(mosaic);
  }
}

TEST(Mosaic, AnEvenSlopeOfAnyColourIsInterpolatedRight) {
  constexpr int kWidth = 12, kHeight = 10;
  for (const Mosaic mosaic : kMosaics) {
    std::vector<std::uint8_t> true_bgr, raw(kWidth * kHeight), bgr(3 * raw.size());
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        true_bgr.push_back(static_cast<std::uint8_t>(20 + 4 * u + 2 * v));
        true_bgr.push_back(static_cast<std::uint8_t>(200 - 6 * u + 2 * v));
        true_bgr.push_back(static_cast<std::uint8_t>(90 + 2 * u - 4 * v));
      }
    }
    take_own_colors(true_bgr.data(), kWidth, kHeight, mosaic, raw.data());
    interpolate_colors(raw.data(), kWidth, kHeight, mosaic, bgr.data());
    for (int v = 1; v < kHeight - 1; ++v) {
      for (int u = 1; u < kWidth - 1; ++u) {
        for (int c = 0; c < 3; ++c) {
          const auto at = static_cast<std::size_t>(3 * (v * kWidth + u) + c);
          EXPECT_EQ(bgr[at], true_bgr[at]) << u << ' ' << v << ' ' << c;
        }
      }
    }
  }
}

}  // namespace
}  // namespace alight
