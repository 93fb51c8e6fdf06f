#include "alight/sim/camera_config.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "alight/sim/camera_renderer.h"

namespace alight {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(CameraSimConfig, DefaultsAreValid) { EXPECT_TRUE(CameraSimConfig{}.validate()); }

TEST(CameraSimConfig, EveryFieldIsBoundedAndNamed) {
  struct Field {
    const char* name;
    double CameraSimConfig::*value;
  };
  const Field fields[] = {
      {"exposure_ms", &CameraSimConfig::exposure_ms},
      {"noise", &CameraSimConfig::noise},
      {"dark_level", &CameraSimConfig::dark_level},
      {"read_noise_sd", &CameraSimConfig::read_noise_sd},
      {"psf_sd_px", &CameraSimConfig::psf_sd_px},
      {"led_diameter_mm", &CameraSimConfig::led_diameter_mm},
      {"led_peak_at_1m", &CameraSimConfig::led_peak_at_1m},
      {"led_peak_max", &CameraSimConfig::led_peak_max},
      {"led_half_power_deg", &CameraSimConfig::led_half_power_deg},
      {"led_brightness_spread", &CameraSimConfig::led_brightness_spread},
      {"halo", &CameraSimConfig::halo},
      {"halo_sd_px", &CameraSimConfig::halo_sd_px},
      {"room_radius_m", &CameraSimConfig::room_radius_m},
      {"pad_reflectance", &CameraSimConfig::pad_reflectance},
      {"depth_noise", &CameraSimConfig::depth_noise},
      {"depth_hole_share", &CameraSimConfig::depth_hole_share},
      {"depth_offset_ms", &CameraSimConfig::depth_offset_ms},
  };
  for (const Field& field : fields) {
    for (const double bad : {-1e9, 1e9, kNan}) {
      CameraSimConfig config;
      config.*field.value = bad;
      const auto verdict = config.validate();
      ASSERT_FALSE(verdict) << field.name << " = " << bad;
      EXPECT_EQ(verdict.error().fault, Fault::invalid_config);
      EXPECT_NE(verdict.error().detail.find(field.name), std::string::npos);
    }
  }
  CameraSimConfig config;
  config.lights = -1;
  EXPECT_FALSE(config.validate());
  config = {};
  config.jpeg = 101;
  EXPECT_FALSE(config.validate());
}

TEST(CameraRenderer, RefusesAPictureOfImpossibleSize) {
  for (const int width : {-848, 0, 8, 100000}) {
    Rig rig = alan_rig();
    rig.camera.intrinsics.width = width;
    const auto made = CameraRenderer::create({}, rig, 1);
    ASSERT_FALSE(made) << width;
    EXPECT_EQ(made.error().fault, Fault::invalid_config);
  }
}

TEST(CameraRenderer, RefusesWhatIsNotAPose) {
  auto renderer = CameraRenderer::create({}, alan_rig(), 1);
  ASSERT_TRUE(renderer);
  SceneAt good;
  good.X_NB.translation() = Vector3(-0.7, 0, 0.4);
  for (int entry = 0; entry < 3; ++entry) {
    ColorBuffer color;
    SceneAt bad = good;
    (entry == 0 ? bad.X_IN : bad.X_NB).translation()[entry] = kNan;
    const std::vector<SceneAt> exposure{good, bad};
    const auto verdict = renderer->render(0, exposure, color);
    ASSERT_FALSE(verdict);
    EXPECT_EQ(verdict.error().fault, Fault::invalid_input);
    EXPECT_TRUE(color.pixels().empty());
  }
  ColorBuffer color;
  for (const std::size_t instants : {0u, 9u}) {
    EXPECT_FALSE(renderer->render(0, std::vector<SceneAt>(instants, good), color));
  }
  EXPECT_TRUE(renderer->render(0, std::vector<SceneAt>(8, good), color));
}

TEST(LedsFace, TheLensOfTheirRig) {
  Rig rig = alan_rig();
  EXPECT_EQ(leds_face(rig), Vector3(Vector3::UnitX()));
  rig.camera.X_NC.translation() = Vector3(-0.3, 0.4, 0.7);
  EXPECT_TRUE(leds_face(rig).isApprox(Vector3(-0.6, 0.8, 0), 1e-12));
  rig.camera.X_NC.translation() = Vector3(0, 0, 0.7);
  EXPECT_EQ(leds_face(rig), Vector3(Vector3::UnitX()));
}

}  // namespace
}  // namespace alight
