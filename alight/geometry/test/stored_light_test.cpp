#include "alight/geometry/stored_light.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace alight {
namespace {

TEST(StoredLight, AtGammaOneIsTheLight) {
  const GreyTable light = light_of_stored(1), stored = stored_of_light(1);
  for (std::size_t i = 0; i < light.size(); ++i) {
    EXPECT_EQ(light[i], i);
    EXPECT_EQ(stored[i], i);
  }
}

TEST(StoredLight, KeepsBlackWhiteAndOrder) {
  for (const double gamma : {0.4, 0.7, 1.43, 2.2, 3.0}) {
    for (const GreyTable& table : {light_of_stored(gamma), stored_of_light(gamma)}) {
      EXPECT_EQ(table.front(), 0);
      EXPECT_EQ(table.back(), 255);
      for (std::size_t i = 1; i < table.size(); ++i) EXPECT_GE(table[i], table[i - 1]);
    }
  }
}

// What is dark has finer steps stored than light has, what is bright coarser ones.
TEST(StoredLight, ComesBackToARounding) {
  for (const double gamma : {1.43, 2.2, 3.0}) {
    const GreyTable light = light_of_stored(gamma), stored = stored_of_light(gamma);
    const int most = static_cast<int>(gamma / 2) + 1;
    for (int i = 0; i < 256; ++i) {
      const int back = light[stored[static_cast<std::size_t>(i)]];
      EXPECT_LE(std::abs(back - i), most) << gamma << ", " << i;
    }
  }
}

// IEC 61966-2-1 is a power of 2.4 with a straight piece below, which together is close
// to 2.2: a half of the light is stored as 188.
TEST(StoredLight, AHalfOfTheLightIsStoredBright) {
  EXPECT_NEAR(stored_of_light(2.2)[128], 188, 2);
}

}  // namespace
}  // namespace alight
