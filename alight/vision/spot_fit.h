#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "alight/geometry/image.h"
#include "alight/geometry/led_frame.h"
#include "alight/vision/blob.h"

namespace alight {

/// How the camera draws a point of light: a Gaussian on a wider, faint one, its skirt.
struct PointSpread {
  double variance_px2 = 1;        ///< Per axis: lens, pixel, and the LED's own size.
  double share_sd = 0.4;          ///< How well it is known, as a share of itself.
  double skirt = 0;               ///< Height of the skirt over that of the Gaussian,
  double skirt_variance_px2 = 0;  ///< and its variance per axis, which the LED's size
                                  ///< hardly matters to; 0: not known.
  double noise_variance = 6;      ///< Of an unlit pixel's luminance, grey levels^2.

  /// Variance of the skirt over the Gaussian's, at least, usual, and at most.
  static constexpr double kSkirtLeast = 2.5, kSkirtUsual = 6, kSkirtWidest = 16;
  double skirt_over_core() const {
    if (!(skirt_variance_px2 > 0)) return kSkirtUsual;
    return std::clamp(skirt_variance_px2 / variance_px2, kSkirtLeast, kSkirtWidest);
  }
};

/// How far a light's pixels reach that fit_spots looks at.
double spot_reach_px(const PointSpread& spread, const Vector2& blur_px);

/// A light that is none of those looked for: its pixels are left out.
struct ForeignLight {
  static constexpr double kAll = 1e9;
  Roi box;  ///< Within it, so far along and across a line through its middle:
  Vector2 middle = Vector2::Zero();
  Vector2 along = Vector2::UnitX();
  double half_length = kAll, half_width = kAll;  ///< px

  bool covers(int u, int v) const {
    if (u < box.u0 || u >= box.u1 || v < box.v0 || v >= box.v1) return false;
    const Vector2 d(u - middle.x(), v - middle.y());
    return std::abs(along.dot(d)) <= half_length &&
           std::abs(along.x() * d.y() - along.y() * d.x()) <= half_width;
  }
};

/// What a light gives to pixels that see blue, green and red, its luminance being 1.
/// All zero: not known.
using LightColor = std::array<float, 3>;
inline bool known(const LightColor& color) {
  return color[0] + color[1] + color[2] > 0;
}

/// A light beside those looked for, at a place that is known: its light is taken off.
struct LightBeside {
  Vector2 uv = Vector2::Zero();  ///< px
  double height = 0;             ///< As SpotFit::height.
  LightColor color{};            ///< Where the picture has a mosaic.
};

/// What is known of a light that is looked for.
struct LightSought {
  Vector2 uv = Vector2::Zero();  ///< px, where it is expected; off by less than about a
                                 ///< pixel and a half.
  double height = 0;   ///< As SpotFit::height where it is expected; 0: unknown.
  LightColor color{};  ///< Where the picture has a mosaic.
};

/// The lights of one patch of a picture, told apart.
struct SpotFit {
  int count = 0;
  std::array<Vector2, kMaxGroup> uv;       ///< px
  std::array<double, kMaxGroup> height{};  ///< Of each light's peak, grey levels.
  GroupMatrix information;                 ///< px^-2, of all uv together; what the
                                           ///< pixels do not decide has none. For
                                           ///< noise of chi2_per_pixel 1.
  double variance_px2 = 0;                 ///< Of the point spread, as found here,
  double variance_information = 0;         ///< and the information on it.
  double chi2_per_pixel = 0;               ///< About 1 where the model holds.
  LightColor
      color{};  ///< Of lights of one colour under a mosaic, where it can be told.
};

/// Finds where `sought.size()` lights stand whose images overlap, from the pixels
/// themselves: the sum of one light each over an even background, least squares
/// (Gauss-Newton) over places, heights, background and width together. Pixels at the
/// sensor's upper end say only that the light is at least that.
///
/// Of a colour picture its luminance counts, which no chroma subsampling has blurred;
/// under a mosaic what each pixel has seen, for interpolation moves small lights by up
/// to 0.3 px.
///
/// @param blur_px Displacement of the images during the exposure.
/// @param foreign Lights that are none of these.
/// @returns nothing when the lights leave the picture, or what is found is none of the
///          expected: too far off, or of another shape; nor when they are full as far
///          as they were thought to reach, for then any place fits.
/// @param beside   Others like them whose light reaches here.
/// @param unlike   Receives whether that is why nothing is returned: what is found is
///                 none of the expected.
std::optional<SpotFit> fit_spots(const ImageView& image,
                                 std::span<const LightSought> sought,
                                 const PointSpread& spread, const Vector2& blur_px,
                                 std::span<const ForeignLight> foreign,
                                 std::span<const LightBeside> beside = {},
                                 bool* unlike = nullptr);

/// What pixels around a light tell of the skirt: normal equations of its height
/// (PointSpread::skirt) and of the logarithm of its variance, about those of the spread
/// they were looked at with, for noise of chi2 1.
struct SkirtLook {
  Matrix2 information = Matrix2::Zero();
  Vector2 pull = Vector2::Zero();
};

/// Compares the pixels some way off `middle` with the skirts that `lights` would have.
/// @pre no other light is near.
std::optional<SkirtLook> look_at_skirt(const ImageView& image, const Vector2& middle,
                                       std::span<const LightBeside> lights,
                                       const PointSpread& spread);
constexpr int kSkirtBox = 7;  ///< px around the middle that are looked at.

}  // namespace alight
