#include "alight/geometry/led_frame.h"

#include <gtest/gtest.h>

#include "alight/geometry/rig.h"

namespace alight {
namespace {

const Pose kX_NB = make_pose(from_rpy(0.05, -0.1, 0.2), Vector3(-1.2, 0.1, 0.4));

TEST(ProjectObservation, IsTheMeanOfItsLeds) {
  const Rig rig = alan_rig();
  for (std::uint16_t which = 1; which < 64; ++which) {
    Matrix26 J, J_sum = Matrix26::Zero();
    Vector2 sum = Vector2::Zero();
    int n = 0;
    for (int i = 0; i < 6; ++i) {
      if (((which >> i) & 1) == 0) continue;
      Matrix26 J_i;
      sum += *project_led(rig.camera, kX_NB, rig.leds.p_BL(i), &J_i);
      J_sum += J_i;
      ++n;
    }
    const auto uv = project_observation(rig.camera, kX_NB, rig.leds, which, &J);
    ASSERT_TRUE(uv);
    EXPECT_LT((*uv - sum / n).norm(), 1e-12);
    EXPECT_LT((J - J_sum / n).norm(), 1e-9);
    EXPECT_LT((*uv - *project_observation(rig.camera, kX_NB, rig.leds, which)).norm(),
              1e-10);
  }
}

TEST(ProjectObservation, NeedsLedsInFrontOfTheLens) {
  const Rig rig = alan_rig();
  EXPECT_FALSE(project_observation(rig.camera, kX_NB, rig.leds, 0));
  EXPECT_FALSE(
      project_observation(rig.camera, kX_NB, rig.leds, 1 << 6));  // no such LED
  const Pose behind = make_pose(Matrix3::Identity(), Vector3(3, 0, 0));
  EXPECT_FALSE(project_observation(rig.camera, behind, rig.leds, 0b111111));
}

TEST(LedFrame, CountsMergedLedsEach) {
  LedFrame frame;
  EXPECT_EQ(frame.led_count(), 0);
  LedObservation o;
  o.leds = 0b000011;
  frame.seen.push_back(o);
  o.leds = 0b100000;
  frame.seen.push_back(o);
  EXPECT_EQ(frame.led_count(), 3);
}

TEST(LedFrame, NamesAreDistinct) {
  EXPECT_STREQ(to_string(LedColor::red), "red");
  EXPECT_STREQ(to_string(LedColor::none), "none");
  EXPECT_STREQ(to_string(Refusal::gated), "gated");
  EXPECT_STREQ(to_string(Refusal::off_constellation), "off_constellation");
}

}  // namespace
}  // namespace alight
