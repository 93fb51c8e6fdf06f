#include "alight/sim/camera_background.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace alight {
namespace {

constexpr int kStripPixels = 60000;  // stays in a second-level cache
constexpr int kDepthRows = 64;
constexpr int kPatches = 300;
constexpr double kTint[3] = {1.2, 0.3, 1.4};  // dark level by channel: violet

}  // namespace

Background::Background(const CameraSimConfig& config, int width, int height, Rng rng)
    : width_(width), height_(height), depth_width_(width + width / 2) {
  Rng dark = rng.fork("dark");
  color_.resize(static_cast<std::size_t>(kStripPixels + width) * 3);
  const double sd = config.noise * config.read_noise_sd;
  for (std::size_t i = 0; i < color_.size(); ++i) {
    const double level = config.dark_level * kTint[i % 3] + sd * dark.normal();
    color_[i] = static_cast<std::uint8_t>(std::clamp(std::round(level), 0.0, 255.0));
  }

  // Walls and furniture at 2.5 to 6 m, seen in patches, a quarter of them without
  // texture. The rows close to a ring.
  Rng room = rng.fork("room");
  std::vector<double> z(static_cast<std::size_t>(depth_width_) * kDepthRows, 6.0);
  for (int patch = 0; patch < kPatches; ++patch) {
    const double depth = room.chance(0.25) ? 0 : room.uniform(2.5, 6.0);
    const int u0 = static_cast<int>(room.uniform(-100, depth_width_));
    const int u1 = std::min(u0 + static_cast<int>(room.uniform(20, 200)), depth_width_);
    const int v0 = static_cast<int>(room.uniform(0, kDepthRows));
    const int rows = static_cast<int>(room.uniform(4, 40));
    for (int v = v0; v < v0 + rows; ++v) {
      for (int u = std::max(u0, 0); u < u1; ++u) {
        z[static_cast<std::size_t>((v % kDepthRows) * depth_width_ + u)] = depth;
      }
    }
  }
  depth_.resize(z.size());
  for (std::size_t i = 0; i < z.size(); ++i) {
    const double mm = 1000 * (z[i] + config.depth_noise * z[i] * z[i] * room.normal());
    const bool hole = room.chance(0.05);
    depth_[i] = hole ? 0 : static_cast<std::uint16_t>(std::clamp(mm, 0.0, 65535.0));
  }
}

void Background::fill(Rng rng, ColorBuffer& out) const {
  const auto row_bytes = static_cast<std::size_t>(width_) * 3;
  for (int v = 0; v < height_; ++v) {
    const std::size_t from = rng.bits() % static_cast<std::size_t>(kStripPixels);
    std::memcpy(&out.pixels[static_cast<std::size_t>(v) * row_bytes], &color_[from * 3],
                row_bytes);
  }
}

void Background::fill(Rng rng, DepthBuffer& out) const {
  const auto row_bytes = static_cast<std::size_t>(width_) * sizeof(std::uint16_t);
  const auto slack = static_cast<std::size_t>(depth_width_ - width_ - 4);
  const std::size_t shift = rng.bits() % slack;
  const std::size_t first = rng.bits() % kDepthRows;
  for (int v = 0; v < height_; ++v) {
    const std::size_t row = (first + static_cast<std::size_t>(v)) % kDepthRows;
    const std::size_t from = shift + rng.bits() % 4;  // ragged edges
    std::memcpy(&out.pixels[static_cast<std::size_t>(v * width_)],
                &depth_[row * static_cast<std::size_t>(depth_width_) + from],
                row_bytes);
  }
}

}  // namespace alight
