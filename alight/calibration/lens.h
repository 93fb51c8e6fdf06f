#pragma once
#include <array>
#include <vector>

#include "alight/calibration/board.h"
#include "alight/geometry/camera.h"

namespace alight {

struct LensConfig {
  bool fit_k3 = false;      ///< Only for wide lenses whose corners the board reached.
  double new_view_px = 15;  ///< Views whose corners moved less, on average, repeat one.
  int views_max = 80;
  int hold_out = 5;  ///< Every how many-th view is held out.
  // What is too weak to be used.
  int views_min = 8;
  double tilt_min_deg = 25;     ///< Largest angle between two views' boards.
  double reach_min = 0.6;       ///< Of the picture's width and height.
  double focal_sd_max = 0.005;  ///< Relative.
  double principal_sd_max_px = 3;
};

/// Order of LensFit::sd: fx fy cx cy k1 k2 p1 p2 k3.
inline constexpr int kLensNumbers = 9;

struct LensFit {
  Intrinsics lens;
  std::array<double, kLensNumbers> sd{};
  int views = 0;             ///< Used,
  int views_dropped = 0;     ///< and not: blurred, or the board not flat.
  double rms_before_px = 0;  ///< With the lens as written.
  double rms_px = 0;
  double rms_held_out_px = 0;  ///< Lens from the other views, only poses fitted.
  int views_held_out = 0;
  double tilt_deg = 0;  ///< Largest angle between two views' boards.
  double reach_u = 0;   ///< Share of the picture's width that corners span,
  double reach_v = 0;   ///< and of its height.
};

/// Keeps views that show the board in a new place.
class BoardViews {
 public:
  explicit BoardViews(const LensConfig& config) : config_(config) {}
  void add(const BoardView& view);
  const std::vector<BoardView>& views() const { return views_; }

 private:
  LensConfig config_;
  std::vector<BoardView> views_;
};

/// Focal lengths, principal point and distortion from views of a board (Zhang 2000, by
/// OpenCV). sd are those of the fit, made larger where held-out views fit worse.
/// @returns too_few_points or degenerate for weak data, with what to record instead.
Result<LensFit> calibrate_lens(const LensConfig& config, const Intrinsics& written,
                               const std::vector<BoardView>& views);

}  // namespace alight
