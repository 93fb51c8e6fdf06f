#include "alight/vision/spot_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace alight {
namespace {

constexpr int kWindowMax = 40;        // px, each way
constexpr double kReach = 2.6;        // standard deviations around a light
constexpr int kCensored = 240;        // grey level from which a pixel is full
constexpr double kReadVariance = 6;   // of a pixel's luminance, grey levels^2
constexpr double kShot = 0.15;        // variance per grey level
constexpr double kMismatch = 0.04;    // of the model, share of the light
constexpr double kBackgroundSd = 15;  // grey levels
constexpr double kStartSd = 1.2;      // px, keeps a fit that nothing else holds
constexpr double kShiftMax = 2.5;     // px
constexpr double kChi2Max = 12;       // per pixel
constexpr int kIterations = 5;
constexpr double kStepPx = 0.02;

struct Pixel {
  float u, v, light, weight;
  bool full;
};

/// Luminance (ITU-R BT.601) and whether a channel is at its upper end.
Pixel pixel_at(const ImageView& image, int u, int v) {
  const std::uint8_t* p = image.row(v) + u * image.channels;
  Pixel out;
  out.u = static_cast<float>(u);
  out.v = static_cast<float>(v);
  if (image.channels == 1) {
    out.light = p[0];
    out.full = p[0] >= kCensored;
  } else {
    out.light = 0.114f * p[0] + 0.587f * p[1] + 0.299f * p[2];
    out.full = std::max({p[0], p[1], p[2]}) >= kCensored;
  }
  const float mismatch = static_cast<float>(kMismatch) * out.light;
  out.weight = 1 / (static_cast<float>(kReadVariance) +
                    static_cast<float>(kShot) * out.light + mismatch * mismatch);
  return out;
}

using Pixels = FixedVector<Pixel, kWindowMax * kWindowMax>;

/// The pixels around the lights.
bool gather(const ImageView& image, std::span<const Vector2> starts, double reach,
            std::span<const Roi> foreign, Pixels& out) {
  Vector2 low = starts[0], high = starts[0];
  for (const Vector2& uv : starts) {
    low = low.cwiseMin(uv);
    high = high.cwiseMax(uv);
  }
  const int u0 = static_cast<int>(std::floor(low.x() - reach));
  const int v0 = static_cast<int>(std::floor(low.y() - reach));
  const int u1 = static_cast<int>(std::ceil(high.x() + reach)) + 1;
  const int v1 = static_cast<int>(std::ceil(high.y() + reach)) + 1;
  if (u0 < 0 || v0 < 0 || u1 > image.width || v1 > image.height) return false;
  if (u1 - u0 > kWindowMax || v1 - v0 > kWindowMax) return false;
  const double reach2 = reach * reach;
  for (int v = v0; v < v1; ++v) {
    for (int u = u0; u < u1; ++u) {
      const auto near = [&](const Vector2& uv) {
        return (Vector2(u, v) - uv).squaredNorm() <= reach2;
      };
      const auto inside = [&](const Roi& box) {
        return u >= box.u0 && u < box.u1 && v >= box.v0 && v < box.v1;
      };
      if (std::none_of(starts.begin(), starts.end(), near)) continue;
      if (std::any_of(foreign.begin(), foreign.end(), inside)) continue;
      out.push_back(pixel_at(image, u, v));
    }
  }
  return out.size() > 3 * starts.size() + 4;
}

template <int K>
std::optional<SpotFit> fit(const Pixels& pixels, std::span<const Vector2> starts,
                           const PointSpread& spread, const Vector2& blur) {
  constexpr int kBack = 3 * K, kWidth = 3 * K + 1, kN = 3 * K + 2;
  using Vector = Eigen::Matrix<float, kN, 1>;
  using Matrix = Eigen::Matrix<float, kN, kN>;

  float dark = 255, bright = 0;
  for (const Pixel& p : pixels) {
    dark = std::min(dark, p.light);
    bright = std::max(bright, p.light);
  }
  std::array<Vector2, K> uv;
  std::array<float, K> height;
  for (int k = 0; k < K; ++k) {
    uv[static_cast<std::size_t>(k)] = starts[static_cast<std::size_t>(k)];
    height[static_cast<std::size_t>(k)] = 0.8f * (bright - dark);
  }
  float back = dark;
  double width = 1;  // factor on the variance of the point spread

  SpotFit out;
  out.count = K;
  Matrix A;
  Vector g;
  // Rows of whole registers; the last entries stay zero.
  constexpr int kPadded = (kN + 3) / 4 * 4;
  alignas(16) float sum[kN][kPadded];
  alignas(16) float J[kPadded] = {};
  float pull[kN];
  double cost = 0;
  for (int iteration = 0;; ++iteration) {
    const double s2 = spread.variance_px2 * width;
    const double a = s2 + blur.x() * blur.x() / 12, c = s2 + blur.y() * blur.y() / 12;
    const double b = blur.x() * blur.y() / 12;
    const double det = a * c - b * b;
    // Inverse of the image's covariance.
    const auto i_uu = static_cast<float>(c / det), i_vv = static_cast<float>(a / det);
    const auto i_uv = static_cast<float>(-b / det);
    const auto grow = static_cast<float>(s2 / 2);
    std::fill(&sum[0][0], &sum[0][0] + kN * kPadded, 0.f);
    std::fill(pull, pull + kN, 0.f);
    cost = 0;
    for (const Pixel& p : pixels) {
      float model = back, by_width = 0;
      for (int k = 0; k < K; ++k) {
        const auto n = static_cast<std::size_t>(k);
        const float du = p.u - static_cast<float>(uv[n].x());
        const float dv = p.v - static_cast<float>(uv[n].y());
        const float e_u = i_uu * du + i_uv * dv, e_v = i_uv * du + i_vv * dv;
        const float shape = std::exp(-0.5f * (du * e_u + dv * e_v));
        const float light = height[n] * shape;
        model += light;
        J[3 * k] = light * e_u;
        J[3 * k + 1] = light * e_v;
        J[3 * k + 2] = shape;
        by_width += light * grow * (e_u * e_u + e_v * e_v);
      }
      J[kBack] = 1;
      J[kWidth] = by_width;
      const float r = p.light - model;
      if (p.full && r < 0) continue;
      cost += static_cast<double>(p.weight * r * r);
      for (int i = 0; i < kN; ++i) {
        const float w = p.weight * J[i];
        pull[i] += r * w;
        for (int j = 0; j < kPadded; ++j) sum[i][j] += w * J[j];
      }
    }
    for (int i = 0; i < kN; ++i) {
      g[i] = pull[i];
      for (int j = 0; j < kN; ++j) A(i, j) = sum[i][j];
    }
    const auto share2 = static_cast<float>(spread.share_sd * spread.share_sd);
    constexpr auto back2 = static_cast<float>(kBackgroundSd * kBackgroundSd);
    A(kBack, kBack) += 1 / back2;
    g[kBack] -= (back - dark) / back2;
    A(kWidth, kWidth) += 1 / share2;
    g[kWidth] -= static_cast<float>(width - 1) / share2;
    for (int k = 0; k < K; ++k) A(3 * k + 2, 3 * k + 2) += 1e-6f;
    if (iteration == kIterations) break;

    Matrix damped = A;
    constexpr auto start2 = static_cast<float>(kStartSd * kStartSd);
    for (int k = 0; k < K; ++k) {
      const auto n = static_cast<std::size_t>(k);
      damped(3 * k, 3 * k) += 1 / start2;
      damped(3 * k + 1, 3 * k + 1) += 1 / start2;
      const Vector2 off = uv[n] - starts[n];
      g[3 * k] -= static_cast<float>(off.x()) / start2;
      g[3 * k + 1] -= static_cast<float>(off.y()) / start2;
    }
    const Eigen::LLT<Matrix> llt(damped);
    if (llt.info() != Eigen::Success) return std::nullopt;
    const Vector step = llt.solve(g);
    if (!step.allFinite()) return std::nullopt;
    float largest = 0;
    for (int k = 0; k < K; ++k) {
      const auto n = static_cast<std::size_t>(k);
      const float su = std::clamp(step[3 * k], -1.f, 1.f);
      const float sv = std::clamp(step[3 * k + 1], -1.f, 1.f);
      uv[n] += Vector2(static_cast<double>(su), static_cast<double>(sv));
      height[n] = std::max(height[n] + step[3 * k + 2], 0.1f);
      largest = std::max({largest, std::abs(su), std::abs(sv)});
    }
    back += step[kBack];
    width = std::clamp(width + static_cast<double>(step[kWidth]), 0.3, 3.0);
    if (largest < static_cast<float>(kStepPx)) iteration = kIterations - 1;
  }

  const double freedom = std::max(static_cast<double>(pixels.size()) - kN, 1.0);
  out.chi2_per_pixel = cost / freedom;
  if (!(out.chi2_per_pixel < kChi2Max)) return std::nullopt;
  for (int k = 0; k < K; ++k) {
    const auto n = static_cast<std::size_t>(k);
    if ((uv[n] - starts[n]).norm() > kShiftMax) return std::nullopt;
    out.uv[n] = uv[n];
    out.height[n] = static_cast<double>(height[n]);
  }

  // What the pixels say of the places, everything else unknown.
  const Eigen::Matrix<double, kN, kN> H =
      A.template cast<double>() /
      std::max(out.chi2_per_pixel, 1.0);
  Eigen::Matrix<double, 2 * K, 2 * K> H_pp;
  Eigen::Matrix<double, 2 * K, K + 2> H_pn;
  Eigen::Matrix<double, K + 2, K + 2> H_nn;
  const auto place = [](int i) { return 3 * (i / 2) + i % 2; };
  const auto nuisance = [](int i) { return i < K ? 3 * i + 2 : 3 * K + i - K; };
  for (int i = 0; i < 2 * K; ++i) {
    for (int j = 0; j < 2 * K; ++j) H_pp(i, j) = H(place(i), place(j));
    for (int j = 0; j < K + 2; ++j) H_pn(i, j) = H(place(i), nuisance(j));
  }
  for (int i = 0; i < K + 2; ++i) {
    for (int j = 0; j < K + 2; ++j) H_nn(i, j) = H(nuisance(i), nuisance(j));
  }
  const Eigen::LLT<Eigen::Matrix<double, K + 2, K + 2>> nn(H_nn);
  if (nn.info() != Eigen::Success) return std::nullopt;
  out.information = H_pp - H_pn * nn.solve(H_pn.transpose());
  out.variance_px2 = spread.variance_px2 * width;
  out.variance_information =
      (H(kWidth, kWidth) - 1 / (spread.share_sd * spread.share_sd)) /
      (spread.variance_px2 * spread.variance_px2);
  return out;
}

}  // namespace

double spot_reach_px(const PointSpread& spread, const Vector2& blur_px) {
  const double sd = std::sqrt(spread.variance_px2 + blur_px.squaredNorm() / 12);
  return std::max(kReach * sd, 2.0);
}

std::optional<SpotFit> fit_spots(const ImageView& image,
                                 std::span<const Vector2> starts,
                                 const PointSpread& spread, const Vector2& blur_px,
                                 std::span<const Roi> foreign) {
  if (starts.empty() || starts.size() > kMaxGroup) return std::nullopt;
  Pixels pixels;
  if (!gather(image, starts, spot_reach_px(spread, blur_px), foreign, pixels)) {
    return std::nullopt;
  }
  switch (starts.size()) {
    case 1:
      return fit<1>(pixels, starts, spread, blur_px);
    case 2:
      return fit<2>(pixels, starts, spread, blur_px);
    case 3:
      return fit<3>(pixels, starts, spread, blur_px);
    default:
      return fit<4>(pixels, starts, spread, blur_px);
  }
}

}  // namespace alight
