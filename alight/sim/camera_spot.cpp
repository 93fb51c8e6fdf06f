#include "alight/sim/camera_spot.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr std::size_t kNormals = 8192;
constexpr float kFaintest = 0.25f;     // counts; below it nothing is drawn
constexpr double kShotPerCount = 0.1;  // variance of a pixel by its level, at noise 1
constexpr double kReach = 4;           // standard deviations
constexpr int kLargestBox = 256;       // px
constexpr double kUnmoved = 0.2;       // px; adds 0.003 px^2 to the variance.

/// The normal distribution function by table: exact to 1e-6 between -5 and 5.
class NormalCdf {
 public:
  NormalCdf() {
    for (int i = 0; i <= kCells + 1; ++i) {
      const double x = (i * (2 * kEnd) / kCells) - kEnd;
      value_[static_cast<std::size_t>(i)] = 0.5 * std::erfc(-x * 0.7071067811865476);
    }
  }
  double operator()(double x) const {
    const double at = (std::clamp(x, -kEnd, kEnd) + kEnd) * (kCells / (2 * kEnd));
    const auto i = static_cast<std::size_t>(at);
    const double share = at - static_cast<double>(i);
    return value_[i] + share * (value_[i + 1] - value_[i]);
  }

 private:
  static constexpr double kEnd = 5;
  static constexpr int kCells = 4096;
  std::array<double, kCells + 2> value_;
};
const NormalCdf kCdf;

/// Share of a Gaussian that falls on each pixel of [from, to).
void integrate(double mean, double sd, int from, int to, std::vector<float>& out) {
  const double scale = 1 / sd;
  double before = kCdf((from - 0.5 - mean) * scale);
  for (int i = from; i < to; ++i) {
    const double after = kCdf((i + 0.5 - mean) * scale);
    out[static_cast<std::size_t>(i - from)] = static_cast<float>(after - before);
    before = after;
  }
}

/// Point at share `s` of the path's time.
Vector2 along(const FixedVector<Vector2, kMaxInstants>& path, double s) {
  if (path.size() == 1) return path[0];
  const double at = s * static_cast<double>(path.size() - 1);
  const auto i = std::min(static_cast<std::size_t>(at), path.size() - 2);
  return path[i] + (at - static_cast<double>(i)) * (path[i + 1] - path[i]);
}

double length(const FixedVector<Vector2, kMaxInstants>& path) {
  double sum = 0;
  for (std::size_t i = 1; i < path.size(); ++i) sum += (path[i] - path[i - 1]).norm();
  return sum;
}

}  // namespace

std::array<float, 3> sensor_response(LedColor color) {
  switch (color) {
    case LedColor::red:
      return {0.36f, 0.33f, 1.0f};
    case LedColor::green:
      return {0.70f, 1.0f, 0.48f};
    case LedColor::blue:
      return {1.0f, 0.42f, 0.24f};
    case LedColor::white:
      return {0.97f, 1.0f, 0.95f};
    case LedColor::none:
      break;
  }
  return {0.92f, 0.88f, 1.0f};
}

SpotPainter::SpotPainter(const CameraSimConfig& config, Rng rng)
    : halo_sd_px_(config.halo_sd_px),
      shot_(static_cast<float>(config.noise * config.shot_noise *
                               std::sqrt(kShotPerCount))),
      normal_(kNormals + 3 * kLargestBox) {
  // The first are repeated at the end, so that no row runs over it.
  for (std::size_t i = 0; i < normal_.size(); ++i) {
    normal_[i] =
        i < kNormals ? static_cast<float>(rng.normal()) : normal_[i - kNormals];
  }
}

void SpotPainter::paint(const Spot& spot, Rng& rng, ColorBuffer& out) {
  if (spot.path.empty() || !(spot.flux > 0)) return;
  const double peak = spot.flux / (kTwoPi * spot.sd_px * spot.sd_px);
  const bool with_halo = spot.halo * peak > 2 * static_cast<double>(kFaintest);
  const double halo_sd = std::max(halo_sd_px_, spot.sd_px);
  // No further than where the Gaussian falls below what is drawn.
  const auto reach_of = [](double sd, double top) {
    const double faint = static_cast<double>(kFaintest) / std::max(top, 1.0);
    return sd * std::min(kReach, std::sqrt(std::max(0.0, -2 * std::log(faint)))) + 1;
  };
  const double reach = with_halo ? std::max(reach_of(spot.sd_px, peak),
                                            reach_of(halo_sd, spot.halo * peak))
                                 : reach_of(spot.sd_px, peak);
  Vector2 low = spot.path[0], high = spot.path[0];
  for (const Vector2& uv : spot.path) {
    low = low.cwiseMin(uv);
    high = high.cwiseMax(uv);
  }
  const auto cut = [](double x, int end) {
    return static_cast<int>(std::clamp(x, 0.0, static_cast<double>(end)));
  };
  Box box{cut(std::floor(low.x() - reach), out.width),
          cut(std::floor(low.y() - reach), out.height),
          cut(std::ceil(high.x() + reach) + 1, out.width),
          cut(std::ceil(high.y() + reach) + 1, out.height)};
  box.u1 = std::min(box.u1, box.u0 + kLargestBox);
  box.v1 = std::min(box.v1, box.v0 + kLargestBox);
  if (box.u1 <= box.u0 || box.v1 <= box.v0) return;

  light_.assign(static_cast<std::size_t>((box.u1 - box.u0) * (box.v1 - box.v0)), 0.0f);
  accumulate(spot, spot.sd_px, spot.flux, box);
  if (with_halo) {
    const double wider = halo_sd / spot.sd_px;
    accumulate(spot, halo_sd, spot.halo * spot.flux * wider * wider, box);
  }
  expose(spot.bgr, box, rng, out);
}

void SpotPainter::accumulate(const Spot& spot, double sd, double flux, const Box& box) {
  // Less than a standard deviation apart, samples of the path look like the path, when
  // they are spread so that their variance is the path's.
  const double moved = length(spot.path);
  const int samples =
      moved < kUnmoved
          ? 1
          : std::clamp(static_cast<int>(std::ceil(moved / (0.7 * sd))), 2, 128);
  const double spread = samples > 1 ? 1 / std::sqrt(1 - 1.0 / (samples * samples)) : 0;
  for (int k = 0; k < samples; ++k) {
    const double off = (k + 0.5) / samples - 0.5;
    const Vector2 uv = along(spot.path, 0.5 + spread * off);
    const double reach = kReach * sd + 1;
    const int u0 = std::max(box.u0, static_cast<int>(std::floor(uv.x() - reach)));
    const int v0 = std::max(box.v0, static_cast<int>(std::floor(uv.y() - reach)));
    const int u1 = std::min(box.u1, static_cast<int>(std::ceil(uv.x() + reach)) + 1);
    const int v1 = std::min(box.v1, static_cast<int>(std::ceil(uv.y() + reach)) + 1);
    if (u1 <= u0 || v1 <= v0) continue;
    across_.resize(static_cast<std::size_t>(u1 - u0));
    down_.resize(static_cast<std::size_t>(v1 - v0));
    integrate(uv.x(), sd, u0, u1, across_);
    integrate(uv.y(), sd, v0, v1, down_);
    for (int v = v0; v < v1; ++v) {
      const float row =
          static_cast<float>(flux / samples) * down_[static_cast<std::size_t>(v - v0)];
      float* light =
          &light_[static_cast<std::size_t>((v - box.v0) * box.width())] + (u0 - box.u0);
      for (std::size_t i = 0; i < across_.size(); ++i) light[i] += row * across_[i];
    }
  }
}

void SpotPainter::expose(const std::array<float, 3>& bgr, const Box& box, Rng& rng,
                         ColorBuffer& out) const {
  std::size_t draw = rng.bits() % kNormals;
  std::array<float, 3> shot;
  for (std::size_t c = 0; c < 3; ++c) shot[c] = shot_ * std::sqrt(bgr[c]);
  const float* row = light_.data();
  for (int v = box.v0; v < box.v1; ++v, row += box.width()) {
    const auto lit = [](float light) { return light >= kFaintest; };
    const float* const first = std::find_if(row, row + box.width(), lit);
    const float* last = row + box.width();
    while (last > first && !lit(last[-1])) --last;
    const int count = static_cast<int>(last - first);
    if (count == 0) continue;
    std::uint8_t* pixel = out.write(box.u0 + static_cast<int>(first - row), v, count);
    const float* normal = &normal_[draw];
    draw = (draw + 3 * static_cast<std::size_t>(count)) % kNormals;
    for (const float* light = first; light < last; ++light, pixel += 3, normal += 3) {
      if (!lit(*light)) continue;
      const float root = std::sqrt(*light);
      for (std::size_t c = 0; c < 3; ++c) {
        const float signal = *light * bgr[c], noise = shot[c] * root * normal[c];
        const float level = static_cast<float>(pixel[c]) + signal + noise + 0.5f;
        pixel[c] = static_cast<std::uint8_t>(std::clamp(level, 0.0f, 255.0f));
      }
    }
  }
}

}  // namespace alight
