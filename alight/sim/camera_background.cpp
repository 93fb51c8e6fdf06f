#include "alight/sim/camera_background.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace alight {
namespace {

constexpr std::size_t kStripPixels = 60000;  // of noise, drawn one by one
constexpr std::size_t kWindows = 1 << 16;    // places where a frame's noise may begin
constexpr std::size_t kDepthRows = 64;
constexpr int kPatches = 200;
constexpr int kJitter = 4;                    // px, of the edges of what stands there
constexpr double kTint[3] = {1.2, 0.3, 1.4};  // dark level by channel: violet

/// Dark level and read noise: rows that each begin at a place of their own in a strip.
std::shared_ptr<const ColorBuffer::Line> dark_line(const CameraSimConfig& config,
                                                   std::size_t width,
                                                   std::size_t height, Rng rng) {
  std::vector<std::uint8_t> strip((kStripPixels + width) * 3);
  const double sd = config.noise * config.read_noise_sd;
  for (std::size_t i = 0; i < strip.size(); ++i) {
    const double level = config.dark_level * kTint[i % 3] + sd * rng.normal();
    strip[i] = static_cast<std::uint8_t>(std::clamp(std::round(level), 0.0, 255.0));
  }
  auto line = std::make_shared<ColorBuffer::Line>((width * height + kWindows) * 3);
  for (std::size_t at = 0; at < line->size(); at += width * 3) {
    const std::size_t from = rng.bits() % kStripPixels * 3;
    std::memcpy(line->data() + at, strip.data() + from,
                std::min(width * 3, line->size() - at));
  }
  return line;
}

/// Walls and furniture at 2.5 to 6 m, seen in patches, a quarter of them without
/// texture. The rows close to a ring.
std::shared_ptr<const DepthBuffer::Line> room_line(const CameraSimConfig& config,
                                                   std::size_t width,
                                                   std::size_t height, Rng room) {
  const int ring_width = static_cast<int>(width) + kJitter;
  std::vector<double> z(static_cast<std::size_t>(ring_width) * kDepthRows, 6.0);
  for (int patch = 0; patch < kPatches; ++patch) {
    const double depth = room.chance(0.25) ? 0 : room.uniform(2.5, 6.0);
    const int u0 = static_cast<int>(room.uniform(-100, ring_width));
    const int u1 = std::min(u0 + static_cast<int>(room.uniform(20, 200)), ring_width);
    const int v0 = static_cast<int>(room.uniform(0, kDepthRows));
    const int rows = static_cast<int>(room.uniform(4, 40));
    for (int v = v0; v < v0 + rows; ++v) {
      for (int u = std::max(u0, 0); u < u1; ++u) {
        const std::size_t row = static_cast<std::size_t>(v) % kDepthRows;
        z[row * static_cast<std::size_t>(ring_width) + static_cast<std::size_t>(u)] =
            depth;
      }
    }
  }
  std::vector<std::uint16_t> ring(z.size());
  for (std::size_t i = 0; i < z.size(); ++i) {
    const double mm = 1000 * (z[i] + config.depth_noise * z[i] * z[i] * room.normal());
    const bool hole = room.chance(0.05);
    ring[i] = hole ? 0 : static_cast<std::uint16_t>(std::clamp(mm, 0.0, 65535.0));
  }
  auto line = std::make_shared<DepthBuffer::Line>(width * (height + kDepthRows));
  for (std::size_t v = 0; v < height + kDepthRows; ++v) {
    const std::size_t from = room.bits() % kJitter;  // ragged edges
    std::memcpy(line->data() + v * width,
                &ring[v % kDepthRows * static_cast<std::size_t>(ring_width) + from],
                width * sizeof(std::uint16_t));
  }
  return line;
}

}  // namespace

Background::Background(const CameraSimConfig& config, int width, int height, Rng rng)
    : width_(width),
      height_(height),
      color_(dark_line(config, static_cast<std::size_t>(width),
                       static_cast<std::size_t>(height), rng.fork("dark"))),
      depth_(room_line(config, static_cast<std::size_t>(width),
                       static_cast<std::size_t>(height), rng.fork("room"))) {}

void Background::fill(Rng rng, ColorBuffer& out) const {
  out.lay(color_, rng.bits() % kWindows, width_, height_);
}

void Background::fill(Rng rng, DepthBuffer& out) const {
  const auto windows = static_cast<std::size_t>(width_) * kDepthRows;
  out.lay(depth_, rng.bits() % windows, width_, height_);
}

}  // namespace alight
