#include "alight/sim/camera_background.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace alight {
namespace {

constexpr int kStripPixels = 60000;  // stays in a second-level cache
constexpr int kDepthRows = 48;
constexpr double kTint[3] = {1.2, 0.6, 1.3};  // dark level by channel: violet

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

  // Walls and furniture at 2.5 to 6 m, in patches, a third of them without texture.
  Rng room = rng.fork("room");
  depth_.resize(static_cast<std::size_t>(depth_width_) * kDepthRows);
  constexpr int kPatch = 24;
  const int columns = depth_width_ / kPatch + 1;
  for (int v0 = 0; v0 < kDepthRows; v0 += kPatch) {
    for (int column = 0; column < columns; ++column) {
      const double z = room.uniform(2.5, 6.0);
      const bool hole = room.chance(0.35);
      for (int v = v0; v < std::min(v0 + kPatch, kDepthRows); ++v) {
        for (int u = column * kPatch; u < std::min((column + 1) * kPatch, depth_width_);
             ++u) {
          const double mm = 1000 * (z + config.depth_noise * z * z * room.normal());
          const bool empty = hole || room.chance(0.05);
          depth_[static_cast<std::size_t>(v * depth_width_ + u)] =
              empty ? 0 : static_cast<std::uint16_t>(std::clamp(mm, 0.0, 65535.0));
        }
      }
    }
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
