#include "alight/mission/landing_config.h"

#include <gtest/gtest.h>

#include <limits>

namespace alight {
namespace {

TEST(LandingConfig, NamesWhatIsOutOfBounds) {
  EXPECT_TRUE(LandingConfig::standard(alan_rig()).validate());
  const struct {
    double LandingConfig::*field;
    const char* name;
  } fields[] = {
      {&LandingConfig::event_age_max_s, "event_age_max_s"},
      {&LandingConfig::heading_smoothing, "heading_smoothing"},
      {&LandingConfig::external_velocity_sd_max_m_s, "external_velocity_sd_max_m_s"},
      {&LandingConfig::first_pose_speed_max_m_s, "first_pose_speed_max_m_s"},
      {&LandingConfig::first_pose_wait_s, "first_pose_wait_s"}};
  for (const auto& [field, name] : fields) {
    for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
      LandingConfig config = LandingConfig::standard(alan_rig());
      config.*field = bad;
      const auto valid = config.validate();
      ASSERT_FALSE(valid) << name << " " << bad;
      EXPECT_NE(valid.error().detail.find(name), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace alight
