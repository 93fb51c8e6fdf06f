#include "alight/vision/lanes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "alight/base/rng.h"

namespace alight {
namespace {

TEST(Lanes, ExpAgreesWithTheLibrary) {
  for (float x = 60; x > -60; x -= 0.0137f) {
    const double want = std::exp(static_cast<double>(x));
    ASSERT_NEAR(static_cast<double>(exp_of(x)) / want, 1, 1.2e-5) << x;
  }
  EXPECT_LT(exp_of(-1e30f), 1e-29f);
}

TEST(Lanes, ExpToBaseTwoAgreesWithTheLibraryOnBothSides) {
  for (float t = -90; t < 90; t += 0.0173f) {
    const double want = std::exp2(static_cast<double>(t));
    ASSERT_NEAR(static_cast<double>(exp2_of(t)) / want, 1, 8e-6) << t;
  }
  for (int t = -20; t <= 20; ++t) {
    ASSERT_NEAR(exp2_of(static_cast<float>(t)) / std::ldexp(1.0f, t), 1, 3e-5) << t;
  }
  EXPECT_LT(exp2_of(-1e30f), 1e-29f);
  EXPECT_TRUE(std::isfinite(exp2_of(1e30f)));
}

TEST(Lanes, LogarithmAgreesWithTheLibrary) {
  for (float x = 1e-30f; x < 1e30f; x *= 1.00173f) {
    const double want = std::log2(static_cast<double>(x));
    const double slack = 3e-7 + 1.2e-7 * std::abs(want);
    ASSERT_NEAR(static_cast<double>(log2_of(x)), want, slack) << x;
  }
  EXPECT_EQ(log2_of(1), 0);
  EXPECT_EQ(log2_of(8), 3);
}

TEST(Lanes, PowersAgreeWithTheLibrary) {
  for (const float exponent : {0.3f, 1.0f, 2.2f, 5.0f}) {
    for (float x = 1e-4f; x < 3; x *= 1.037f) {
      const double want =
          std::pow(static_cast<double>(x), static_cast<double>(exponent));
      ASSERT_NEAR(static_cast<double>(pow_of(x, exponent)) / want, 1, 2e-5)
          << x << ", " << exponent;
    }
  }
}

TEST(Lanes, SumsProducts) {
  Rng rng(1);
  std::vector<float> a(64), b(64);
  double want = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i] = static_cast<float>(rng.normal());
    b[i] = static_cast<float>(rng.normal());
    want += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  }
  EXPECT_NEAR(static_cast<double>(dot(a.data(), b.data(), 64)), want, 1e-5);
  EXPECT_EQ(dot(a.data(), b.data(), 0), 0);
}

}  // namespace
}  // namespace alight
