#include "alight/vision/constellation_check.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"
#include "alight/vision/led_finder.h"

namespace alight {
namespace {

Constellation of(std::initializer_list<Vector3> places,
                 LedColor color = LedColor::none) {
  Constellation leds;
  for (const Vector3& p : places) leds.leds.push_back({p, color});
  return leds;
}

ConstellationReport check(const Constellation& leds, const ConstellationUse& use = {}) {
  return check_constellation(leds, Intrinsics(), use);
}

/// `n` LEDs evenly on a level circle.
Constellation ring(int n, double radius = 0.09) {
  Constellation leds;
  for (int i = 0; i < n; ++i) {
    const double way = 2 * kPi * i / n;
    leds.leds.push_back(
        {{radius * std::cos(way), radius * std::sin(way), 0}, LedColor::none});
  }
  return leds;
}

Constellation scattered(Rng& rng, int n) {
  Constellation leds;
  while (leds.size() < n) {
    const Vector3 p(rng.uniform(0, 0.12), rng.uniform(-0.1, 0.1),
                    rng.uniform(-0.08, 0.04));
    bool apart = true;
    for (const Led& led : leds.leds) apart = apart && (led.p_BL - p).norm() > 0.03;
    if (apart) leds.leds.push_back({p, LedColor::none});
  }
  return leds;
}

/// Each LED off by at most `most` m.
Constellation shaken(Constellation leds, double most, Rng& rng) {
  for (Led& led : leds.leds) {
    const Vector3 way = Vector3(rng.normal(), rng.normal(), rng.normal()).normalized();
    led.p_BL += rng.uniform(0, most) * way;
  }
  return leds;
}

TEST(ConstellationCheck, TheAuthorsRigDoesInColourAndInfrared) {
  Rig rig = alan_rig();
  EXPECT_EQ(check(rig.leds).refusal, "");
  EXPECT_TRUE(check(rig.leds).warnings.empty()) << check(rig.leds).warnings.front();
  for (Led& led : rig.leds.leds) led.color = LedColor::none;
  EXPECT_EQ(check(rig.leds).refusal, "");
}

TEST(ConstellationCheck, LedsInALineAreRefusedHoweverTheLineLies) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    Rng rng(seed);
    const Vector3 along =
        Vector3(rng.normal(), rng.normal(), rng.normal()).normalized();
    Constellation leds;
    for (int i = 0; i < 4 + static_cast<int>(seed % 9); ++i) {
      leds.leds.push_back({(0.03 * i + 0.01 * rng.uniform()) * along, LedColor::none});
    }
    const auto report = check(shaken(leds, 0.001, rng));
    EXPECT_NE(report.refusal.find("of a line"), std::string::npos) << seed;
    EXPECT_NE(report.refusal.find("move LED"), std::string::npos) << seed;
  }
}

TEST(ConstellationCheck, AnEvenRingHasNoHeading) {
  for (int n = 4; n <= 16; ++n) {
    const auto report = check(ring(n));
    EXPECT_NE(report.refusal.find("heading"), std::string::npos) << n;
    EXPECT_NE(report.refusal.find("move LED"), std::string::npos) << n;
  }
}

TEST(ConstellationCheck, OneLedMovedOrOfAnotherColourGivesItOne) {
  for (int n = 5; n <= 12; ++n) {
    Constellation moved = ring(n);
    moved.leds[2].p_BL *= 0.5;
    EXPECT_EQ(check(moved).refusal, "") << n;
    Constellation colored = ring(n);
    for (Led& led : colored.leds) led.color = LedColor::green;
    EXPECT_NE(check(colored).refusal, "") << n;
    colored.leds[0].color = LedColor::red;
    EXPECT_EQ(check(colored).refusal, "") << n;
    ConstellationUse use;
    use.use_color = false;
    EXPECT_NE(check(colored, use).refusal, "") << n;
  }
}

/// The finding does not depend on where B's origin is, on the heading of its x axis (of
/// LEDs all round) nor on the order of the LEDs.
TEST(ConstellationCheck, IsTheSameTurnedShiftedAndInAnotherOrder) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    Rng rng(seed);
    const int n = 4 + static_cast<int>(seed % 6);
    const Constellation leds = seed % 3 == 0 ? ring(n) : scattered(rng, n);
    const Matrix3 R = from_rpy(0, 0, rng.uniform(-kPi, kPi));
    Constellation other;
    for (int i = 0; i < n; ++i) {
      other.leds.push_back({R * leds.p_BL((i + 1) % n), leds.color((i + 1) % n)});
    }
    ConstellationUse use;
    use.one_sided = false;
    EXPECT_EQ(check(leds, use).refusal.empty(), check(other, use).refusal.empty())
        << seed;
    EXPECT_EQ(check(leds, use).warnings.size(), check(other, use).warnings.size())
        << seed;
  }
}

TEST(ConstellationCheck, GravityTellsAPanelThatOnlyLooksAlikeUpsideDown) {
  // A square that faces forward: a quarter turn tips the drone over.
  const auto report = check(of({{0.06, -0.05, -0.05},
                                {0.06, 0.05, -0.05},
                                {0.06, 0.05, 0.05},
                                {0.06, -0.05, 0.05}}));
  EXPECT_EQ(report.refusal, "");
}

TEST(ConstellationCheck, APlaneIsToldAndNotRefused) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    Rng rng(seed);
    Constellation flat = scattered(rng, 6);
    for (Led& led : flat.leds) led.p_BL.x() = 0.05;
    const auto report = check(shaken(flat, 0.001, rng));
    EXPECT_EQ(report.refusal, "");
    const bool told = std::any_of(
        report.warnings.begin(), report.warnings.end(),
        [](const std::string& w) { return w.find("one plane") != std::string::npos; });
    EXPECT_TRUE(told) << seed;
  }
}

TEST(ConstellationCheck, TooSmallForTheRange) {
  Rng rng(3);
  Constellation leds = scattered(rng, 6);
  for (Led& led : leds.leds) led.p_BL *= 0.08;
  EXPECT_NE(check(leds).refusal.find("spread them"), std::string::npos);
  Constellation half = scattered(rng, 6);
  for (Led& led : half.leds) led.p_BL *= 0.35;
  const auto report = check(half);
  EXPECT_EQ(report.refusal, "");
  ASSERT_FALSE(report.warnings.empty());
  EXPECT_NE(report.warnings.back().find("beyond"), std::string::npos);
}

TEST(ConstellationCheck, AllButOneInALineIsTold) {
  const auto report = check(of({{0.05, -0.09, 0},
                                {0.05, -0.04, 0},
                                {0.05, 0.01, 0},
                                {0.05, 0.08, 0},
                                {0.1, 0, -0.05}}));
  EXPECT_EQ(report.refusal, "");
  const bool told = std::any_of(
      report.warnings.begin(), report.warnings.end(),
      [](const auto& w) { return w.find("without LED 4") != std::string::npos; });
  EXPECT_TRUE(told);
}

TEST(ConstellationCheck, TheFinderRefusesWithThatSentence) {
  const Rig rig = alan_rig();
  LedFinderConfig config;
  config.facing_max_deg = 180;
  const auto finder = LedFinder::create(config, rig.camera, ring(6));
  ASSERT_FALSE(finder);
  EXPECT_EQ(finder.error().fault, Fault::invalid_config);
  EXPECT_NE(finder.error().detail.find("deg the LEDs look the same"), std::string::npos)
      << finder.error().detail;
}

}  // namespace
}  // namespace alight
