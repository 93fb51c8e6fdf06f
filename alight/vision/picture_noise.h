#pragma once
#include "alight/geometry/image.h"

namespace alight {

/// What the pixels of a picture vary by where nothing is to be seen.
struct PictureNoise {
  int dark = 0;        ///< Grey level of most of the picture, of the brightest
                       ///< channel as BlobDetector's,
  double grey_sd = 0;  ///< and the noise of it.
  double luminance_variance = 0;  ///< Of a pixel's luminance (ITU-R BT.601), or of what
                                  ///< each pixel under a mosaic sees.

  /// Grey level above which a pixel is more than noise: of a picture of 400,000 about
  /// five are not.
  int threshold() const;
};

/// Looks at a grid of pixels and their neighbours a few columns on, which lights, lamps
/// and edges hardly ever tell apart and noise always does (median of absolute
/// differences, Hampel 1974). No allocation.
/// @pre not empty
PictureNoise picture_noise(const ImageView& picture);

}  // namespace alight
