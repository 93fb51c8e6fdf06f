#include "alight/planning/certificate.h"

#include <gtest/gtest.h>

#include <cstring>

#include "alight/base/rng.h"
#include "alight/planning/corridor.h"

namespace alight {
namespace {

struct Case {
  CertificateTask task;
  Trajectory trajectory;
};

Case landing() {
  Case made;
  made.task.rig = alan_rig();
  made.task.config.time_samples = 7;
  made.task.request.from.p_NB = {-1.2, 0, 0.8};
  made.task.request.platform.v_IN_N = {0.9, 0, 0};
  made.task.request.platform.w_IN_N = {0, 0, 0.6};
  made.task.request.platform.a_IN_N = {0, 0.54, 0};
  made.task.end = landing_end(made.task.config, made.task.rig);
  const auto planner = Planner::create(made.task.config, made.task.rig);
  const PlanResult result = planner->plan(made.task.request);
  EXPECT_TRUE(result.ok()) << result.reason;
  made.trajectory = result.trajectory;
  return made;
}

double margin(const Certificate& certificate, const char* name) {
  for (const CertificateEntry& entry : certificate) {
    if (std::strcmp(entry.constraint, name) == 0) return entry.margin;
  }
  ADD_FAILURE() << name << " is not in the certificate";
  return 0;
}

TEST(BernsteinMaximum, BoundsThePolynomialTightly) {
  Rng rng(2);
  for (int trial = 0; trial < 100; ++trial) {
    double c[15];
    const int count = 2 + trial % 14;
    for (double& value : c) value = rng.uniform(-3, 3);
    const double bound = bernstein_maximum(c, count, 1e-6);
    double most = -1e9;
    for (int k = 0; k <= 2000; ++k) {
      std::array<double, 15> b{};
      std::copy(c, c + count, b.begin());
      const double u = k / 2000.0;
      for (int level = count - 1; level > 0; --level) {
        for (std::size_t i = 0; i < static_cast<std::size_t>(level); ++i) {
          b[i] = (1 - u) * b[i] + u * b[i + 1];
        }
      }
      most = std::max(most, b[0]);
    }
    EXPECT_GE(bound, most - 1e-12);
    EXPECT_LT(bound, most + 1e-3);
  }
}

TEST(Certificate, MarginsAreThoseOfTheSampledCurve) {
  const Case made = landing();
  const Certificate certificate = certify(made.task, made.trajectory);
  double speed = 0;
  double acceleration = 0;
  for (int i = 0; i <= 5000; ++i) {
    const FlatState s = made.trajectory.at(made.trajectory.duration() * i / 5000);
    const PlatformState& platform = made.task.request.platform;
    speed = std::max(speed, inertial_velocity_N(platform, s.p_NB, s.v_NB).norm());
    acceleration = std::max(
        acceleration, inertial_acceleration_N(platform, s.p_NB, s.v_NB, s.a_NB).norm());
  }
  EXPECT_LE(margin(certificate, "speed"), 4 - speed + 1e-9);
  EXPECT_NEAR(margin(certificate, "speed"), 4 - speed, 1e-3);
  EXPECT_LE(margin(certificate, "acceleration"), 8 - acceleration + 1e-9);
  EXPECT_NEAR(margin(certificate, "acceleration"), 8 - acceleration, 1e-3);
}

TEST(Certificate, FindsWhatIsBroken) {
  const Case good = landing();
  EXPECT_GE(weakest(certify(good.task, good.trajectory))->margin, -1e-6);

  Case bad = good;  // A dip into the pad
  bad.trajectory.c[1][4].z() -= 1;
  EXPECT_LT(margin(certify(bad.task, bad.trajectory), "pad"), -0.05);

  bad = good;  // a detour out of the picture
  bad.trajectory.c[0][3].y() += 6;
  const Certificate seen = certify(bad.task, bad.trajectory);
  EXPECT_LT(std::min(margin(seen, "view_left"), margin(seen, "view_right")), 0);
  EXPECT_LT(margin(seen, "leds_in_picture_px"), 0);

  bad = good;  // too hasty
  for (Seconds& T : bad.trajectory.durations) T *= 0.15;
  EXPECT_LT(margin(certify(bad.task, bad.trajectory), "acceleration"), 0);
  EXPECT_LT(margin(certify(bad.task, bad.trajectory), "tilt"), 0);

  bad = good;  // torn between the segments
  bad.trajectory.c[1][0].x() += 1e-3;
  EXPECT_LT(margin(certify(bad.task, bad.trajectory), "continuity"), 0);

  bad = good;  // starts elsewhere
  bad.task.request.from.v_NB.x() += 0.01;
  EXPECT_LT(margin(certify(bad.task, bad.trajectory), "start_state"), 0);

  bad = good;  // ends elsewhere
  bad.trajectory.c[1][7].x() += 0.01;
  EXPECT_LT(margin(certify(bad.task, bad.trajectory), "end_state"), 0);

  bad = good;  // no number
  bad.trajectory.c[0][4].x() = std::nan("");
  EXPECT_LT(weakest(certify(bad.task, bad.trajectory))->margin, -1);
}

TEST(FlatAttitude, ThrustCarriesTheAccelerationAndTheHeadingIsKept) {
  Rng rng(9);
  for (int i = 0; i < 100; ++i) {
    PlatformState platform;
    platform.X_IN.linear() = from_rpy(rng.normal(0, 0.1), rng.normal(0, 0.1), 1);
    platform.w_IN_N.z() = rng.normal();
    FlatState state;
    state.p_NB = {rng.normal(), rng.normal(), rng.normal()};
    state.v_NB = {rng.normal(), rng.normal(), rng.normal()};
    state.a_NB = {rng.normal(), rng.normal(), rng.normal()};
    state.yaw = rng.uniform(-3, 3);
    const Matrix3 R = flat_attitude(platform, state);
    EXPECT_LT((R * R.transpose() - Matrix3::Identity()).norm(), 1e-12);
    EXPECT_NEAR(R.determinant(), 1, 1e-12);
    EXPECT_NEAR(wrap_angle(yaw_of(R) - state.yaw), 0, 1e-9);
    const Vector3 f =
        inertial_acceleration_N(platform, state.p_NB, state.v_NB, state.a_NB) -
        gravity_N(platform);
    EXPECT_LT(f.cross(R.col(2)).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace alight
