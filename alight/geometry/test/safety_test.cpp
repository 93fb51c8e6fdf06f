#include "alight/geometry/safety.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

namespace alight {
namespace {

TEST(Safety, DefaultsHoldAndBoundsAreNamed) {
  const Rig rig = alan_rig();
  EXPECT_TRUE(Safety{}.validate(rig));
  const auto complaint = [&](auto&& spoil) -> std::string {
    Safety safety;
    spoil(safety);
    const auto good = safety.validate(rig);
    return good ? "" : good.error().detail;
  };
  const auto names = [](const std::string& text, const char* field) {
    return text.find(std::string("safety.") + field) == 0;
  };
  EXPECT_TRUE(names(complaint([](auto& s) { s.battery_low = 1.1; }), "battery_low"));
  EXPECT_TRUE(names(complaint([](auto& s) { s.battery_low = NAN; }), "battery_low"));
  EXPECT_TRUE(names(complaint([](auto& s) { s.battery_empty = 0.2; }), "battery_empty"))
      << "not above low";
  EXPECT_TRUE(names(complaint([](auto& s) { s.landings_max = 0; }), "landings_max"));
  for (const Vector3& p : {Vector3(NAN, 0, 1), Vector3(0.3, 0, 1), Vector3(0.5, 0.5, 1),
                           Vector3(-0.5, 0, 1), Vector3(-2, 0, 0)}) {
    EXPECT_TRUE(names(complaint([&](auto& s) { s.leave_at_m = p; }), "leave_at_m"))
        << p.transpose();
  }
  EXPECT_EQ(complaint([](auto& s) { s.leave_at_m = Vector3(-1.2, 0.5, 0.7); }), "");
}

// Clear of it is clear of everything between the pad and the lens, by the same room.
TEST(Safety, TheOutlineReachesFromThePadToTheLens) {
  const Rig rig = alan_rig();
  const PlatformOutline outline(rig);
  const Vector3 lens = rig.camera.X_NC.translation();
  const double room = std::sqrt(0.5) * rig.pad.size_m + rig.drone.size_m;
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> at(-2, 2);
  int clear = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vector3 p(at(rng), at(rng), at(rng));
    double nearest = 1e9;
    for (int k = 0; k <= 100; ++k) {
      nearest = std::min(nearest, (p - 0.01 * k * lens).head<2>().norm());
    }
    if (outline.clear(p)) {
      ++clear;
      EXPECT_GT(nearest, room);
    } else {
      EXPECT_LT(nearest, room + 0.3);
    }
  }
  EXPECT_GT(clear, 500);
}

}  // namespace
}  // namespace alight
