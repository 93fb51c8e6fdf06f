#include "alight/mission/maneuver.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr Time kMs = 1'000'000, kSecond = 1000 * kMs;

/// From behind down to the pad, any smooth shape; ends sinking.
Trajectory some_landing(Rng& rng) {
  Trajectory trajectory;
  trajectory.durations = {rng.uniform(0.8, 2.0), rng.uniform(0.8, 2.0)};
  const auto random = [&] {
    return Vector3(rng.uniform(-1, 0), rng.uniform(-0.3, 0.3), rng.uniform(0.1, 0.8));
  };
  for (auto& segment : trajectory.c) {
    for (Vector3& c : segment) c = random();
  }
  // Joined to the third derivative: one polynomial in time would be, here equal
  // durations and mirrored differences are.
  trajectory.durations[1] = trajectory.durations[0];
  auto& a = trajectory.c[0];
  auto& b = trajectory.c[1];
  const auto n = static_cast<std::size_t>(kControlPoints - 1);
  b[0] = a[n];
  b[1] = 2 * a[n] - a[n - 1];
  b[2] = b[1] + (b[1] - b[0]) + (a[n] - 2 * a[n - 1] + a[n - 2]);
  b[3] = 3 * b[2] - 3 * b[1] + b[0] + (a[n] - 3 * a[n - 1] + 3 * a[n - 2] - a[n - 3]);
  return trajectory;
}

TEST(Maneuver, AtAnyPaceSpeedAndAccelerationAreTheDerivativesOfThePlace) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    Rng rng(seed);
    Maneuver m = Maneuver::landing(some_landing(rng), kSecond, 0.08);
    double goal = 1;
    for (Time t = kSecond; !m.done(t + 20 * kMs) && t < 12 * kSecond; t += 10 * kMs) {
      if (rng.uniform(0, 1) < 0.05) {
        goal = t > 8 * kSecond ? 1 : std::clamp(rng.uniform(-0.5, 1.5), 0.0, 1.0);
        m.aim_pace(t, goal);
      }
      const double h = 1e-4;
      const Time at = t + 5 * kMs;
      const FlatState before = m.at(at - from_seconds(h)), here = m.at(at),
                      after = m.at(at + from_seconds(h));
      ASSERT_LT(((after.p_NB - before.p_NB) / (2 * h) - here.v_NB).norm(), 1e-4);
      ASSERT_LT(((after.v_NB - before.v_NB) / (2 * h) - here.a_NB).norm(), 1e-2);
      const double j = std::max(here.j_NB.norm(), 1.0);
      ASSERT_LT(((after.a_NB - before.a_NB) / (2 * h) - here.j_NB).norm(), 0.05 * j);
    }
  }
}

TEST(Maneuver, WaitsWhereItIsAndFallsBehindByAsMuch) {
  Rng rng(7);
  Maneuver m = Maneuver::landing(some_landing(rng), 0, 0.08);
  m.aim_pace(kSecond, 0);
  const FlatState waiting = m.at(10 * kSecond);
  EXPECT_TRUE(waiting.v_NB.isZero(1e-9));
  EXPECT_TRUE(waiting.a_NB.isZero(1e-9));
  EXPECT_LT((m.at(15 * kSecond).p_NB - waiting.p_NB).norm(), 1e-9);
  EXPECT_NEAR(m.lag(15 * kSecond) - m.lag(10 * kSecond), 5, 1e-9);
  EXPECT_FALSE(m.done(100 * kSecond));
  m.aim_pace(15 * kSecond, 1);
  EXPECT_TRUE(m.done(100 * kSecond));
}

TEST(Maneuver, SinksPastTheEndByNoMoreThanIsAllowed) {
  Rng rng(3);
  Trajectory trajectory = some_landing(rng);
  auto& last = trajectory.c[1];
  last[kControlPoints - 1] = last[kControlPoints - 2] - Vector3(0, 0, 0.05);
  const Maneuver m = Maneuver::landing(trajectory, 0, 0.08);
  const Time end = from_seconds(trajectory.duration());
  const double z_end = m.at(end).p_NB.z();
  EXPECT_LT(m.at(end + 50 * kMs).p_NB.z(), z_end);
  EXPECT_NEAR(m.at(end + 60 * kSecond).p_NB.z(), z_end - 0.08, 1e-9);
  EXPECT_TRUE(m.at(end + 60 * kSecond).v_NB.isZero());
  EXPECT_NEAR(m.past_end(end + kSecond), 1, 1e-9);
}

}  // namespace
}  // namespace alight
