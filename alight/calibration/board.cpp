#include "alight/calibration/board.h"

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#ifdef ALIGHT_WITH_ARUCO
#include <opencv2/aruco/charuco.hpp>
#endif

#include "alight/base/bounds.h"

namespace alight {
namespace {

constexpr std::size_t kFewestCharuco = 8;

cv::Mat grey_of(const ImageView& image) {
  const cv::Mat view(image.height, image.width, image.channels == 1 ? CV_8UC1 : CV_8UC3,
                     const_cast<std::uint8_t*>(image.data),
                     static_cast<std::size_t>(image.stride));
  cv::Mat grey;
  if (image.channels == 1) {
    grey = view.clone();
  } else {
    cv::cvtColor(view, grey, cv::COLOR_BGR2GRAY);
  }
  return grey;
}

std::optional<BoardView> find_chessboard(const BoardSpec& spec, const cv::Mat& grey) {
  const cv::Size size(spec.columns, spec.rows);
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(grey, size, corners,
                                 cv::CALIB_CB_ADAPTIVE_THRESH |
                                     cv::CALIB_CB_NORMALIZE_IMAGE |
                                     cv::CALIB_CB_FAST_CHECK)) {
    return std::nullopt;
  }
  // A window that reaches no neighbour: half of the shortest step.
  double step = 1e9;
  for (std::size_t i = 1; i < corners.size(); ++i) {
    if (i % static_cast<std::size_t>(spec.columns) == 0) continue;
    step = std::min(step, cv::norm(corners[i] - corners[i - 1]));
  }
  const int half = std::clamp(static_cast<int>(0.4 * step), 2, 11);
  cv::cornerSubPix(
      grey, corners, cv::Size(half, half), cv::Size(-1, -1),
      cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-3));
  BoardView view;
  for (int v = 0; v < spec.rows; ++v) {
    for (int u = 0; u < spec.columns; ++u) {
      const cv::Point2f& c = corners[static_cast<std::size_t>(v * spec.columns + u)];
      view.p_board.emplace_back(u * spec.square_m, v * spec.square_m, 0);
      view.uv.emplace_back(c.x, c.y);
    }
  }
  return view;
}

std::optional<BoardView> find_charuco([[maybe_unused]] const BoardSpec& spec,
                                      [[maybe_unused]] const cv::Mat& grey) {
#ifdef ALIGHT_WITH_ARUCO
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50);
  const auto board = cv::aruco::CharucoBoard::create(
      spec.columns, spec.rows, static_cast<float>(spec.square_m),
      static_cast<float>(spec.square_m * spec.marker_share), dictionary);
  std::vector<std::vector<cv::Point2f>> markers;
  std::vector<int> ids;
  cv::aruco::detectMarkers(grey, dictionary, markers, ids);
  if (ids.empty()) return std::nullopt;
  std::vector<cv::Point2f> corners;
  std::vector<int> corner_ids;
  cv::aruco::interpolateCornersCharuco(markers, ids, grey, board, corners, corner_ids);
  if (corners.size() < kFewestCharuco) return std::nullopt;
  BoardView view;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const cv::Point3f& p =
        board->chessboardCorners[static_cast<std::size_t>(corner_ids[i])];
    view.p_board.emplace_back(p.x, p.y, 0);
    view.uv.emplace_back(corners[i].x, corners[i].y);
  }
  return view;
#else
  return std::nullopt;
#endif
}

}  // namespace

Result<void> BoardSpec::validate() const {
  if (auto good = check_bounds({{"board columns", static_cast<double>(columns), 3, 50},
                                {"board rows", static_cast<double>(rows), 3, 50},
                                {"square_m", square_m, 0.001, 1},
                                {"marker share", marker_share, 0.3, 0.95}});
      !good) {
    return good;
  }
  if (kind == Kind::chessboard) return {};
#ifdef ALIGHT_WITH_ARUCO
  if (columns * rows / 2 > 50) {
    return fail(Fault::invalid_config,
                "the board needs more than the 50 markers of dictionary 4x4_50");
  }
  return {};
#else
  return fail(
      Fault::invalid_config,
      "this build cannot read ChArUco boards: install libopencv-contrib-dev and "
      "build again, or use a chessboard (--board)");
#endif
}

std::optional<BoardView> find_board(const BoardSpec& spec, const ImageView& image) {
  const cv::Mat grey = grey_of(image);
  return spec.kind == BoardSpec::Kind::chessboard ? find_chessboard(spec, grey)
                                                  : find_charuco(spec, grey);
}

}  // namespace alight
