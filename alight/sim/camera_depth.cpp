#include "alight/sim/camera_depth.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr std::size_t kTable = 4096;
constexpr int kStep = 8;           // px, grain of the pad's outline
constexpr float kNearestMm = 300;  // stereo finds nothing closer
constexpr float kFarthestMm = 8000;
constexpr double kBodyHeight = 0.03;  // m, half
constexpr double kLedPatch = 0.008;   // m, half
constexpr double kCommon = 0.8;       // of the noise's sd, the same over a surface
constexpr float kOwn = 0.6f;          // the rest, pixel by pixel
constexpr int kBodyHoles = 38;        // of 256
constexpr int kPadHoles = 90;

}  // namespace

DepthPainter::DepthPainter(const CameraSimConfig& config, const Rig& true_rig, Rng rng)
    : config_(config),
      rig_(true_rig),
      lens_(true_rig.camera.intrinsics),
      X_CN_(true_rig.camera.X_NC.inverse()),
      normal_(2 * kTable),
      dice_(2 * kTable) {
  for (float& n : normal_) n = static_cast<float>(std::clamp(rng.normal(), -4.0, 4.0));
  for (std::uint8_t& d : dice_) d = static_cast<std::uint8_t>(rng.bits() >> 56);

  const Intrinsics& picture = true_rig.camera.intrinsics;
  const Pose& X_NC = true_rig.camera.X_NC;
  const double half = 0.5 * true_rig.pad.size_m;
  for (int v = 0; v < picture.height; ++v) {
    for (int u = 0; u < picture.width; u += kStep) {
      const int u1 = std::min(u + kStep, picture.width);
      const Vector3 d_C = picture.unproject({u + 0.5 * kStep, static_cast<double>(v)});
      const Vector3 d_N = X_NC.linear() * d_C;
      const double z = -X_NC.translation().z() / d_N.z();  // d_C has z = 1
      if (!(z > 0 && z < 100)) continue;
      const Vector3 p_N = X_NC.translation() + z * d_N;
      if (std::abs(p_N.x()) > half || std::abs(p_N.y()) > half) continue;
      const auto mm = static_cast<float>(1000 * z);
      if (!pad_.empty() && pad_.back().v == v && pad_.back().u1 == u) {
        pad_.back().u1 = u1;
      } else {
        pad_.push_back({v, u, u1, mm});
      }
    }
  }
}

float DepthPainter::sd_mm(double z) const {
  return static_cast<float>(1000 * config_.depth_noise * z * z);
}

void DepthPainter::fill(const Span& span, float sd, int holes, Rng& rng,
                        DepthBuffer& out) const {
  const int u0 = std::max(span.u0, 0), u1 = std::min(span.u1, out.width);
  if (u1 <= u0 || span.v < 0 || span.v >= out.height) return;
  const std::uint64_t bits = rng.bits();
  const float* normal = &normal_[bits % kTable];
  const std::uint8_t* dice = &dice_[(bits >> 32) % kTable];
  const auto count = std::min(static_cast<std::size_t>(u1 - u0), kTable);
  std::uint16_t* row = out.write(u0, span.v, static_cast<int>(count));
  if (!(span.mm >= kNearestMm && span.mm <= kFarthestMm)) {
    std::fill_n(row, count, std::uint16_t{0});
    return;
  }
  const auto draw = [&](std::size_t i) {
    const int mm = static_cast<int>(span.mm + sd * normal[i]);
    row[i] = static_cast<std::uint16_t>(mm & -static_cast<int>(dice[i] >= holes));
  };
  // Whole grains first: a loop of known length runs four pixels at a time.
  std::size_t i = 0;
  for (; i + kStep <= count; i += kStep) {
    for (std::size_t k = 0; k < kStep; ++k) draw(i + k);
  }
  for (; i < count; ++i) draw(i);
}

void DepthPainter::paint(const Pose& X_NB, const LedView& leds, Rng rng,
                         DepthBuffer& out) const {
  for (const Span& span : pad_) {
    fill(span, sd_mm(1e-3 * static_cast<double>(span.mm)), kPadHoles, rng, out);
  }
  paint_body(X_NB, rng, out);
  paint_leds(X_NB, leds, rng, out);
}

void DepthPainter::paint_body(const Pose& X_NB, Rng& rng, DepthBuffer& out) const {
  const Pose X_CB = X_CN_ * X_NB;
  const Vector3 p_CB = X_CB.translation();
  const auto centre = lens_.image(p_CB);
  if (!centre) return;
  // An ellipsoid's outline in the picture is M, seen from far.
  const double r = 0.5 * rig_.drone.size_m;
  const Vector3 half_axes(r, r, kBodyHeight);
  const Matrix3 axes = X_CB.linear() * half_axes.asDiagonal();
  const double scale = lens_.focal_px() / p_CB.z();
  const Matrix2 M = scale * scale * (axes * axes.transpose()).topLeftCorner<2, 2>();
  const double reach = std::sqrt(M(1, 1));
  const int v0 = static_cast<int>(
      std::clamp(std::ceil(centre->y() - reach), 0.0, static_cast<double>(out.height)));
  const int v1 = static_cast<int>(std::clamp(std::floor(centre->y() + reach), -1.0,
                                             static_cast<double>(out.height - 1)));
  const float sd = sd_mm(p_CB.z());
  const double z = p_CB.z() + 1e-3 * kCommon * static_cast<double>(sd) * rng.normal();
  const double across = std::sqrt(M.determinant() / M(1, 1));
  for (int v = v0; v <= v1; ++v) {
    const double y = v - centre->y();
    const double share = 1 - y * y / M(1, 1);
    if (share <= 0) continue;
    const double middle = centre->x() + M(0, 1) / M(1, 1) * y;
    const double half = across * std::sqrt(share);
    const double u0 = std::clamp(std::ceil(middle - half), 0.0, 1.0 * out.width);
    const double u1 = std::clamp(std::floor(middle + half) + 1, 0.0, 1.0 * out.width);
    fill({v, static_cast<int>(u0), static_cast<int>(u1), static_cast<float>(1000 * z)},
         kOwn * sd, kBodyHoles, rng, out);
  }
}

void DepthPainter::paint_leds(const Pose& X_NB, const LedView& leds, Rng& rng,
                              DepthBuffer& out) const {
  for (int i = 0; i < rig_.leds.size(); ++i) {
    const double wrong = rng.normal();
    const bool empty = rng.chance(config_.depth_hole_share);
    if (!leds.in_sight(i, X_NB)) continue;
    const Vector3 p_CL = X_CN_ * (X_NB * rig_.leds.p_BL(i));
    const auto uv = lens_.image(p_CL);
    if (!uv || !lens_.intrinsics().contains(*uv)) continue;
    const float sd = sd_mm(p_CL.z());
    const double mm = 1000 * p_CL.z() + kCommon * static_cast<double>(sd) * wrong;
    const int half = std::max(
        2, static_cast<int>(std::lround(lens_.focal_px() * kLedPatch / p_CL.z())));
    const int u = static_cast<int>(std::lround(uv->x()));
    const int v = static_cast<int>(std::lround(uv->y()));
    for (int dv = -half; dv <= half; ++dv) {
      fill({v + dv, u - half, u + half + 1, static_cast<float>(mm)}, kOwn * sd,
           empty ? 256 : 5, rng, out);
    }
  }
}

}  // namespace alight
