#pragma once
#include <span>

#include "alight/geometry/image.h"
#include "alight/geometry/led_frame.h"

namespace alight {

inline constexpr int kMaxBlobs = 512;

/// One connected bright patch of a picture.
struct Blob {
  Vector2 uv = Vector2::Zero();       ///< Weighted centroid, px.
  Matrix2 cov = Matrix2::Identity();  ///< Of the centroid, px^2.
  Matrix2 spread = Matrix2::Zero();   ///< Second central moments of the light, px^2.
  double area_px = 0;                 ///< Pixels above the threshold.
  double brightness = 0;              ///< Sum of grey above the threshold.
  double peak = 0;                    ///< Brightest grey, 0 to 255.
  double depth_m = 0;                 ///< Along the optical axis; 0 when unknown.
  LedColor color = LedColor::none;    ///< none: grey picture or hue not to be told.
  Roi box;                            ///< Smallest box around the patch.
  bool saturated = false;
  bool cut = false;    ///< Hangs over the edge of what was looked at: its centroid is
                       ///< not the light's.
  bool stray = false;  ///< Known from earlier pictures as no LED (StrayMemory).
};

/// Stretch of a patch of light or of a group of points with second moments S, px^2:
/// how it is longer along one direction than across it, whatever its width. A single
/// light has none, two lights `d` apart have |d|^2 / 4 along d.
inline Vector2 stretch_of(const Matrix2& S) { return {S(0, 0) - S(1, 1), 2 * S(0, 1)}; }

/// Blobs of one picture, in the order of their first row and column. Valid until the
/// next call of whatever returned it.
using BlobSpan = std::span<const Blob>;

}  // namespace alight
