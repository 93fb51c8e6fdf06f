#include "alight/sim/camera_faults.h"

#include <algorithm>
#include <cmath>

#include "alight/sim/camera_renderer.h"

namespace alight {
namespace {

constexpr std::size_t kNormals = 16384;
constexpr double kGlareWidth = 0.2;  // sd, share of the picture's width
constexpr std::uint8_t kCovered = 2;

std::uint8_t clipped(float level) {
  return static_cast<std::uint8_t>(std::clamp(level, 0.0f, 255.0f));
}

}  // namespace

CameraFaults::CameraFaults(std::vector<FaultScenario> faults, Rng rng)
    : faults_(std::move(faults)), rng_(rng.fork("flicker")) {}

PictureTrouble CameraFaults::at(Time t, std::uint64_t index) const {
  PictureTrouble trouble;
  trouble.led_gain.fill(1);
  for (std::size_t k = 0; k < faults_.size(); ++k) {
    const FaultScenario& f = faults_[k];
    if (!f.on(t)) continue;
    double& gain = trouble.led_gain[static_cast<std::size_t>(f.led)];
    switch (f.kind) {
      case FaultKind::led_dead:
        gain = 0;
        break;
      case FaultKind::led_flicker: {
        const std::uint64_t which[2] = {index, k};
        Rng chance = rng_.fork({reinterpret_cast<const char*>(which), sizeof(which)});
        if (!chance.chance(f.lit_share)) gain = 0;
        break;
      }
      case FaultKind::led_dim:
        gain *= f.brightness;
        break;
      case FaultKind::camera_noise:
        trouble.noise_counts = std::hypot(trouble.noise_counts, f.noise_counts);
        break;
      case FaultKind::camera_glare:
        trouble.glare_counts += f.glare_counts;
        break;
      case FaultKind::camera_exposure:
        trouble.exposure_factor *= f.exposure_factor;
        break;
      case FaultKind::camera_occlusion:
        trouble.covered_share = std::max(trouble.covered_share, f.covered_share);
        break;
      case FaultKind::other_drone:
        trouble.X_NB_other = make_pose(Matrix3::Identity(),
                                       Vector3(f.other_x_m, f.other_y_m, f.other_z_m));
        break;
      case FaultKind::depth_wrong:
        trouble.depth_factor *= f.depth_factor;
        break;
      default:
        continue;
    }
    trouble.any = true;
  }
  return trouble;
}

PictureSpoiler::PictureSpoiler(Rng rng) : normal_(kNormals) {
  glare_.x() = rng.uniform(0.2, 0.8);
  glare_.y() = rng.uniform(0.2, 0.8);
  side_ = static_cast<int>(rng.uniform(0, 4));
  for (float& n : normal_) n = static_cast<float>(rng.normal());
}

void PictureSpoiler::expose(const PictureTrouble& trouble, ColorBuffer& color) {
  if (trouble.exposure_factor == 1) return;
  std::array<std::uint8_t, 256> level;
  for (std::size_t i = 0; i < level.size(); ++i) {
    level[i] = clipped(
        static_cast<float>(trouble.exposure_factor) * static_cast<float>(i) + 0.5f);
  }
  for (std::uint8_t& pixel : color.write_all()) pixel = level[pixel];
}

void PictureSpoiler::add_glare(double counts, ColorBuffer& color) {
  const auto gauss = [](double x) {
    return static_cast<float>(std::exp(-0.5 * x * x));
  };
  const double sd = kGlareWidth * color.width;
  across_.resize(static_cast<std::size_t>(color.width));
  for (int u = 0; u < color.width; ++u) {
    across_[static_cast<std::size_t>(u)] = gauss((u - glare_.x() * color.width) / sd);
  }
  std::uint8_t* pixel = color.write_all().data();
  for (int v = 0; v < color.height; ++v) {
    const float row =
        static_cast<float>(counts) * gauss((v - glare_.y() * color.height) / sd);
    for (const float column : across_) {
      for (int c = 0; c < 3; ++c, ++pixel) {
        *pixel = clipped(static_cast<float>(*pixel) + row * column + 0.5f);
      }
    }
  }
}

void PictureSpoiler::add_noise(double counts, Rng rng, ColorBuffer& color) const {
  const auto sd = static_cast<float>(counts);
  const std::size_t row = static_cast<std::size_t>(color.width) * 3;
  const std::span<std::uint8_t> pixels = color.write_all();
  for (std::size_t begin = 0; begin < pixels.size(); begin += row) {
    std::size_t draw = rng.bits() % kNormals;
    for (std::size_t i = begin; i < begin + row;) {
      // Whole runs of the table, for the machine to take several pixels at once.
      const std::size_t run = std::min(kNormals - draw, begin + row - i);
      std::uint8_t* const pixel = pixels.data() + i;
      const float* const normal = normal_.data() + draw;
      for (std::size_t k = 0; k < run; ++k) {
        pixel[k] = clipped(static_cast<float>(pixel[k]) + sd * normal[k] + 0.5f);
      }
      i += run;
      draw = 0;
    }
  }
}

PictureSpoiler::Box PictureSpoiler::covered(double share, int width, int height) const {
  const int across = static_cast<int>(std::lround(share * width));
  const int down = static_cast<int>(std::lround(share * height));
  switch (side_) {
    case 0:
      return {0, 0, across, height};
    case 1:
      return {width - across, 0, width, height};
    case 2:
      return {0, 0, width, down};
    default:
      return {0, height - down, width, height};
  }
}

void PictureSpoiler::spoil(const PictureTrouble& trouble, Rng rng, ColorBuffer& color) {
  if (trouble.glare_counts > 0) add_glare(trouble.glare_counts, color);
  if (trouble.covered_share > 0) {
    const Box box = covered(trouble.covered_share, color.width, color.height);
    for (int v = box.v0; v < box.v1; ++v) {
      const int count = box.u1 - box.u0;
      std::fill_n(color.write(box.u0, v, count), 3 * count, kCovered);
    }
  }
  if (trouble.noise_counts > 0) add_noise(trouble.noise_counts, rng, color);
}

void PictureSpoiler::spoil(const PictureTrouble& trouble, DepthBuffer& depth) const {
  if (trouble.depth_factor != 1) {
    for (std::uint16_t& mm : depth.write_all()) {
      const double wrong = std::round(trouble.depth_factor * mm);
      mm = static_cast<std::uint16_t>(std::min(wrong, 65535.0));
    }
  }
  if (trouble.covered_share > 0) {  // nearer than stereo sees
    const Box box = covered(trouble.covered_share, depth.width, depth.height);
    for (int v = box.v0; v < box.v1; ++v) {
      const int count = box.u1 - box.u0;
      std::fill_n(depth.write(box.u0, v, count), count, std::uint16_t{0});
    }
  }
}

}  // namespace alight
