#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

#include "alight/base/rng.h"
#include "alight/geometry/rig.h"
#include "alight/vision/led_finder.h"

namespace alight::test {

/// A dark picture with Gaussian lights in it.
struct Picture {
  int width = 848, height = 480, channels = 3;
  std::vector<double> light;
  std::vector<std::uint8_t> bytes;

  explicit Picture(int channels_in = 3, int width_in = 848, int height_in = 480)
      : width(width_in), height(height_in), channels(channels_in) {
    light.assign(static_cast<std::size_t>(width * height * channels), 0.0);
    bytes.resize(light.size());
  }

  void add(const Vector2& uv, LedColor color, double peak = 700, double sd = 1.2) {
    const Vector3 bgr = color == LedColor::red     ? Vector3(0.25, 0.2, 1)
                        : color == LedColor::green ? Vector3(0.3, 1, 0.2)
                        : color == LedColor::blue  ? Vector3(1, 0.3, 0.2)
                                                   : Vector3(1, 1, 1);
    const int reach = static_cast<int>(5 * sd) + 1;
    const int cu = static_cast<int>(std::lround(uv.x()));
    const int cv = static_cast<int>(std::lround(uv.y()));
    for (int v = std::max(cv - reach, 0); v <= std::min(cv + reach, height - 1); ++v) {
      for (int u = std::max(cu - reach, 0); u <= std::min(cu + reach, width - 1); ++u) {
        const double d2 = (Vector2(u, v) - uv).squaredNorm();
        const double value = peak * std::exp(-d2 / (2 * sd * sd));
        for (int c = 0; c < channels; ++c) {
          light[static_cast<std::size_t>((v * width + u) * channels + c)] +=
              value * (channels == 3 ? bgr[c] : 1.0);
        }
      }
    }
  }

  ImageView expose(Rng& rng, double noise_sd = 1.5) {
    for (std::size_t i = 0; i < light.size(); ++i) {
      // Uniform noise of that sd: what matters here is that it is there.
      const double noise = noise_sd * std::sqrt(12.0) * (rng.uniform() - 0.5);
      bytes[i] =
          static_cast<std::uint8_t>(std::clamp(light[i] + 3 + noise, 0.0, 255.0));
    }
    return view();
  }
  /// What stands beside column `u` on the left, within `reach` of `uv`, is dark.
  void cover_left_of(int u, const Vector2& uv, int reach) {
    const int middle_u = static_cast<int>(uv.x()), middle_v = static_cast<int>(uv.y());
    for (int v = middle_v - reach; v <= middle_v + reach; ++v) {
      for (int w = middle_u - reach; w < u; ++w) {
        for (int c = 0; c < channels; ++c) {
          bytes[static_cast<std::size_t>((v * width + w) * channels + c)] = 3;
        }
      }
    }
  }
  ImageView view() const {
    return {bytes.data(), width, height, channels,
            static_cast<std::ptrdiff_t>(width) * channels};
  }
};

/// A pose that is flown: 0.4 to 3 m from the lens, in view, tilted up to 25 deg, the
/// LEDs' side within 40 deg of the camera.
inline Pose random_pose(const Rig& rig, Rng& rng, double range_min = 0.4,
                        double range_max = 3) {
  const Intrinsics& lens = rig.camera.intrinsics;
  for (;;) {
    const double range = rng.uniform(range_min, range_max);
    const Vector2 uv(rng.uniform(40, lens.width - 40),
                     rng.uniform(40, lens.height - 40));
    const Vector3 p_NB =
        rig.camera.X_NC * Vector3(range * lens.unproject(uv).normalized());
    const Vector3 to_lens = rig.camera.X_NC.translation() - p_NB;
    const double yaw =
        std::atan2(to_lens.y(), to_lens.x()) + rng.uniform(-40 * kDegree, 40 * kDegree);
    const double tilt = rng.uniform(0, 25 * kDegree), way = rng.uniform(0, 2 * kPi);
    const Pose X_NB = make_pose(
        so3_exp(tilt * Vector3(std::cos(way), std::sin(way), 0)) * from_rpy(0, 0, yaw),
        p_NB);
    bool in_view = true;
    for (const Led& led : rig.leds.leds) {
      const auto image = project_led(rig.camera, X_NB, led.p_BL);
      in_view = in_view && image && lens.contains(*image, 8);
    }
    if (in_view) return X_NB;
  }
}

/// A blob as the detector would make of one light, its place off by `sd_px`.
inline Blob blob_at(const Vector2& uv, LedColor color, Rng& rng, double sd_px = 0.1) {
  Blob blob;
  blob.uv = uv + sd_px * Vector2(rng.normal(), rng.normal());
  blob.cov = std::max(sd_px * sd_px, 0.0025) * Matrix2::Identity();
  blob.spread = 1.2 * Matrix2::Identity();
  blob.area_px = 12;
  blob.brightness = 1500;
  blob.peak = 255;
  blob.color = color;
  return blob;
}

/// One for each LED of the rig, in its order. @pre all in front of the lens
inline std::vector<Blob> blobs_of(const Rig& rig, const Pose& X_NB, Rng& rng) {
  std::vector<Blob> blobs;
  for (const Led& led : rig.leds.leds) {
    blobs.push_back(blob_at(*project_led(rig.camera, X_NB, led.p_BL), led.color, rng));
  }
  return blobs;
}

/// Number of observations that name an LED whose image is farther than `limit_px` from
/// it and nearer to another one: swaps and strays. A merged one is right when the mean
/// of its LEDs is where it says.
inline int wrong_observations(const Rig& rig, const Pose& X_NB, const LedFrame& frame,
                              double limit_px) {
  int wrong = 0;
  for (const LedObservation& o : frame.seen) {
    const auto uv = project_observation(rig.camera, X_NB, rig.leds, o.leds);
    if (!uv || (*uv - o.uv).norm() > limit_px) ++wrong;
  }
  return wrong;
}

}  // namespace alight::test
