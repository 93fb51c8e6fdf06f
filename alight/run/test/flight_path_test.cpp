#include "alight/run/flight_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <vector>

namespace alight {
namespace {

constexpr Seconds kDuration = 10;

class FlightPathLaw : public testing::TestWithParam<unsigned> {
 protected:
  FlightPathLaw() : rig_(alan_rig()) {
    auto path = FlightPath::draw(config_, rig_, kDuration, Rng(GetParam()));
    EXPECT_TRUE(path);
    path_.emplace(*path);
  }

  FlightPathConfig config_;
  Rig rig_;
  std::optional<FlightPath> path_;
};

TEST_P(FlightPathLaw, VelocityIsTheDerivativeOfPosition) {
  const double h = 1e-4;
  for (Seconds t = h; t < kDuration; t += 0.31) {
    const Vector3 slope = (path_->at(t + h).p_NB - path_->at(t - h).p_NB) / (2 * h);
    EXPECT_LT((path_->at(t).v_NB - slope).norm(), 1e-4) << "at " << t;
  }
}

TEST_P(FlightPathLaw, ThrustAloneExplainsTheAcceleration) {
  const double h = 1e-3;
  for (Seconds t = h; t < kDuration; t += 0.31) {
    const Vector3 a = (path_->at(t + h).v_NB - path_->at(t - h).v_NB) / (2 * h);
    const Vector3 thrust = a + Vector3(0, 0, kGravity);
    const RelativeState x = path_->at(t);
    EXPECT_LT(thrust.normalized().cross(x.R_NB.col(2)).norm(), 1e-3) << "at " << t;
    EXPECT_TRUE((x.R_NB.transpose() * x.R_NB).isIdentity(1e-9));
    EXPECT_NEAR(x.R_NB.determinant(), 1, 1e-9);
  }
}

TEST_P(FlightPathLaw, KeepsWhatItPromises) {
  const Vector3 p_NC = rig_.camera.X_NC.translation();
  double nearest = 1e9, farthest = 0, fastest = 0;
  int close = 0, instants = 0;
  for (Seconds t = 0; t <= kDuration; t += 1.0 / 60) {
    const RelativeState x = path_->at(t);
    const double range = (x.p_NB - p_NC).norm();
    nearest = std::min(nearest, range);
    farthest = std::max(farthest, range);
    fastest = std::max(fastest, x.v_NB.norm());
    std::vector<Vector2> images;
    for (const Led& led : rig_.leds.leds) {
      const auto uv = project_led(rig_.camera, x.X_NB(), led.p_BL);
      ASSERT_TRUE(uv);
      EXPECT_TRUE(rig_.camera.intrinsics.contains(*uv, config_.border_px));
      EXPECT_GT((x.X_NB() * led.p_BL).z(), 0);
      images.push_back(*uv);
    }
    double apart = 1e9;
    for (std::size_t i = 0; i < images.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        apart = std::min(apart, (images[i] - images[j]).norm());
      }
    }
    ++instants;
    if (apart < config_.close_px) ++close;
    const Vector3 to_lens = x.R_NB.transpose() * (p_NC - x.p_NB);
    EXPECT_GT(to_lens.x(), 0) << "the LEDs face the lens";
  }
  EXPECT_GE(nearest, config_.range_min_m);
  EXPECT_LT(nearest, config_.range_min_m + 0.3);
  EXPECT_LE(farthest, config_.range_max_m);
  EXPECT_GT(farthest, config_.range_max_m - 0.3);
  EXPECT_LE(fastest, config_.speed_m_s);
  EXPECT_GE(fastest, 0.8 * config_.speed_m_s);
  EXPECT_GE(close, instants / 3);
}

INSTANTIATE_TEST_SUITE_P(Seeds, FlightPathLaw, testing::Range(0u, 5u));

TEST(FlightPath, TheSeedDecides) {
  const Rig rig = alan_rig();
  const auto a = FlightPath::draw({}, rig, kDuration, Rng(3));
  const auto b = FlightPath::draw({}, rig, kDuration, Rng(3));
  const auto c = FlightPath::draw({}, rig, kDuration, Rng(4));
  ASSERT_TRUE(a && b && c);
  EXPECT_EQ(a->at(2.5).p_NB, b->at(2.5).p_NB);
  EXPECT_GT((a->at(2.5).p_NB - c->at(2.5).p_NB).norm(), 1e-3);
}

TEST(FlightPath, SaysWhenTheCameraHasNoRoom) {
  Rig rig = alan_rig();
  for (Led& led : rig.leds.leds) led.p_BL *= 8;  // wider than the view from 0.5 m
  const auto path = FlightPath::draw({}, rig, kDuration, Rng(1));
  ASSERT_FALSE(path);
  EXPECT_EQ(path.error().fault, Fault::infeasible);
}

TEST(FlightPath, NamesASettingOutOfRange) {
  FlightPathConfig config;
  config.range_max_m = 0.1;
  const auto path = FlightPath::draw(config, alan_rig(), kDuration, Rng(1));
  ASSERT_FALSE(path);
  EXPECT_NE(path.error().detail.find("range_max_m"), std::string::npos);
}

}  // namespace
}  // namespace alight
