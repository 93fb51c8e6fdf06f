#include "alight/vision/spot_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "alight/vision/lanes.h"
#include "alight/vision/pixel.h"
#include "alight/vision/wide.h"

namespace alight {
namespace {

constexpr double kReach = 2.6;      // standard deviations around a light
constexpr int kCensored = 240;      // grey level from which a pixel is full
constexpr float kFullMost = 0.67f;  // share of full pixels; beyond it no rim is seen.
constexpr float kFullMostAlone = 0.5f;  // the same of one light: its middle tells more
constexpr float kShot = 0.15f;          // variance per grey level
constexpr float kMismatch = 0.04f;      // of the model, share of the light
constexpr double kBackgroundSd = 15;    // grey levels
constexpr double kStartSd = 1.2;        // px, keeps a fit that nothing else holds
constexpr double kShiftMax = 2.5;       // px
constexpr double kChi2Max = 12;         // per pixel
constexpr int kIterations = 5;
constexpr double kStepPx = 0.06;
constexpr int kIterationsUntold = 9;  // of lights whose colour is told on the way
constexpr float kColorTold = 10;      // what a colour has is known to 0.3

constexpr float kSkirtFrom = 2.3f;  // standard deviations, from any light
constexpr float kCoreDoubt = 0.3f;  // share of the Gaussian that may be off out there
constexpr double kSkirtInformationLeast = 1;

constexpr int kPixelsMax = 512;  // a multiple of kLane

/// What of a pixel is fitted.
enum class Sees { luminance, own_color };

/// The pixels around the lights. Past `count`, up to a whole lane, they weigh nothing.
struct Pixels {
  static constexpr std::size_t kRoom = kPixelsMax + kLane;
  int count = 0, padded = 0;
  alignas(32) std::array<float, kRoom> u, v, light, weight;
  alignas(32) std::array<float, kRoom> full;  // 1: at the sensor's upper end
  std::array<std::uint8_t, kRoom> channel;    // That each one sees, under a mosaic.
};

/// Luminance and whether a channel is at its upper end; under a mosaic its own colour.
/// @param channels  Of the image; given as a constant, none is asked for pixel by
/// pixel.
template <Sees kSees>
ALIGHT_INLINE void take(const std::uint8_t* p, int channels, Mosaic mosaic, int u,
                        int v, std::size_t at, Pixels& out) {
  out.u[at] = static_cast<float>(u);
  out.v[at] = static_cast<float>(v);
  if constexpr (kSees == Sees::luminance) {
    out.light[at] = luminance_of(p, channels);
    out.full[at] = grey_of(p, channels) >= kCensored ? 1.f : 0.f;
  } else {
    const int channel = channel_at(mosaic, u, v);
    out.channel[at] = static_cast<std::uint8_t>(channel);
    out.light[at] = p[channel];
    out.full[at] = p[channel] >= kCensored ? 1.f : 0.f;
  }
}

/// The same of `n` pixels of a row from column u on, at `p`.
template <Sees kSees>
ALIGHT_INLINE void take_row(const std::uint8_t* p, const ImageView& image, int u, int v,
                            int n, std::size_t at, Pixels& out) {
  constexpr int kColors = 3;
  if (image.channels == kColors) {
    for (int k = 0; k < n; ++k) {
      take<kSees>(p + kColors * k, kColors, image.mosaic, u + k, v, at++, out);
    }
  } else {
    for (int k = 0; k < n; ++k) {
      take<kSees>(p + k, 1, image.mosaic, u + k, v, at++, out);
    }
  }
}

/// How much each counts; and up to a whole lane.
ALIGHT_INLINE void weigh(float noise, Pixels& out) {
  auto count = static_cast<std::size_t>(out.count);
  for (std::size_t i = 0; i < count; ++i) {
    const float mismatch = kMismatch * out.light[i];
    out.weight[i] = 1 / (noise + kShot * out.light[i] + mismatch * mismatch);
  }
  for (; count % kLane != 0; ++count) {
    out.u[count] = out.u[0];
    out.v[count] = out.v[0];
    out.light[count] = out.light[0];
    out.full[count] = out.weight[count] = 0;
    out.channel[count] = 0;
  }
  out.padded = static_cast<int>(count);
}

/// The columns of a row that lights reach.
struct Reached {
  int begin, end;
};

/// Those of every light that reaches row v, in order of where they begin.
FixedVector<Reached, kMaxGroup> reached(std::span<const LightSought> sought,
                                        double reach2, int v) {
  FixedVector<Reached, kMaxGroup> out;
  for (const LightSought& light : sought) {
    const double dv = v - light.uv.y(), half2 = reach2 - dv * dv;
    if (half2 < 0) continue;
    const double half = std::sqrt(half2);
    out.push_back({static_cast<int>(std::ceil(light.uv.x() - half)),
                   static_cast<int>(std::floor(light.uv.x() + half)) + 1});
    for (std::size_t k = out.size() - 1; k > 0; --k) {
      if (out[k].begin < out[k - 1].begin) std::swap(out[k], out[k - 1]);
    }
  }
  return out;
}

template <Sees kSees>
bool gather(const ImageView& image, std::span<const LightSought> sought, double reach,
            float noise, std::span<const ForeignLight> foreign, Pixels& out) {
  Vector2 low = sought[0].uv, high = sought[0].uv;
  for (const LightSought& light : sought) {
    low = low.cwiseMin(light.uv);
    high = high.cwiseMax(light.uv);
  }
  // Cut before the cast: a start far outside does not fit an int.
  if (!(low.minCoeff() > reach && high.x() < image.width - reach - 1 &&
        high.y() < image.height - reach - 1)) {
    return false;
  }
  const int v0 = static_cast<int>(std::floor(low.y() - reach));
  const int v1 = static_cast<int>(std::ceil(high.y() + reach)) + 1;
  const int channels = image.channels;
  std::size_t count = 0;
  for (int v = v0; v < v1; ++v) {
    int taken = 0;  // columns before it
    for (const Reached& row : reached(sought, reach * reach, v)) {
      const int begin = std::max(row.begin, taken);
      if (begin >= row.end) continue;
      taken = row.end;
      if (count + static_cast<std::size_t>(row.end - begin) > kPixelsMax) return false;
      const std::uint8_t* p = image.row(v) + begin * channels;
      if (foreign.empty()) {
        take_row<kSees>(p, image, begin, v, row.end - begin, count, out);
        count += static_cast<std::size_t>(row.end - begin);
        continue;
      }
      for (int u = begin; u < row.end; ++u, p += channels) {
        take<kSees>(p, channels, image.mosaic, u, v, count, out);
        bool own = true;
        for (const ForeignLight& light : foreign) own = own && !light.covers(u, v);
        count += own ? 1 : 0;
      }
    }
  }
  if (count <= 3 * sought.size() + 4) return false;
  out.count = static_cast<int>(count);
  weigh(noise, out);
  return true;
}

float full_share(const Pixels& pixels) {
  float lane[kLane] = {};  // whole numbers: their order does not matter
  for (int i = 0; i < pixels.padded; i += kLane) {
    for (int k = 0; k < kLane; ++k)
      lane[k] += pixels.full[static_cast<std::size_t>(i + k)];
  }
  return std::accumulate(lane, lane + kLane, 0.0f) / static_cast<float>(pixels.count);
}

/// A Gaussian that moves by `blur` while it is seen, by its second moments.
struct Moved {
  Moved(double variance_px2, const Vector2& blur) {
    const double a = variance_px2 + blur.x() * blur.x() / 12;
    const double c = variance_px2 + blur.y() * blur.y() / 12;
    const double b = blur.x() * blur.y() / 12;
    const double det = a * c - b * b;
    uu = static_cast<float>(c / det);
    uv = static_cast<float>(-b / det);
    vv = static_cast<float>(a / det);
    kept = variance_px2 / std::sqrt(det);
  }

  float uu, uv, vv;  // of its covariance's inverse
  double kept;       // of its height

  /// The inverse times (du, dv).
  ALIGHT_INLINE float along_u(float du, float dv) const { return uu * du + uv * dv; }
  ALIGHT_INLINE float along_v(float du, float dv) const { return uv * du + vv * dv; }
  ALIGHT_INLINE float at(float du, float dv) const {
    return exp_of(-0.5f * (du * along_u(du, dv) + dv * along_v(du, dv)));
  }
};

/// A light whose peak is 1: its Gaussian, and the skirt beside that.
struct Shape {
  Shape(const PointSpread& spread, const Vector2& blur, double width = 1)
      : core_variance(width * spread.variance_px2),
        wide_variance(spread.skirt_over_core() * core_variance),
        core(core_variance, blur),
        wide(wide_variance, blur),
        skirt(static_cast<float>(spread.skirt * wide.kept / core.kept)) {}

  double core_variance, wide_variance;
  Moved core, wide;
  float skirt;  // height, over the Gaussian's

  ALIGHT_INLINE float at(float du, float dv) const {
    return core.at(du, dv) + skirt * wide.at(du, dv);
  }
};

/// Takes the light of those beside off every pixel.
template <Sees kSees>
void take_off(std::span<const LightBeside> beside, const PointSpread& spread,
              const Vector2& blur, Pixels& pixels) {
  const Shape shape(spread, blur);
  for (const LightBeside& other : beside) {
    const auto u = static_cast<float>(other.uv.x()),
               v = static_cast<float>(other.uv.y());
    const auto peak = static_cast<float>(other.height);
    for (int i = 0; i < pixels.padded; ++i) {
      const auto at = static_cast<std::size_t>(i);
      float light = peak * shape.at(pixels.u[at] - u, pixels.v[at] - v);
      if constexpr (kSees == Sees::own_color) light *= other.color[pixels.channel[at]];
      pixels.light[at] -= light;
    }
  }
}

constexpr int kBoxSide = 2 * kSkirtBox + 1;
constexpr int kBoxRow = kBoxSide + 1;  // columns: whole lanes, the last weighs nothing
static_assert(kBoxRow % kLane == 0);

/// Along one axis of a box, of a light and of its skirt.
struct Profile {
  alignas(32) float d2[kBoxRow];  // squared distance over the variance of the former
  alignas(32) float core[kBoxRow], wide[kBoxRow];
};
ALIGHT_INLINE Profile profile(int first, double middle, double height,
                              const PointSpread& spread) {
  Profile out;
  const auto per_variance = static_cast<float>(1 / spread.variance_px2);
  const auto narrower = static_cast<float>(1 / spread.skirt_over_core());
  const auto h = static_cast<float>(height);
  for (int k = 0; k < kBoxRow; ++k) {
    const float d = static_cast<float>(first + k) - static_cast<float>(middle);
    out.d2[k] = per_variance * d * d;
    out.core[k] = h * exp_of(-0.5f * out.d2[k]);
    out.wide[k] = h * exp_of(-0.5f * narrower * out.d2[k]);
  }
  return out;
}

/// What is looked for: lights, the background, and a factor on the point spread's
/// variance.
template <int K>
struct Lights {
  /// What each pixel sees of it, under a mosaic.
  using Gain = std::array<float, Pixels::kRoom>;

  std::array<Vector2, K> uv;
  std::array<float, K> height;
  float back = 0;
  double width = 1;
};

/// Normal equations of its parameters: u, v and height of each light, the background,
/// the width.
template <int K>
struct Equations {
  static constexpr int kBack = 3 * K, kWidth = 3 * K + 1, kN = 3 * K + 2;
  Eigen::Matrix<float, kN, kN> A;
  Eigen::Matrix<float, kN, 1> g;
  double cost = 0;
};

template <int K, Sees kSees>
ALIGHT_INLINE void equations_of(const Pixels& pixels, const Lights<K>& lights,
                                const typename Lights<K>::Gain* gains,
                                const PointSpread& spread, const Vector2& blur,
                                Equations<K>& out) {
  using Of = Equations<K>;
  constexpr int kBack = Of::kBack, kWidth = Of::kWidth, kN = Of::kN;
  // Derivative by parameter and pixel; residual, weight, and a row of J or r times it.
  alignas(32) float J[kN][kPixelsMax];
  alignas(32) float r[kPixelsMax], weight[kPixelsMax], wJ[kPixelsMax];
  const int padded = pixels.padded;
  const Shape shape(spread, blur, lights.width);
  const auto grow_core = static_cast<float>(shape.core_variance / 2);
  const auto grow_wide = static_cast<float>(shape.wide_variance / 2);
  float* const by_width = J[kWidth];
  for (int i = 0; i < padded; ++i) {
    r[i] = pixels.light[static_cast<std::size_t>(i)] - lights.back;
    by_width[i] = 0;
    J[kBack][i] = 1;
  }
  for (int k = 0; k < K; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const auto u = static_cast<float>(lights.uv[at].x()),
               v = static_cast<float>(lights.uv[at].y());
    const float peak = lights.height[at];
    float* const J_u = J[3 * k];
    float* const J_v = J[3 * k + 1];
    float* const J_h = J[3 * k + 2];
    for (int i = 0; i < padded; ++i) {
      const float du = pixels.u[static_cast<std::size_t>(i)] - u;
      const float dv = pixels.v[static_cast<std::size_t>(i)] - v;
      const float c_u = shape.core.along_u(du, dv), c_v = shape.core.along_v(du, dv);
      const float w_u = shape.wide.along_u(du, dv), w_v = shape.wide.along_v(du, dv);
      float core = exp_of(-0.5f * (du * c_u + dv * c_v));
      float wide = shape.skirt * exp_of(-0.5f * (du * w_u + dv * w_v));
      if constexpr (kSees == Sees::own_color) {
        const float gain = gains[k][static_cast<std::size_t>(i)];
        core *= gain;
        wide *= gain;
      }
      J_h[i] = core + wide;
      r[i] -= peak * J_h[i];
      J_u[i] = peak * (core * c_u + wide * w_u);
      J_v[i] = peak * (core * c_v + wide * w_v);
      by_width[i] += peak * (grow_core * core * (c_u * c_u + c_v * c_v) +
                             grow_wide * wide * (w_u * w_u + w_v * w_v));
    }
  }
  for (int i = 0; i < padded; ++i) {
    const auto at = static_cast<std::size_t>(i);
    // A full pixel speaks only against a model that is darker.
    const float counts = r[i] < 0 ? 1 - pixels.full[at] : 1.f;
    weight[i] = counts * pixels.weight[at];
    wJ[i] = weight[i] * r[i];
  }
  out.cost = static_cast<double>(dot(wJ, r, padded));
  for (int p = 0; p < kN; ++p) {
    for (int i = 0; i < padded; ++i) wJ[i] = weight[i] * J[p][i];
    out.g[p] = dot(wJ, r, padded);
    for (int q = 0; q <= p; ++q) out.A(p, q) = out.A(q, p) = dot(wJ, J[q], padded);
  }
}

#if defined(ALIGHT_WIDE)
template <int K, Sees kSees>
ALIGHT_WIDE void equations_wide(const Pixels& pixels, const Lights<K>& lights,
                                const typename Lights<K>::Gain* gains,
                                const PointSpread& spread, const Vector2& blur,
                                Equations<K>& out) {
  equations_of<K, kSees>(pixels, lights, gains, spread, blur, out);
}
#endif

template <int K, Sees kSees>
void equations(const Pixels& pixels, const Lights<K>& lights,
               const typename Lights<K>::Gain* gains, const PointSpread& spread,
               const Vector2& blur, Equations<K>& out) {
#if defined(ALIGHT_WIDE)
  if (is_wide()) {
    return equations_wide<K, kSees>(pixels, lights, gains, spread, blur, out);
  }
#endif
  equations_of<K, kSees>(pixels, lights, gains, spread, blur, out);
}

/// What the pixels that see a colour have of lights that are alike. Of a colour whose
/// pixels hardly tell, for they are full, at least so much.
struct ColorSeen {
  LightColor color{};
  bool told = true;  ///< All of it is.
};

template <int K>
ColorSeen color_of(const Pixels& pixels, const Lights<K>& lights,
                   const PointSpread& spread, const Vector2& blur) {
  const Shape shape(spread, blur, lights.width);
  // Of pixels that are not full, and of those that are.
  std::array<std::array<float, 3>, 2> seen{}, light2{};
  for (int i = 0; i < pixels.count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    float light = 0;
    for (std::size_t k = 0; k < K; ++k) {
      light += lights.height[k] *
               shape.at(pixels.u[at] - static_cast<float>(lights.uv[k].x()),
                        pixels.v[at] - static_cast<float>(lights.uv[k].y()));
    }
    const std::size_t full = pixels.full[at] > 0 ? 1 : 0, c = pixels.channel[at];
    const float weight = pixels.weight[at] * light;
    seen[full][c] += weight * (pixels.light[at] - lights.back);
    light2[full][c] += weight * light;
  }
  ColorSeen out;
  for (std::size_t c = 0; c < 3; ++c) {
    float sum = seen[0][c], of = light2[0][c];
    if (!(of > kColorTold)) {
      sum += seen[1][c];
      of += light2[1][c];
      out.told = false;
    }
    if (of > 0) out.color[c] = std::max(sum / of, 0.0f);
  }
  const float luminance = luminance_of(out.color.data());
  if (!(luminance > 0)) return {{1, 1, 1}, false};
  for (float& c : out.color) c /= luminance;
  return out;
}

template <int K, Sees kSees>
std::optional<SpotFit> fit(const Pixels& pixels, std::span<const LightSought> sought,
                           const PointSpread& spread, const Vector2& blur) {
  using Of = Equations<K>;
  constexpr int kBack = Of::kBack, kWidth = Of::kWidth, kN = Of::kN;
  using Vector = Eigen::Matrix<float, kN, 1>;
  using Matrix = Eigen::Matrix<float, kN, kN>;

  float darkest[kLane], brightest[kLane];
  std::fill_n(darkest, kLane, 255.0f);
  std::fill_n(brightest, kLane, 0.0f);
  for (int i = 0; i < pixels.padded; i += kLane) {
    for (int k = 0; k < kLane; ++k) {
      const float light = pixels.light[static_cast<std::size_t>(i + k)];
      darkest[k] = std::min(darkest[k], light);
      brightest[k] = std::max(brightest[k], light);
    }
  }
  const float dark = *std::min_element(darkest, darkest + kLane);
  const float bright = *std::max_element(brightest, brightest + kLane);
  Lights<K> lights;
  auto& [uv, height, back, width] = lights;
  for (std::size_t k = 0; k < K; ++k) {
    uv[k] = sought[k].uv;
    height[k] = sought[k].height > 0 ? static_cast<float>(sought[k].height)
                                     : 0.8f * (bright - dark);
  }
  back = dark;
  constexpr bool kOwnColor = kSees == Sees::own_color;
  std::array<LightColor, K> colors;
  alignas(32) std::array<typename Lights<K>::Gain, kOwnColor ? K : 0> gains;
  bool colors_known = true;
  for (std::size_t k = 0; k < K; ++k) {
    colors[k] = sought[k].color;
    if (kOwnColor) colors_known = colors_known && known(colors[k]);
  }
  const auto set_gains = [&] {
    for (std::size_t k = 0; k < gains.size(); ++k) {
      for (std::size_t i = 0; i < static_cast<std::size_t>(pixels.padded); ++i) {
        gains[k][i] = colors[k][pixels.channel[i]];
      }
    }
  };
  const auto tell_color = [&] {
    const LightColor common = color_of(pixels, lights, spread, blur).color;
    for (std::size_t k = 0; k < K; ++k) {
      if (!known(sought[k].color)) colors[k] = common;
    }
    set_gains();
  };
  if constexpr (kOwnColor) {
    colors_known ? set_gains() : tell_color();
    for (std::size_t k = 0; k < K; ++k) {
      if (sought[k].height > 0) continue;
      height[k] /= *std::max_element(colors[k].begin(), colors[k].end());
    }
  }

  SpotFit out;
  out.count = K;
  Of now;
  auto& [A, g, cost] = now;
  for (int iteration = 0;; ++iteration) {
    if (kOwnColor && !colors_known && iteration > 0) tell_color();
    equations<K, kSees>(pixels, lights, gains.data(), spread, blur, now);
    const auto share2 = static_cast<float>(spread.share_sd * spread.share_sd);
    constexpr auto back2 = static_cast<float>(kBackgroundSd * kBackgroundSd);
    A(kBack, kBack) += 1 / back2;
    g[kBack] -= (back - dark) / back2;
    A(kWidth, kWidth) += 1 / share2;
    g[kWidth] -= static_cast<float>(width - 1) / share2;
    for (int k = 0; k < K; ++k) A(3 * k + 2, 3 * k + 2) += 1e-6f;

    Matrix damped = A;
    constexpr auto start2 = static_cast<float>(kStartSd * kStartSd);
    for (int k = 0; k < K; ++k) {
      const auto at = static_cast<std::size_t>(k);
      damped(3 * k, 3 * k) += 1 / start2;
      damped(3 * k + 1, 3 * k + 1) += 1 / start2;
      const Vector2 off = uv[at] - sought[at].uv;
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
    // What is left after a step this short is far shorter, and A has hardly changed.
    cost = std::max(cost - static_cast<double>(g.dot(step)), 0.0);
    const int most = colors_known ? kIterations : kIterationsUntold;
    if (largest < static_cast<float>(kStepPx) || iteration == most) break;
  }

  const double freedom = std::max(static_cast<double>(pixels.count - kN), 1.0);
  out.chi2_per_pixel = cost / freedom;
  if (!(out.chi2_per_pixel < kChi2Max)) return std::nullopt;
  for (int k = 0; k < K; ++k) {
    const auto n = static_cast<std::size_t>(k);
    if ((uv[n] - sought[n].uv).norm() > kShiftMax) return std::nullopt;
    out.uv[n] = uv[n];
    out.height[n] = static_cast<double>(height[n]);
  }

  // What the pixels say of the places, everything else unknown.
  const Eigen::Matrix<double, kN, kN> H = A.template cast<double>();
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
  // Column by column: all together Eigen solves them as it does large ones.
  Eigen::Matrix<double, K + 2, 2 * K> told;
  for (int i = 0; i < 2 * K; ++i) told.col(i) = nn.solve(H_pn.row(i).transpose());
  out.information = H_pp - H_pn.lazyProduct(told);
  out.variance_px2 = spread.variance_px2 * width;
  out.variance_information =
      (H(kWidth, kWidth) - 1 / (spread.share_sd * spread.share_sd)) /
      (spread.variance_px2 * spread.variance_px2);
  if constexpr (kOwnColor) {
    const bool alike = std::all_of(colors.begin(), colors.end(),
                                   [&](const auto& one) { return one == colors[0]; });
    if (alike) {
      const ColorSeen seen = color_of(pixels, lights, spread, blur);
      if (seen.told) out.color = seen.color;
    }
  }
  return out;
}

template <Sees kSees>
ALIGHT_INLINE std::optional<SkirtLook> skirt_of(const ImageView& image,
                                                const Vector2& middle,
                                                std::span<const LightBeside> lights,
                                                const PointSpread& spread) {
  if (!(middle.minCoeff() > kSkirtBox && middle.x() < image.width - kSkirtBox - 1 &&
        middle.y() < image.height - kSkirtBox - 1)) {
    return std::nullopt;
  }
  static_assert(kBoxSide * kBoxRow <= kPixelsMax);
  const int u0 = static_cast<int>(std::lround(middle.x())) - kSkirtBox;
  const int v0 = static_cast<int>(std::lround(middle.y())) - kSkirtBox;
  const auto noise = static_cast<float>(spread.noise_variance);
  Pixels pixels;
  std::size_t count = 0;
  for (int v = v0; v <= v0 + 2 * kSkirtBox; ++v) {
    take_row<kSees>(image.row(v) + u0 * image.channels, image, u0, v, kBoxSide, count,
                    pixels);
    count += kBoxSide;
    pixels.light[count] = 0;
    pixels.channel[count] = 0;
    pixels.full[count++] = 1;
  }
  pixels.count = static_cast<int>(count);
  weigh(noise, pixels);
  const int padded = pixels.padded;
  // Light of the Gaussians, of skirts as high as they, and of those as their variance
  // grows.
  alignas(32) float core[kPixelsMax], wide[kPixelsMax], wider[kPixelsMax];
  for (int i = 0; i < padded; ++i) {
    core[i] = wide[i] = wider[i] = 0;
    pixels.weight[static_cast<std::size_t>(i)] *=
        1 - pixels.full[static_cast<std::size_t>(i)];
  }
  const auto height = static_cast<float>(spread.skirt);
  const auto half = static_cast<float>(0.5 / spread.skirt_over_core());
  for (const LightBeside& light : lights) {
    // As round as these lights are, a factor for each column and one for each row do.
    const Profile along = profile(u0, light.uv.x(), 1, spread);
    const Profile down = profile(v0, light.uv.y(), light.height, spread);
    for (int row = 0; row < kBoxSide; ++row) {
      const float d2_v = down.d2[row], core_v = down.core[row], wide_v = down.wide[row];
      float* const core_row = core + row * kBoxRow;
      float* const wide_row = wide + row * kBoxRow;
      float* const wider_row = wider + row * kBoxRow;
      float* const weight_row = pixels.weight.data() + row * kBoxRow;
      alignas(32) float gain[kBoxRow];
      for (int k = 0; k < kBoxRow; ++k) {
        gain[k] = 1;
        if constexpr (kSees == Sees::own_color) {
          const auto at = static_cast<std::size_t>(row * kBoxRow + k);
          gain[k] = light.color[pixels.channel[at]];
        }
      }
      for (int k = 0; k < kBoxRow; ++k) {
        const float d2 = d2_v + along.d2[k];
        const float skirt = wide_v * along.wide[k] * gain[k];
        core_row[k] += core_v * along.core[k] * gain[k];
        wide_row[k] += skirt;
        wider_row[k] += half * d2 * skirt;
        weight_row[k] *= d2 < kSkirtFrom * kSkirtFrom ? 0.f : 1.f;
      }
    }
  }
  // Least squares over an even background, the skirt's height and its variance.
  alignas(32) float rest[kPixelsMax], one[kPixelsMax];
  for (int i = 0; i < padded; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const float doubt = kCoreDoubt * core[i];
    pixels.weight[at] /= 1 + pixels.weight[at] * doubt * doubt;
    rest[i] = pixels.light[at] - core[i] - height * wide[i];
    wider[i] *= height;
    one[i] = 1;
  }
  const float* const J[2] = {wide, wider};
  const float* const weight = pixels.weight.data();
  const auto w_1 = static_cast<double>(dot(weight, one, padded));
  const auto w_r = static_cast<double>(dot(weight, rest, padded));
  if (!(w_1 > 0)) return std::nullopt;
  SkirtLook look;
  Vector2 by_back;
  for (int p = 0; p < 2; ++p) {
    alignas(32) float weighted[kPixelsMax];
    for (int i = 0; i < padded; ++i) weighted[i] = weight[i] * J[p][i];
    by_back[p] = static_cast<double>(dot(weighted, one, padded));
    look.pull[p] = static_cast<double>(dot(weighted, rest, padded));
    for (int q = 0; q <= p; ++q) {
      look.information(p, q) = look.information(q, p) =
          static_cast<double>(dot(weighted, J[q], padded));
    }
  }
  look.information -= by_back * by_back.transpose() / w_1;
  look.pull -= by_back * (w_r / w_1);
  if (!(look.information(0, 0) > kSkirtInformationLeast)) return std::nullopt;
  return look;
}

#if defined(ALIGHT_WIDE)
template <Sees kSees>
ALIGHT_WIDE std::optional<SkirtLook> skirt_wide(const ImageView& image,
                                                const Vector2& middle,
                                                std::span<const LightBeside> lights,
                                                const PointSpread& spread) {
  return skirt_of<kSees>(image, middle, lights, spread);
}
#endif

template <Sees kSees>
std::optional<SkirtLook> skirt(const ImageView& image, const Vector2& middle,
                               std::span<const LightBeside> lights,
                               const PointSpread& spread) {
#if defined(ALIGHT_WIDE)
  if (is_wide()) return skirt_wide<kSees>(image, middle, lights, spread);
#endif
  return skirt_of<kSees>(image, middle, lights, spread);
}

template <Sees kSees>
std::optional<SpotFit> fit_as(const ImageView& image,
                              std::span<const LightSought> sought,
                              const PointSpread& spread, const Vector2& blur_px,
                              std::span<const ForeignLight> foreign,
                              std::span<const LightBeside> beside, bool* unlike) {
  Pixels pixels;
  if (!gather<kSees>(image, sought, spot_reach_px(spread, blur_px),
                     static_cast<float>(spread.noise_variance), foreign, pixels)) {
    return std::nullopt;
  }
  const float most = sought.size() > 1 ? kFullMost : kFullMostAlone;
  if (full_share(pixels) > most) return std::nullopt;
  take_off<kSees>(beside, spread, blur_px, pixels);
  const auto found = [&] {
    switch (sought.size()) {
      case 1:
        return fit<1, kSees>(pixels, sought, spread, blur_px);
      case 2:
        return fit<2, kSees>(pixels, sought, spread, blur_px);
      case 3:
        return fit<3, kSees>(pixels, sought, spread, blur_px);
      default:
        return fit<4, kSees>(pixels, sought, spread, blur_px);
    }
  }();
  if (unlike != nullptr) *unlike = !found;
  return found;
}

}  // namespace

double spot_reach_px(const PointSpread& spread, const Vector2& blur_px) {
  const double sd = std::sqrt(spread.variance_px2 + blur_px.squaredNorm() / 12);
  return std::max(kReach * sd, 2.0);
}

std::optional<SpotFit> fit_spots(const ImageView& image,
                                 std::span<const LightSought> sought,
                                 const PointSpread& spread, const Vector2& blur_px,
                                 std::span<const ForeignLight> foreign,
                                 std::span<const LightBeside> beside, bool* unlike) {
  if (unlike != nullptr) *unlike = false;
  if (sought.empty() || sought.size() > kMaxGroup) return std::nullopt;
  const auto fitted =
      image.mosaic == Mosaic::none ? fit_as<Sees::luminance> : fit_as<Sees::own_color>;
  return fitted(image, sought, spread, blur_px, foreign, beside, unlike);
}

std::optional<SkirtLook> look_at_skirt(const ImageView& image, const Vector2& middle,
                                       std::span<const LightBeside> lights,
                                       const PointSpread& spread) {
  const auto look =
      image.mosaic == Mosaic::none ? skirt<Sees::luminance> : skirt<Sees::own_color>;
  return look(image, middle, lights, spread);
}

}  // namespace alight
