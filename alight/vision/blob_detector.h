#pragma once
#include <cstdint>
#include <vector>

#include "alight/base/result.h"
#include "alight/vision/blob.h"
#include "alight/vision/picture_noise.h"

namespace alight {

struct BlobDetectorConfig {
  /// tau_gy of eqn:RSE_thres, 0 to 254. Grey is the brightest channel, so that a blue
  /// or red LED counts as much as a green one.
  int grey_threshold = 60;
  /// The same for LookFor::dim, at most grey_threshold; 0: not looked for. An LED three
  /// times as dim as those that stand out well is still well above a sensor's noise.
  int dim_threshold = 30;
  /// tau_dp of eqn:RSE_thres, m: farther pixels are dark; 0 switches it off. Pixels of
  /// unknown depth stay.
  double depth_threshold_m = 0;
  /// Smooths before blobs are formed (paper). A 3 x 3 kernel leaves the centroid of the
  /// light where it is and joins patches up to two dark pixels apart, so the joining is
  /// all that is computed.
  bool smooth = false;
  double area_min_px = 1;
  double area_max_px = 4000;
  int color_margin_px = 2;  ///< How far around the patch its hue is looked for.
  /// Largest minus smallest channel, in grey levels, below which a light is white. The
  /// core of a bright LED is white whatever its colour: pixels count by how far they
  /// are from white.
  double color_chroma_min = 18;
  double centroid_sd_min_px = 0.03;

  Result<void> validate() const;
};

/// Finds bright patches in one pass over the picture (paper, eqn:RSE_thres): runs of
/// bright pixels, joined row by row with a union-find.
///
/// No allocation after `create`. What lies outside the region of interest (plus
/// color_margin_px for the hue) has no influence.
class BlobDetector {
 public:
  enum class LookFor : std::uint8_t { bright, dim };

  static Result<BlobDetector> create(const BlobDetectorConfig& config, int width,
                                     int height);

  BlobDetector(BlobDetector&&) = default;  // Copies would lose the reserved room.
  BlobDetector& operator=(BlobDetector&&) = default;

  /// Whether these are pictures that `detect` takes: of the size it was made for, with
  /// pixels; `depth` may be empty.
  bool takes(const ImageView& image, const DepthView& depth = {}) const;

  /// Blobs of a grey or BGR picture. `depth` may be empty; an empty `roi` is the whole
  /// picture, one that hangs over the edge is cut.
  /// @returns invalid_input for another size, number of channels or a null picture;
  ///          degenerate when the picture is so bright that it falls into more patches
  ///          than can be told apart. Of more than kMaxBlobs blobs the largest stay.
  Result<BlobSpan> detect(const ImageView& image, const DepthView& depth = {},
                          const Roi& roi = {}, LookFor what = LookFor::bright);

  /// The pictures from now on are so noisy: what may be noise is no light, whatever the
  /// configured thresholds.
  void set_noise(const PictureNoise& noise) { noise_ = noise; }

  /// Of a light whose pixels lie in `box`; none of a grey picture. As of the blobs of
  /// the last `detect`, but nothing around the box counts. @pre `box` lies in the
  /// picture
  LedColor color_at(const ImageView& image, const Roi& box) const;

  const BlobDetectorConfig& config() const { return config_; }

 private:
  BlobDetector(const BlobDetectorConfig& config, int width, int height);

  struct Run {
    int u0, u1, part;
  };
  /// Whole-number sums over one patch, so that no order of joining changes a bit.
  struct Part {
    int parent;
    int u0, v0, u1, v1;
    int area, peak;
    std::int64_t w, wu, wv, wuu, wuv, wvv;
  };

  int root(int part);
  int join(int a, int b);
  void add_run(const ImageView& image, int v, int u0, int u1, int v_first);
  Blob finish(const Part& part, const ImageView& image, const DepthView& depth) const;
  double depth_of(const Part& part, const ImageView& image,
                  const DepthView& depth) const;

  BlobDetectorConfig config_;
  PictureNoise noise_;
  int threshold_;  ///< Of the picture that is looked at.
  int width_, height_;
  std::vector<Run> runs_;
  std::vector<std::size_t>
      row_begin_;  ///< First run of each row, and one past the last.
  std::vector<Part> parts_;
  std::vector<int> order_;
  std::vector<Blob> blobs_;
};

}  // namespace alight
