#include "alight/sim/tag_painter.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "alight/sim/camera_sight.h"

namespace alight {
namespace {

constexpr double kNominalExposureMs = 2;
constexpr float kInk = 0.06f;          // of white paper's brightness
constexpr int kSamples = 3;            // of a pixel, along each side
constexpr double kShotPerCount = 0.1;  // variance of a pixel by its level, at noise 1
constexpr int kMaxSteps = 24;          // of the path of a tag in an exposure
constexpr int kLargestBox = 1 << 18;   // px
constexpr double kNearest = 0.02;      // m, of what can be drawn
constexpr int kDrawable = 50;

// What stands inside the black border, row by row, most significant bit first.
// OpenCV's DICT_4X4_50 (Garrido-Jurado et al. 2014).
constexpr std::array<std::uint16_t, kDrawable> kDict4x4 = {
    0xb532, 0x0f9a, 0x332d, 0x9946, 0x549e, 0x79cd, 0x9e2e, 0xc4f2, 0xfeda, 0xcf56,
    0xf991, 0x11a7, 0x0eb7, 0x2a0f, 0x24b1, 0x263e, 0x4665, 0x6600, 0x6c5e, 0x76af,
    0x868b, 0xb02b, 0xccd5, 0xdd82, 0xfe47, 0x9471, 0xace4, 0xa554, 0x2123, 0x346f,
    0x4415, 0x57b2, 0x9ecf, 0xf0cb, 0x08ae, 0x0929, 0x1875, 0x04ff, 0x0df6, 0x1c5a,
    0x1718, 0x2a28, 0x328c, 0x38b2, 0x24e8, 0x2eeb, 0x2d3f, 0x4b64, 0x502e, 0x5013};
// The first of AprilTag's 36h11 (Olson 2011; Wang and Olson 2016).
constexpr std::array<std::uint64_t, kDrawable> kTag36h11 = {
    0xd5d628584, 0xd97f18b49, 0xdd280910e, 0xe479e9c98, 0xebcbca822, 0xf31dab3ac,
    0x056a5d085, 0x10652e1d4, 0x22b1dfead, 0x265ad0472, 0x34fe91b86, 0x3ff962cd5,
    0x43a25329a, 0x474b4385f, 0x4e9d243e9, 0x5246149ae, 0x5997f5538, 0x683bb6c4c,
    0x6be4a7211, 0x7e3158eea, 0x81da494af, 0x858339a74, 0x8cd51a5fe, 0x9f21cc2d7,
    0xa2cabc89c, 0xadc58d9eb, 0xb16e7dfb0, 0xb8c05eb3a, 0xd25ef139d, 0xd607e1962,
    0xe4aba3076, 0x2dde6a3da, 0x43d40c678, 0x5620be351, 0x64c47fa65, 0x686d7002a,
    0x6c16605ef, 0x6fbf50bb4, 0x8d06d39dc, 0x9f53856b5, 0xadf746dc9, 0xbc9b084dd,
    0xd290aa77b, 0xd9e28b305, 0xe4dd5c454, 0xfad2fe6f2, 0x181a8151a, 0x26be42c2e,
    0x2e10237b8, 0x405cd5491};

std::size_t index(int row, int width, int column) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(column);
}

}  // namespace

Result<TagPattern> tag_pattern(const Tag& tag) {
  if (tag.id < 0 || tag.id >= kDrawable) {
    return fail(Fault::invalid_config,
                "tag.id is " + std::to_string(tag.id) +
                    ": the simulated camera draws ids from 0 to 49");
  }
  const bool april = tag.family == TagFamily::tag36h11;
  const auto id = static_cast<std::size_t>(tag.id);
  const std::uint64_t code = april ? kTag36h11[id] : kDict4x4[id];
  const int inner = april ? 6 : 4;
  TagPattern pattern;
  pattern.cells = inner + 4;
  for (int row = 0; row < pattern.cells; ++row) {
    for (int column = 0; column < pattern.cells; ++column) {
      const int r = row - 2, c = column - 2;
      const int edge =
          std::min({row, column, pattern.cells - 1 - row, pattern.cells - 1 - column});
      const int bit = inner * inner - 1 - (r * inner + c);
      pattern.white.push_back(edge == 0 || (edge > 1 && ((code >> bit) & 1) != 0));
    }
  }
  return pattern;
}

TagPainter::TagPainter(const CameraSimConfig& config, const Rig& true_rig,
                       TagPattern pattern)
    : config_(config),
      rig_(true_rig),
      pattern_(std::move(pattern)),
      X_CN_(true_rig.camera.X_NC.inverse()) {
  const double exposure_ms =
      config.exposure_ms > 0 ? config.exposure_ms : true_rig.timing.exposure_ms;
  white_ = config.tag_white * exposure_ms / kNominalExposureMs;
  const double half = 0.5 * true_rig.pad.size_m;
  opaque_ = true_rig.pad.obstacles;
  opaque_.push_back(
      {Vector3(-half, -half, -true_rig.pad.above_floor_m), Vector3(half, half, 0)});
  const int reach = static_cast<int>(std::ceil(3 * config.psf_sd_px));
  double sum = 0;
  for (int i = 0; i <= reach; ++i) {
    const double x = i / config.psf_sd_px;
    kernel_.push_back(static_cast<float>(std::exp(-0.5 * x * x)));
    sum += (i == 0 ? 1 : 2) * static_cast<double>(kernel_.back());
  }
  for (float& k : kernel_) k = static_cast<float>(static_cast<double>(k) / sum);
}

bool TagPainter::in_sight(const Pose& X_NB) const {
  const Pose X_NT = X_NB * rig_.tag->X_BT;
  const Vector3 p_NC = rig_.camera.X_NC.translation();
  const Vector3 p_NT = X_NT.translation();
  return (p_NC - p_NT).dot(X_NT.linear().col(2)) > 0 &&
         std::none_of(opaque_.begin(), opaque_.end(), [&](const Obstacle& box) {
           return line_meets_box(p_NC, p_NT, box);
         });
}

bool TagPainter::extend(const Pose& X_CT, Box& box) const {
  const double black = rig_.tag->size_m;
  const double half = 0.5 * black * pattern_.cells / (pattern_.cells - 2);
  const double m = static_cast<double>(kernel_.size()) + 1;
  for (const double x : {-half, half}) {
    for (const double y : {-half, half}) {
      const Vector3 p_C = X_CT * Vector3(x, y, 0);
      if (!(p_C.z() > kNearest)) return false;
      const auto uv = rig_.camera.intrinsics.project(p_C);
      if (!uv || !(uv->norm() < 1e5)) return false;
      box.u0 = std::min(box.u0, static_cast<int>(std::floor(uv->x() - m)));
      box.v0 = std::min(box.v0, static_cast<int>(std::floor(uv->y() - m)));
      box.u1 = std::max(box.u1, static_cast<int>(std::ceil(uv->x() + m)) + 1);
      box.v1 = std::max(box.v1, static_cast<int>(std::ceil(uv->y() + m)) + 1);
    }
  }
  return true;
}

void TagPainter::accumulate(const Pose& X_CT, float share) {
  const Pose X_TC = X_CT.inverse();
  const Vector3& p_TC = X_TC.translation();
  const double cell = rig_.tag->size_m / (pattern_.cells - 2);
  const double half = 0.5 * pattern_.cells;
  const float part = share / (kSamples * kSamples);
  auto ray = rays_.begin();
  for (std::size_t i = 0; i < cover_.size(); ++i) {
    for (int k = 0; k < kSamples * kSamples; ++k, ++ray) {
      const Vector3 along = X_TC.linear() * *ray;
      const double t = -p_TC.z() / along.z();
      if (!(t > 0)) continue;
      const double column = half + (p_TC.x() + t * along.x()) / cell;
      const double row = half - (p_TC.y() + t * along.y()) / cell;
      if (!(column >= 0 && row >= 0 && column < pattern_.cells &&
            row < pattern_.cells)) {
        continue;
      }
      cover_[i] += part;
      light_[i] += pattern_.at(static_cast<int>(row), static_cast<int>(column))
                       ? part
                       : part * kInk;
    }
  }
}

void TagPainter::spread(const Box& box, std::vector<float>& image) {
  const int reach = static_cast<int>(kernel_.size()) - 1;
  const auto smooth = [&](int count, std::size_t first, std::size_t stride) {
    row_.assign(static_cast<std::size_t>(count), 0);
    for (int i = 0; i < count; ++i) {
      for (int k = std::max(-reach, -i); k <= std::min(reach, count - 1 - i); ++k) {
        row_[static_cast<std::size_t>(i)] +=
            kernel_[static_cast<std::size_t>(std::abs(k))] *
            image[first + static_cast<std::size_t>(i + k) * stride];
      }
    }
    for (int i = 0; i < count; ++i) {
      image[first + static_cast<std::size_t>(i) * stride] =
          row_[static_cast<std::size_t>(i)];
    }
  };
  for (int v = 0; v < box.height(); ++v)
    smooth(box.width(), index(v, box.width(), 0), 1);
  for (int u = 0; u < box.width(); ++u) {
    smooth(box.height(), static_cast<std::size_t>(u),
           static_cast<std::size_t>(box.width()));
  }
}

void TagPainter::paint(const RowScenes& scenes, double brightness, Rng rng,
                       ColorBuffer& out) {
  const auto image = [&](const SceneAt& scene) {
    const Pose X_CT = X_CN_ * scene.X_NB * rig_.tag->X_BT;
    return rig_.camera.intrinsics.project(X_CT.translation());
  };
  RowScenes::Instants room;
  const std::span<const SceneAt> exposure = scenes.where_seen(image, room);
  if (!in_sight(exposure[exposure.size() / 2].X_NB)) return;
  Box box{out.width, out.height, 0, 0};
  double path_px = 0;
  Vector2 last;
  for (std::size_t k = 0; k < exposure.size(); ++k) {
    const Pose X_CT = X_CN_ * exposure[k].X_NB * rig_.tag->X_BT;
    if (!extend(X_CT, box)) return;
    const auto uv = rig_.camera.intrinsics.project(X_CT.translation());
    if (!uv) return;
    if (k > 0) path_px += (*uv - last).norm();
    last = *uv;
  }
  box = {std::max(box.u0, 0), std::max(box.v0, 0), std::min(box.u1, out.width),
         std::min(box.v1, out.height)};
  if (box.u1 <= box.u0 || box.v1 <= box.v0 ||
      box.width() * box.height() > kLargestBox) {
    return;
  }
  const std::size_t pixels = index(box.height(), box.width(), 0);
  cover_.assign(pixels, 0);
  light_.assign(pixels, 0);
  rays_.clear();
  for (int v = box.v0; v < box.v1; ++v) {
    for (int u = box.u0; u < box.u1; ++u) {
      for (int k = 0; k < kSamples * kSamples; ++k) {
        const double du = (k % kSamples + 0.5) / kSamples - 0.5;
        const double dv = (k / kSamples + 0.5) / kSamples - 0.5;
        rays_.push_back(rig_.camera.intrinsics.unproject({u + du, v + dv}));
      }
    }
  }
  // Half a pixel apart, still pictures look like a moving one.
  const int steps =
      exposure.size() == 1
          ? 1
          : std::clamp(static_cast<int>(std::ceil(2 * path_px)), 1, kMaxSteps);
  for (int s = 0; s < steps; ++s) {
    const double at = (s + 0.5) / steps * static_cast<double>(exposure.size() - 1);
    const auto k = std::min(static_cast<std::size_t>(at),
                            exposure.size() > 1 ? exposure.size() - 2 : 0);
    const Pose& from = exposure[k].X_NB;
    const Pose& to = exposure[std::min(k + 1, exposure.size() - 1)].X_NB;
    const Pose X_NB = between(from, to, at - static_cast<double>(k));
    accumulate(X_CN_ * X_NB * rig_.tag->X_BT, 1.0f / static_cast<float>(steps));
  }
  spread(box, cover_);
  spread(box, light_);

  const double shot = config_.noise * config_.shot_noise * std::sqrt(kShotPerCount);
  for (int v = box.v0; v < box.v1; ++v) {
    std::uint8_t* const row = out.write(box.u0, v, box.width());
    for (int u = box.u0; u < box.u1; ++u) {
      const std::size_t i = index(v - box.v0, box.width(), u - box.u0);
      if (cover_[i] < 1e-3f) continue;
      std::uint8_t* const pixel = row + 3 * (u - box.u0);
      const double signal = brightness * white_ * static_cast<double>(light_[i]);
      for (int c = 0; c < 3; ++c) {
        // The paper hides what shines behind it; the sensor's own dark level stays.
        const double behind = pixel[c];
        const double dark = std::min(behind, 3 * config_.dark_level);
        const double through =
            dark + (behind - dark) * (1 - static_cast<double>(cover_[i]));
        const double level = through + signal + shot * std::sqrt(signal) * rng.normal();
        pixel[c] = static_cast<std::uint8_t>(std::clamp(level + 0.5, 0.0, 255.0));
      }
    }
  }
}

}  // namespace alight
