#include "alight/sim/camera_renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "alight/base/rng.h"
#include "alight/geometry/row_delay.h"
#include "alight/geometry/so3.h"
#include "alight/geometry/stored_light.h"

namespace alight {
namespace {

/// Four LEDs so far apart that their images never touch at the distances used here.
Rig wide_rig() {
  Rig rig = alan_rig();
  rig.drone.arm_m = 0.09;
  rig.leds.leds = {Led{Vector3(0.07, -0.1, -0.05), LedColor::green},
                   Led{Vector3(0.07, 0.1, -0.05), LedColor::red},
                   Led{Vector3(0.07, 0, -0.15), LedColor::blue},
                   Led{Vector3(0.07, 0, 0.12), LedColor::white}};
  return rig;
}

/// No light but the LEDs', no noise, nothing saturated.
CameraSimConfig clean() {
  CameraSimConfig config;
  config.noise = 0;
  config.lights = 0;
  config.pad_reflectance = 0;
  config.led_brightness_spread = 0;
  config.led_peak_at_1m = 1e6;
  config.led_peak_max = 180;
  return config;
}

CameraRenderer make(const CameraSimConfig& config, const Rig& rig,
                    std::uint64_t seed = 1) {
  auto renderer = CameraRenderer::create(config, rig, seed);
  EXPECT_TRUE(renderer);
  return std::move(*renderer);
}

ColorBuffer picture(CameraRenderer& renderer, std::vector<SceneAt> exposure,
                    std::uint64_t frame = 0) {
  ColorBuffer color;
  EXPECT_TRUE(renderer.render(frame, exposure, color));
  return color;
}

SceneAt facing(const Vector3& p_NB, const Matrix3& R_NB = Matrix3::Identity()) {
  SceneAt scene;
  scene.X_NB = make_pose(R_NB, p_NB);
  return scene;
}

/// Pose at `t` s after the picture's time, of what moves and turns evenly.
SceneAt moving(Seconds t) {
  return facing(Vector3(-0.7, 0.05, 0.35) + t * Vector3(0.3, 1.5, -1.2),
                so3_exp(Vector3(0.2, -0.1, 1.0) * t));
}

struct Moments {
  double light = 0;  // above the dark level
  Vector2 mean = Vector2::Zero();
  Matrix2 cov = Matrix2::Zero();
  double peak = 0;
};

/// Of all channels together, in a window about `uv`.
Moments moments(const ColorBuffer& color, const ColorBuffer& dark, const Vector2& uv,
                int half) {
  Moments m;
  const int cu = static_cast<int>(std::lround(uv.x()));
  const int cv = static_cast<int>(std::lround(uv.y()));
  for (int pass = 0; pass < 2; ++pass) {
    for (int v = std::max(cv - half, 0); v <= std::min(cv + half, color.height - 1);
         ++v) {
      for (int u = std::max(cu - half, 0); u <= std::min(cu + half, color.width - 1);
           ++u) {
        const auto at = static_cast<std::size_t>((v * color.width + u) * 3);
        double w = 0;
        for (std::size_t c = 0; c < 3; ++c) {
          w += color.pixels()[at + c] - dark.pixels()[at + c];
        }
        const Vector2 p(u, v);
        if (pass == 0) {
          m.light += w;
          m.mean += w * p;
          m.peak = std::max(m.peak, w);
        } else {
          m.cov += w * (p - m.mean) * (p - m.mean).transpose();
        }
      }
    }
    if (pass == 0) m.mean /= m.light;
  }
  m.cov /= m.light;
  return m;
}

/// A picture with the drone far out of sight.
ColorBuffer unlit(CameraRenderer& renderer) {
  return picture(renderer, {facing({5, 0, 0.5})});
}

// Rows are exposed one after the other: an LED stands where it was when its row was.
TEST(CameraRenderer, ARollingShutterSeesEachLedWhenItsRowIsExposed) {
  Rig rig = wide_rig();
  rig.timing.readout_ms = 16;
  rig.timing.exposure_ms = 0.2;
  CameraSimConfig config = clean();
  config.hidden_by_body = false;
  config.led_peak_at_1m = 1e6;
  config.led_peak_max = 1500;
  CameraRenderer renderer = make(config, rig);
  std::vector<SceneAt> exposure, nothing;
  for (int k = -3; k <= 3; ++k) {
    exposure.push_back(moving(k / 6.0 * span_of(rig.timing)));
  }
  nothing.push_back(facing({5, 0, 0}));
  const ColorBuffer color = picture(renderer, exposure);
  const ColorBuffer dark = picture(renderer, nothing);
  const int height = rig.camera.intrinsics.height;
  double most = 0;
  for (int i = 0; i < rig.leds.size(); ++i) {
    Vector2 expected;
    Seconds t = 0;
    for (int round = 0; round < 20; ++round) {
      expected = *project_led(rig.camera, moving(t).X_NB, rig.leds.p_BL(i));
      t = row_delay(expected.y(), height, 0.016);
    }
    const Vector2 at_once = *project_led(rig.camera, moving(0).X_NB, rig.leds.p_BL(i));
    most = std::max(most, (expected - at_once).norm());
    EXPECT_LT((moments(color, dark, expected, 6).mean - expected).norm(), 0.05)
        << "LED " << i;
  }
  EXPECT_GT(most, 2) << "else nothing is shown";
}

TEST(CameraRenderer, UnsaturatedImagesLieWhereTheLensPutsThem) {
  Rig rig = wide_rig();
  rig.camera.intrinsics.distortion = {-0.05, 0.02, 0.001, -0.001, 0};
  CameraSimConfig config = clean();
  config.halo = 0;  // its skirt is below one level and rounds unevenly
  CameraRenderer renderer = make(config, rig);
  const ColorBuffer dark = unlit(renderer);
  Rng rng(7);
  double worst = 0, sum = 0;
  int count = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Vector3 p_NB(rng.uniform(-1.2, -0.2), rng.uniform(-0.3, 0.3),
                       rng.uniform(0.3, 0.7));
    const Matrix3 R_NB = from_rpy(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3),
                                  rng.uniform(-0.3, 0.3));
    const ColorBuffer color = picture(renderer, {facing(p_NB, R_NB)});
    for (int i = 0; i < rig.leds.size(); ++i) {
      const auto uv = project_led(rig.camera, make_pose(R_NB, p_NB), rig.leds.p_BL(i));
      if (!uv || !rig.camera.intrinsics.contains(*uv, 12)) continue;
      const Moments m = moments(color, dark, *uv, 7);
      if (m.light < 800) continue;  // hidden, at an angle
      worst = std::max(worst, (m.mean - *uv).norm());
      sum += (m.mean - *uv).squaredNorm();
      ++count;
    }
  }
  EXPECT_GT(count, 1000);
  EXPECT_LT(std::sqrt(sum / count), 0.01);
  EXPECT_LT(worst, 0.025);  // levels are whole numbers
}

TEST(CameraRenderer, TheSameSeedAndFrameGiveTheSameBits) {
  CameraSimConfig config;
  config.jpeg = 0;
  CameraRenderer one = make(config, alan_rig(), 5), two = make(config, alan_rig(), 5);
  const std::vector<SceneAt> scene{facing({-0.8, 0.1, 0.5}), facing({-0.8, 0.11, 0.5})};
  ColorBuffer a, b;
  DepthBuffer da, db;
  ASSERT_TRUE(one.render(3, scene, a, &da));
  for (std::uint64_t frame = 0; frame < 6; ++frame) {
    ASSERT_TRUE(two.render(5 - frame, scene, b, &db));  // another order
    EXPECT_EQ(a.pixels() == b.pixels(), 5 - frame == 3);
    EXPECT_EQ(da.pixels() == db.pixels(), 5 - frame == 3);
  }
  CameraRenderer other = make(config, alan_rig(), 6);
  EXPECT_NE(picture(other, scene, 3).pixels(), a.pixels());
}

TEST(CameraRenderer, DepthDoesNotChangeColour) {
  CameraRenderer renderer = make({}, alan_rig());
  const std::vector<SceneAt> scene{facing({-0.8, 0.1, 0.5})};
  ColorBuffer with;
  DepthBuffer depth;
  ASSERT_TRUE(renderer.render(9, scene, with, &depth));
  EXPECT_EQ(with.pixels(), picture(renderer, scene, 9).pixels());
}

TEST(CameraRenderer, LightFallsWithTheSquareOfDistance) {
  CameraSimConfig config = clean();
  config.led_peak_max = 1e6;
  config.led_peak_at_1m = 150;
  config.hidden_by_body = false;
  CameraRenderer renderer = make(config, wide_rig());
  const ColorBuffer dark = unlit(renderer);
  const Rig rig = wide_rig();
  double before = 1e9;
  std::vector<double> scaled;
  for (double x = -0.5; x > -1.6; x -= 0.1) {
    const SceneAt scene = facing({x, 0, 0.55});
    const auto uv = project_led(rig.camera, scene.X_NB, rig.leds.p_BL(3));
    const double light = moments(picture(renderer, {scene}), dark, *uv, 9).light;
    EXPECT_LT(light, before);
    before = light;
    const Vector3 ray = rig.camera.X_NC.translation() - scene.X_NB * rig.leds.p_BL(3);
    scaled.push_back(light * ray.squaredNorm() / ray.normalized().x());
  }
  for (const double s : scaled) EXPECT_NEAR(s / scaled.front(), 1, 0.06);
}

TEST(CameraRenderer, LightFallsWhenTheDroneTurnsAway) {
  CameraSimConfig config = clean();
  config.hidden_by_body = false;
  const Rig rig = wide_rig();
  CameraRenderer renderer = make(config, rig);
  const ColorBuffer dark = unlit(renderer);
  double before = 1e9;
  for (double yaw = 0; yaw < 1.5; yaw += 0.2) {
    const SceneAt scene = facing({-0.8, 0, 0.5}, from_rpy(0, 0, yaw));
    const auto uv = project_led(rig.camera, scene.X_NB, rig.leds.p_BL(0));
    const double light = moments(picture(renderer, {scene}), dark, *uv, 9).light;
    EXPECT_LT(light, before);
    before = light;
  }
  const SceneAt back = facing({-0.8, 0, 0.5}, from_rpy(0, 0, kPi));
  EXPECT_EQ(picture(renderer, {back}).pixels(), dark.pixels());
}

TEST(CameraRenderer, MotionBlursAlongThePath) {
  const Rig rig = wide_rig();
  CameraRenderer renderer = make(clean(), rig);
  const ColorBuffer dark = unlit(renderer);
  const Vector3 p_NB(-0.8, 0, 0.5);
  const auto at = [&](const Vector3& p) {
    return *project_led(rig.camera, make_pose(Matrix3::Identity(), p),
                        rig.leds.p_BL(3));
  };
  for (int direction = 0; direction < 12; ++direction) {
    const double angle = direction * kPi / 12;
    const Vector3 step = 0.012 * Vector3(0, std::cos(angle), std::sin(angle));
    const Vector2 from = at(p_NB - step), to = at(p_NB + step);
    const Moments sharp =
        moments(picture(renderer, {facing(p_NB)}), dark, at(p_NB), 16);
    const Moments m =
        moments(picture(renderer, {facing(p_NB - step), facing(p_NB + step)}), dark,
                at(p_NB), 16);
    const Vector2 along = (to - from).normalized();
    const Vector2 across(-along.y(), along.x());
    const double stretch = along.dot((m.cov - sharp.cov) * along);
    EXPECT_NEAR(stretch, (to - from).squaredNorm() / 12, 0.15 * stretch);
    EXPECT_NEAR(across.dot((m.cov - sharp.cov) * across), 0, 0.3);
    EXPECT_NEAR(m.light / sharp.light, 1, 0.05);  // spread, not lost
    EXPECT_LT((m.mean - 0.5 * (from + to)).norm(), 0.05);
    EXPECT_LT(m.peak, sharp.peak);
  }
}

// Of a way shorter than the light, too, which one or two images of it would not show.
TEST(CameraRenderer, ShortMotionBlursByAsMuch) {
  const Rig rig = wide_rig();
  CameraRenderer renderer = make(clean(), rig);
  const ColorBuffer dark = unlit(renderer);
  for (const double step_m : {0.0005, 0.001, 0.0015}) {
    double wanted = 0, found = 0;
    constexpr int kPlaces = 30;
    for (int place = 0; place < kPlaces; ++place) {
      const Vector3 p_NB(-0.8, 0.0013 * place, 0.5 + 0.0007 * place);
      const auto at = [&](double offset) {
        return facing(p_NB + Vector3(0, offset, 0));
      };
      const auto image = [&](double offset) {
        return *project_led(rig.camera, at(offset).X_NB, rig.leds.p_BL(3));
      };
      const Vector2 way = image(step_m) - image(-step_m), middle = image(0);
      const Moments sharp = moments(picture(renderer, {at(0)}), dark, middle, 16);
      const Moments blurred =
          moments(picture(renderer, {at(-step_m), at(step_m)}), dark, middle, 16);
      const Vector2 along = way.normalized();
      wanted += way.squaredNorm() / 12 / kPlaces;
      found += along.dot((blurred.cov - sharp.cov) * along) / kPlaces;
    }
    EXPECT_NEAR(found, wanted, 0.01 + 0.15 * wanted) << step_m;
  }
}

TEST(CameraRenderer, ABrightCoreIsWhiteAndItsSurroundingsColoured) {
  CameraSimConfig config = clean();
  config.led_peak_max = 2000;
  const Rig rig = wide_rig();
  CameraRenderer renderer = make(config, rig);
  const SceneAt scene = facing({-0.5, 0, 0.5});
  const ColorBuffer color = picture(renderer, {scene});
  const auto pixel = [](const ColorBuffer& from, const Vector2& uv, int c) -> int {
    const auto u = static_cast<int>(std::lround(uv.x()));
    const auto v = static_cast<int>(std::lround(uv.y()));
    return from.pixels()[static_cast<std::size_t>((v * from.width + u) * 3 + c)];
  };
  const ColorBuffer dark = unlit(renderer);
  const int strongest[] = {1, 2, 0};
  for (int i = 0; i < 3; ++i) {
    const Vector2 uv = *project_led(rig.camera, scene.X_NB, rig.leds.p_BL(i));
    for (int c = 0; c < 3; ++c) {
      EXPECT_GT(pixel(color, uv, c), 230);
      if (c == strongest[i]) continue;
      const Vector2 beside = uv + Vector2(3, 0);
      const auto glow = [&](int channel) {
        return pixel(color, beside, channel) - pixel(dark, beside, channel);
      };
      EXPECT_GT(glow(strongest[i]), glow(c) + 4);
    }
  }
}

TEST(CameraRenderer, JpegKeepsTheBlobsInPlace) {
  CameraSimConfig config = clean();
  config.jpeg = 85;
  const Rig rig = wide_rig();
  CameraRenderer renderer = make(config, rig);
  const ColorBuffer dark = unlit(renderer);
  const SceneAt scene = facing({-0.8, 0, 0.5});
  const ColorBuffer color = picture(renderer, {scene});
  config.jpeg = 0;
  CameraRenderer plain = make(config, rig);
  EXPECT_NE(color.pixels(), picture(plain, {scene}).pixels());
  for (int i = 0; i < rig.leds.size(); ++i) {
    const Vector2 uv = *project_led(rig.camera, scene.X_NB, rig.leds.p_BL(i));
    EXPECT_LT((moments(color, dark, uv, 4).mean - uv).norm(), 0.3);
  }
}

/// Mean and sd of a normal level rounded and cut at 0, by summing over the levels.
void expect_level(const ColorBuffer& color, std::size_t channel, double mean,
                  double sd) {
  double sum = 0, square = 0;
  int highest = 0;
  const std::size_t count = color.pixels().size() / 3;
  for (std::size_t i = channel; i < color.pixels().size(); i += 3) {
    sum += color.pixels()[i];
    square += color.pixels()[i] * color.pixels()[i];
    highest = std::max<int>(highest, color.pixels()[i]);
  }
  double expected = 0, expected_square = 0;
  for (int level = 0; level < 256; ++level) {
    const auto below = [&](double x) {
      return 0.5 * std::erfc(-(x - mean) / (sd * std::sqrt(2.0)));
    };
    const double share = below(level + 0.5) - (level == 0 ? 0.0 : below(level - 0.5));
    expected += share * level;
    expected_square += share * level * level;
  }
  const double n = static_cast<double>(count);
  EXPECT_NEAR(sum / n, expected, 0.05);
  EXPECT_NEAR(std::sqrt(square / n - sum * sum / n / n),
              std::sqrt(expected_square - expected * expected), 0.05);
  EXPECT_LT(highest, 60);
}

TEST(CameraRenderer, NoiseCoversTheWholeFrame) {
  for (const double noise : {0.5, 1.0, 3.0}) {
    CameraSimConfig config = clean();
    config.noise = noise;
    CameraRenderer renderer = make(config, alan_rig());
    const ColorBuffer color = unlit(renderer);
    expect_level(color, 0, config.dark_level * 1.2, 1.5 * noise);
    expect_level(color, 1, config.dark_level * 0.3, 1.5 * noise);
    expect_level(color, 2, config.dark_level * 1.4, 1.5 * noise);
    // Every row is noisy, and unlike the row before it and itself in the next frame.
    ColorBuffer next;
    ASSERT_TRUE(renderer.render(1, std::vector{facing({5, 0, 0.5})}, next));
    const auto row = [](const ColorBuffer& b, int v) {
      return std::vector<int>(b.pixels().begin() + v * b.width * 3,
                              b.pixels().begin() + (v + 1) * b.width * 3);
    };
    for (int v = 1; v < color.height; ++v) {
      ASSERT_NE(row(color, v), row(color, v - 1));
      ASSERT_NE(row(color, v), row(next, v));
    }
  }
}

TEST(CameraRenderer, UnderAMosaicEveryPixelSeesOneColour) {
  const SceneAt scene = facing({-0.8, 0, 0.5});
  Rig rig = wide_rig();
  CameraSimConfig config;
  CameraRenderer whole = make(config, rig);
  const ColorBuffer colors = picture(whole, {scene});
  for (const Mosaic mosaic : {Mosaic::rggb, Mosaic::gbrg}) {
    rig.mosaic = mosaic;
    CameraRenderer renderer = make(config, rig);
    ColorBuffer seen = picture(renderer, {scene});
    const auto own = [&](const ColorBuffer& of) {
      std::vector<std::uint8_t> raw(of.pixels().size() / 3);
      take_own_colors(of.pixels().data(), of.width, of.height, mosaic, raw.data());
      return raw;
    };
    EXPECT_EQ(own(seen), own(colors));
    EXPECT_FALSE(seen.pixels() == colors.pixels());
    // Drawn over, a buffer shows nothing of what was in it.
    EXPECT_TRUE(renderer.render(3, std::vector<SceneAt>{scene}, seen));
    EXPECT_TRUE(seen.pixels() == picture(renderer, {scene}, 3).pixels());
  }
}

TEST(CameraRenderer, StoresLightAsTheRigSays) {
  const SceneAt scene = facing({-0.8, 0, 0.5});
  Rig rig = wide_rig();
  const CameraSimConfig config;
  CameraRenderer linear = make(config, rig);
  const ColorBuffer light = picture(linear, {scene});
  rig.gamma = 2.2;
  CameraRenderer renderer = make(config, rig);
  ColorBuffer seen = picture(renderer, {scene});
  const GreyTable stored = stored_of_light(2.2);
  for (std::size_t i = 0; i < light.pixels().size(); ++i) {
    ASSERT_EQ(seen.pixels()[i], stored[light.pixels()[i]]);
  }
  // Drawn over, a buffer shows nothing of what was in it.
  EXPECT_TRUE(renderer.render(3, std::vector<SceneAt>{scene}, seen));
  EXPECT_TRUE(seen.pixels() == picture(renderer, {scene}, 3).pixels());
}

TEST(CameraRenderer, ShotNoiseGrowsWithLight) {
  CameraSimConfig config = clean();
  config.noise = 1;
  config.read_noise_sd = 0;
  const Rig rig = wide_rig();
  CameraRenderer renderer = make(config, rig);
  const SceneAt scene = facing({-0.8, 0, 0.5});
  const Vector2 uv = *project_led(rig.camera, scene.X_NB, rig.leds.p_BL(3));
  const auto level = [&](const ColorBuffer& c, int du) {
    const int u = static_cast<int>(std::lround(uv.x())) + du;
    const int v = static_cast<int>(std::lround(uv.y()));
    return static_cast<double>(
        c.pixels()[static_cast<std::size_t>((v * c.width + u) * 3 + 1)]);
  };
  double sd[2] = {}, mean[2] = {};
  constexpr int kFrames = 400;
  for (int frame = 0; frame < kFrames; ++frame) {
    const ColorBuffer c = picture(renderer, {scene}, static_cast<std::uint64_t>(frame));
    for (int k = 0; k < 2; ++k) {
      mean[k] += level(c, 2 * k) / kFrames;
      sd[k] += level(c, 2 * k) * level(c, 2 * k) / kFrames;
    }
  }
  for (int k = 0; k < 2; ++k) {
    sd[k] = std::sqrt(sd[k] - mean[k] * mean[k]);
    const double expected = std::sqrt(0.1 * mean[k] + 1.0 / 12);  // rounding adds 1/12
    EXPECT_NEAR(sd[k], expected, 0.2 * expected);
  }
  EXPECT_GT(sd[0], sd[1]);
}

}  // namespace
}  // namespace alight
