#include "alight/base/rng.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

namespace alight {
namespace {

constexpr int kDraws = 200'000;

TEST(Rng, SameSeedSameBits) {
  Rng a(42), b(42), c(43);
  int equal = 0;
  for (int i = 0; i < 1000; ++i) {
    const auto bits = a.bits();
    EXPECT_EQ(bits, b.bits());
    if (bits == c.bits()) ++equal;
  }
  EXPECT_EQ(equal, 0);
}

TEST(Rng, UniformMoments) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    Rng rng(seed);
    double sum = 0, squares = 0;
    for (int i = 0; i < kDraws; ++i) {
      const double x = rng.uniform();
      ASSERT_GE(x, 0);
      ASSERT_LT(x, 1);
      sum += x;
      squares += x * x;
    }
    // Five standard deviations of each estimate.
    EXPECT_NEAR(sum / kDraws, 0.5, 5 * std::sqrt(1.0 / 12 / kDraws));
    EXPECT_NEAR(squares / kDraws, 1.0 / 3, 5 * std::sqrt(4.0 / 45 / kDraws));
  }
}

TEST(Rng, NormalMomentsAndTails) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    Rng rng(seed);
    double m1 = 0, m2 = 0, m3 = 0, m4 = 0;
    int beyond = 0;
    for (int i = 0; i < kDraws; ++i) {
      const double x = rng.normal();
      ASSERT_TRUE(std::isfinite(x));
      m1 += x;
      m2 += x * x;
      m3 += x * x * x;
      m4 += x * x * x * x;
      if (std::abs(x) > 1.959964) ++beyond;
    }
    EXPECT_NEAR(m1 / kDraws, 0, 5 * std::sqrt(1.0 / kDraws));
    EXPECT_NEAR(m2 / kDraws, 1, 5 * std::sqrt(2.0 / kDraws));
    EXPECT_NEAR(m3 / kDraws, 0, 5 * std::sqrt(15.0 / kDraws));
    EXPECT_NEAR(m4 / kDraws, 3, 5 * std::sqrt(96.0 / kDraws));
    EXPECT_NEAR(beyond, 0.05 * kDraws, 5 * std::sqrt(0.05 * 0.95 * kDraws));
  }
}

TEST(Rng, ForksDependOnTheNameAndNotOnTheDraws) {
  Rng a(7), b(7);
  for (int i = 0; i < 10; ++i) a.bits();
  EXPECT_EQ(a.fork("camera").bits(), b.fork("camera").bits());
  EXPECT_NE(a.fork("camera").bits(), a.fork("radio").bits());
  std::set<std::uint64_t> first;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    for (int i = 0; i < 20; ++i) {
      first.insert(Rng(seed).fork("led" + std::to_string(i)).bits());
    }
    first.insert(Rng(seed).bits());
  }
  EXPECT_EQ(first.size(), 2100u);
}

TEST(Rng, ForksAreUncorrelated) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const Rng root(seed);
    Rng a = root.fork("a"), b = root.fork("b"), c = Rng(seed + 1).fork("a"), d = root;
    double ab = 0, ac = 0, ad = 0;
    for (int i = 0; i < kDraws; ++i) {
      const double x = a.normal();
      ab += x * b.normal();
      ac += x * c.normal();
      ad += x * d.normal();
    }
    const double bound = 5 * std::sqrt(1.0 / kDraws);
    EXPECT_LT(std::abs(ab / kDraws), bound);
    EXPECT_LT(std::abs(ac / kDraws), bound);
    EXPECT_LT(std::abs(ad / kDraws), bound);
  }
}

}  // namespace
}  // namespace alight
