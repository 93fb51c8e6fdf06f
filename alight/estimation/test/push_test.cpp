#include "alight/estimation/push.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"
#include "alight/geometry/so3.h"

namespace alight {
namespace {

constexpr double kAcross = 1.7;

Vector3 z_of(double roll_deg, double pitch_deg) {
  return from_rpy(roll_deg * kDegree, pitch_deg * kDegree, 0).col(2);
}

TEST(Push, ADroneIsPushedAlongItsZ) {
  Rng rng(1);
  for (int n = 0; n < 100; ++n) {
    const Vector3 z_N = z_of(rng.uniform(-60, 60), rng.uniform(-60, 60));
    const Push push{rng.uniform(1, 20) * z_N, 0.1 * Matrix3::Identity()};
    EXPECT_NEAR(push.across(z_N), 0, 1e-9);
    EXPECT_NEAR(push.against(z_N, kAcross), 0, 1e-9);
  }
}

TEST(Push, AReadingThatLeansIsPushedAcross) {
  const Push push{Vector3(0, 0, kGravity), Matrix3::Zero()};
  for (const double deg : {10.0, 30.0, 60.0, 90.0, 150.0}) {
    // Rotors do not pull: a drone that hangs from them is held by something else.
    const double across = kGravity * (deg < 90 ? std::sin(deg * kDegree) : 1);
    EXPECT_NEAR(push.across(z_of(deg, 0)), across, 1e-9) << deg;
    EXPECT_NEAR(push.against(z_of(0, deg), kAcross), std::pow(across / kAcross, 2),
                1e-9);
  }
}

TEST(Push, ThatIsHardlyKnownSaysLittle) {
  const Vector3 z_N = z_of(40, 0);
  Push push{Vector3(0, 0, kGravity), Matrix3::Zero()};
  double before = push.against(z_N, kAcross);
  for (const double sd : {0.5, 1.0, 3.0, 10.0}) {
    push.cov = sd * sd * Matrix3::Identity();
    const double now = push.against(z_N, kAcross);
    EXPECT_LT(now, before);
    before = now;
  }
  EXPECT_LT(before, 0.5);
  // How strong it is along z does not matter.
  push.cov = 100 * z_N * z_N.transpose();
  EXPECT_NEAR(push.against(z_N, kAcross), std::pow(push.across(z_N) / kAcross, 2),
              1e-9);
}

}  // namespace
}  // namespace alight
