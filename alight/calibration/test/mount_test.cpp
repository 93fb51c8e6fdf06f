#include "alight/calibration/mount.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"
#include "flight.h"

namespace alight {
namespace {

Vector3 normal3(Rng& rng, double a, double b, double c) {
  return {rng.normal(0, a), rng.normal(0, b), rng.normal(0, c)};
}

/// Parkings at headings, placed as the config says, seen from X_NC.
std::vector<StandingView> parkings(const MountConfig& c, const Pose& X_NC,
                                   const std::vector<double>& headings_deg, Rng& rng) {
  const Vector3 own_p = normal3(rng, c.own_place_sd_m, c.own_place_sd_m, c.height_sd_m);
  const Vector3 own_w =
      kDegree * normal3(rng, c.tilt_sd_deg, c.tilt_sd_deg, c.own_heading_sd_deg);
  std::vector<StandingView> views;
  for (const double heading : headings_deg) {
    StandingView view;
    view.X_NK = make_pose(from_rpy(0, 0, heading * kDegree), Vector3(0, 0, 0.06));
    const Vector3 place = normal3(rng, c.place_sd_m, c.place_sd_m, 0);
    const Matrix3 R =
        from_rpy(0, 0, (heading + rng.normal(0, c.heading_sd_deg)) * kDegree);
    const Pose X_NK =
        make_pose(R * so3_exp(own_w), view.X_NK.translation() + place + R * own_p);
    view.X_CK = X_NC.inverse() * X_NK;
    view.cov.setZero();
    view.cov.diagonal() << Vector3::Constant(1e-6), Vector3::Constant(1e-5);
    view.X_CK.translation() += normal3(rng, 1e-3, 1e-3, 1e-3);
    view.X_CK.linear() =
        view.X_CK.linear() * so3_exp(std::sqrt(1e-5) * normal3(rng, 1, 1, 1));
    views.push_back(view);
  }
  return views;
}

TEST(Mount, AsSureAsSaid) {
  const Pose written = alan_rig().camera.X_NC;
  for (const std::vector<double>& headings :
       {std::vector<double>{0}, std::vector<double>{-40, 0, 40, 20}}) {
    Vector3 p2 = Vector3::Zero(), w2 = Vector3::Zero();
    const int seeds = 400;
    for (unsigned seed = 0; seed < seeds; ++seed) {
      Rng rng(seed);
      const Pose truth = make_pose(written.linear() * so3_exp(normal3(rng, .1, .1, .1)),
                                   written.translation() + normal3(rng, .05, .05, .02));
      const MountConfig config;
      const auto fit =
          calibrate_mount(config, written, parkings(config, truth, headings, rng));
      ASSERT_TRUE(fit) << seed << " " << fit.error().detail;
      const Vector3 dp = fit->X_NC.translation() - truth.translation();
      Vector3 dw = mount_rpy_deg(fit->X_NC) - mount_rpy_deg(truth);
      for (int k = 0; k < 3; ++k) dw[k] = wrap_angle(dw[k] * kDegree) / kDegree;
      p2 += dp.cwiseQuotient(fit->position_sd_m).cwiseAbs2() / seeds;
      w2 += dw.cwiseQuotient(fit->rpy_sd_deg).cwiseAbs2() / seeds;
    }
    for (int k = 0; k < 3; ++k) {
      EXPECT_GT(p2[k], 0.65) << k;  // 400 values: 1 +- 0.07
      EXPECT_LT(p2[k], 1.4) << k;
      EXPECT_GT(w2[k], 0.65) << k;
      EXPECT_LT(w2[k], 1.4) << k;
    }
  }
}

TEST(Mount, OneParkingKnowsNoMoreThanHowItWasParked) {
  Rng rng(1);
  const MountConfig config;
  const Pose X_NC = alan_rig().camera.X_NC;
  const auto one = calibrate_mount(config, X_NC, parkings(config, X_NC, {0}, rng));
  const auto many =
      calibrate_mount(config, X_NC, parkings(config, X_NC, {-60, -30, 0, 30, 60}, rng));
  ASSERT_TRUE(one && many);
  EXPECT_GE(one->position_sd_m.x(), config.place_sd_m);
  EXPECT_GE(one->rpy_sd_deg.z(), config.heading_sd_deg);
  EXPECT_LT(many->rpy_sd_deg.z(), 0.75 * one->rpy_sd_deg.z());
  EXPECT_LT(many->position_sd_m.x(), one->position_sd_m.x());
  EXPECT_TRUE(std::isnan(one->off_held_out_m));
  EXPECT_TRUE(std::isfinite(many->off_held_out_m));
}

TEST(Mount, RefusesNothingVagueAndContradiction) {
  Rng rng(2);
  MountConfig config;
  const Pose X_NC = alan_rig().camera.X_NC;
  EXPECT_FALSE(calibrate_mount(config, X_NC, {}));
  auto views = parkings(config, X_NC, {0, 30, -30}, rng);
  views[1].X_NK.linear() = from_rpy(0, 0, -30 * kDegree);  // headings mixed up
  views[2].X_NK.linear() = from_rpy(0, 0, 30 * kDegree);
  const auto mixed = calibrate_mount(config, X_NC, views);
  ASSERT_FALSE(mixed);
  EXPECT_NE(mixed.error().detail.find("headings"), std::string::npos);
  config.heading_sd_deg = 20;
  const auto vague = calibrate_mount(config, X_NC, parkings(config, X_NC, {0}, rng));
  ASSERT_FALSE(vague);
  EXPECT_EQ(vague.error().fault, Fault::degenerate);
}

TEST(Mount, AParkedDroneByItsLeds) {
  Rng rng(3);
  const Rig rig = alan_rig();
  const Pose X_NB = make_pose(from_rpy(0, 0, 0.2), Vector3(0.01, 0.02, 0.06));
  std::vector<ObservedFrame> frames;
  for (int f = 0; f < 30; ++f) {
    ObservedFrame frame;
    frame.X_NB = X_NB;
    for (int i = 0; i < rig.leds.size(); ++i) {
      LedObservation o;
      o.leds = static_cast<std::uint16_t>(1u << i);
      o.uv = *project_led(rig.camera, X_NB, rig.leds.p_BL(i)) +
             Vector2(rng.normal(0, 0.2), rng.normal(0, 0.2));
      frame.seen.push_back(o);
    }
    frames.push_back(frame);
  }
  const auto view = parked_view(rig, frames, 0.001, 12);
  ASSERT_TRUE(view) << view.error().detail;
  const Pose found = rig.camera.X_NC * view->X_CK;
  EXPECT_LT((found.translation() - X_NB.translation()).norm(), 0.005);
  EXPECT_LT(angle_between(found.linear(), X_NB.linear()), 0.02);
  EXPECT_NEAR(yaw_of(view->X_NK.linear()), 12 * kDegree, 1e-12);

  for (std::size_t f = 0; f < 15; ++f) {
    for (auto& o : frames[f].seen) o.uv.x() += 4;
  }
  EXPECT_FALSE(parked_view(rig, frames, 0.001, 0));
  EXPECT_FALSE(parked_view(rig, {}, 0.001, 0));
}

}  // namespace
}  // namespace alight
