#include <gtest/gtest.h>

#include "alight/estimation/test/flight.h"

// Is the covariance true? Normalized estimation error squared over independent runs
// (Bar-Shalom, Li and Kirubarajan 2001, sec. 5.4).
namespace alight::test {
namespace {

constexpr int kRuns = 400;

/// 95 % bounds of the mean of `kRuns` chi-square values (normal approximation).
double low_bound(int dof) { return dof - 1.96 * std::sqrt(2.0 * dof / kRuns); }
double high_bound(int dof) { return dof + 1.96 * std::sqrt(2.0 * dof / kRuns); }

struct Nees {
  double pose = 0, full = 0;
};

/// Mean over runs whose truth is drawn from the filter's own model.
Nees matched_runs(const RelativeFilterConfig& config, int frames, bool use_depth) {
  const Rig rig = alan_rig();
  const Flight flight;  // for the inputs alone
  Nees mean;
  for (int run = 0; run < kRuns; ++run) {
    Rng rng = Rng(static_cast<std::uint64_t>(run)).fork("matched");
    MotionState truth{flight.state(0)};
    truth.d_N = normal3(rng, config.disturbance_sd);
    truth.b_N = normal3(rng, config.bias_sd);
    auto filter = RelativeFilter::create(config, rig.camera, rig.leds).value();
    Vector9 off;
    for (int i = 0; i < 9; ++i) {
      off[i] = rng.normal(0, std::sqrt(start_covariance()(i, i)));
    }
    filter.reset(0, boxplus(truth.x, off), start_covariance());
    for (int k = 1; k <= frames; ++k) {
      const Time t = from_seconds(k / 60.0);
      const auto input = flight.input((k - 0.5) / 60);
      const Seconds dt = to_seconds(t - filter.time());
      truth = moved_by_model(truth, input, dt, config, rng);
      EXPECT_TRUE(filter.predict_to(t, input).has_value());
      auto frame = picture(rig.camera, rig.leds, truth.x.X_NB(), t, 0.2, rng);
      if (use_depth) {
        for (auto& o : frame.seen) {
          const double z =
              predicted_depth(rig.camera, truth.x.X_NB(), rig.leds, o.leds);
          o.depth_m = z + rng.normal(0, std::hypot(config.depth_sd_m,
                                                   config.depth_sd_share * z));
        }
      }
      (void)filter.update(frame);
    }
    Vector15 e = boxminus(filter.motion_state(), truth);
    const Covariance9 P = filter.covariance();
    const Eigen::Matrix<double, 6, 6> P_pose = P.topLeftCorner<6, 6>();
    mean.pose += e.head<6>().dot(P_pose.llt().solve(e.head<6>())) / kRuns;
    mean.full += e.head<9>().dot(P.llt().solve(e.head<9>())) / kRuns;
  }
  return mean;
}

RelativeFilterConfig matched() {
  auto config = RelativeFilterConfig{}.with_perfect_rig();
  config.pixel_sd_px = 0;  // the pictures carry what they say
  config.gate_chi2 = 0;
  config.huber_sd = 0;
  return config;
}

TEST(Consistency, NeesWithinBoundsWhenTheModelHolds) {
  for (const int frames : {6, 60}) {
    const Nees nees = matched_runs(matched(), frames, false);
    RecordProperty("pose_nees", std::to_string(nees.pose));
    EXPECT_GT(nees.pose, low_bound(6)) << frames;
    EXPECT_LT(nees.pose, high_bound(6)) << frames;
    EXPECT_GT(nees.full, low_bound(9)) << frames;
    EXPECT_LT(nees.full, high_bound(9)) << frames;
  }
}

TEST(Consistency, NeesWithinBoundsWithGateAndRobustWeights) {
  auto config = RelativeFilterConfig{}.with_perfect_rig();
  config.pixel_sd_px = 0;
  const Nees nees = matched_runs(config, 60, false);
  EXPECT_GT(nees.pose, low_bound(6));
  EXPECT_LT(nees.pose, high_bound(6));
  EXPECT_GT(nees.full, low_bound(9));
  EXPECT_LT(nees.full, high_bound(9));
}

TEST(Consistency, NeesWithinBoundsWithDepth) {
  auto config = matched();
  config.use_depth = true;
  const Nees nees = matched_runs(config, 30, true);
  EXPECT_GT(nees.pose, low_bound(6));
  EXPECT_LT(nees.pose, high_bound(6));
}

TEST(Consistency, NeesWithinBoundsUnderTheHoverModel) {
  auto config = matched();
  config.model = ProcessModel::hover;
  const Nees nees = matched_runs(config, 30, false);
  EXPECT_GT(nees.full, low_bound(9));
  EXPECT_LT(nees.full, high_bound(9));
}

/// The rig as it truly is: LEDs, mount and focal length off as the file cannot know.
Rig true_rig(const Rig& rig, const RelativeFilterConfig& c, Rng& rng) {
  Rig out = rig;
  for (auto& led : out.leds.leds) led.p_BL += normal3(rng, c.led_position_sd_m);
  out.camera.X_NC.translation() += normal3(rng, c.mount_position_sd_m);
  out.camera.X_NC.linear() =
      so3_exp(normal3(rng, c.mount_rotation_sd_rad)) * rig.camera.X_NC.linear();
  const double scale = 1 + rng.normal(0, c.focal_sd_share);
  out.camera.intrinsics.fx *= scale;
  out.camera.intrinsics.fy *= scale;
  return out;
}

// The constant errors of the rig are budgeted, neither ignored nor paid twice. What is
// left of the bounds' width: pictures are a little better than the white share of the
// LED errors in R says, which can only lower the mean.
TEST(Consistency, CovarianceIsTrueWithTheRigOff) {
  const Rig rig = alan_rig();
  const RelativeFilterConfig config;
  for (const Vector3& place : {Vector3(-0.85, 0, 0.6), Vector3(-0.1, 0, 0.3)}) {
    Flight flight;
    flight.place_N = place;
    flight.sway_m *= 0.5;
    double total = 0, ignorant = 0;
    for (int run = 0; run < kRuns; ++run) {
      Rng rng = Rng(static_cast<std::uint64_t>(run)).fork("rig");
      const Rig truth_rig = true_rig(rig, config, rng);
      auto filter = RelativeFilter::create(config, rig.camera, rig.leds).value();
      filter.reset(0, flight.state(0), start_covariance());
      for (int k = 1; k <= 60; ++k) {
        const Time t = from_seconds(k / 60.0);
        EXPECT_TRUE(filter.predict_to(t, flight.input((k - 0.5) / 60)).has_value());
        (void)filter.update(picture(truth_rig.camera, truth_rig.leds,
                                    flight.state(to_seconds(t)).X_NB(), t, 0.2, rng));
      }
      const Vector9 e = boxminus(filter.state(), flight.state(1.0));
      const Eigen::Matrix<double, 6, 6> P = filter.covariance().topLeftCorner<6, 6>();
      const Eigen::Matrix<double, 6, 6> P_own =
          filter.tracking_covariance().topLeftCorner<6, 6>();
      total += e.head<6>().dot(P.llt().solve(e.head<6>())) / kRuns;
      ignorant += e.head<6>().dot(P_own.llt().solve(e.head<6>())) / kRuns;
    }
    EXPECT_GT(total, 0.6 * 6);
    EXPECT_LT(total, high_bound(6));
    EXPECT_GT(ignorant, 2 * 6) << "then the budget would not be needed";
  }
}

}  // namespace
}  // namespace alight::test
