#include "alight/calibration/lens.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"
#include "alight/geometry/pose.h"

namespace alight {
namespace {

Intrinsics drawn_lens(Rng& rng) {
  Intrinsics lens;
  lens.width = 640;
  lens.height = 400;
  lens.fx = rng.uniform(300, 600);
  lens.fy = lens.fx * rng.uniform(0.98, 1.02);
  lens.cx = 319.5 + rng.normal(0, 8);
  lens.cy = 199.5 + rng.normal(0, 8);
  lens.distortion = {rng.uniform(-0.2, 0.05), rng.uniform(-0.03, 0.05),
                     rng.normal(0, 0.001), rng.normal(0, 0.001), 0};
  return lens;
}

/// A pose of the board, up to `tilt` from square on, that shows it somewhere.
Pose drawn_pose(const Intrinsics& lens, const BoardSpec& board, double tilt, Rng& rng) {
  const double width = (board.columns + 1) * board.square_m;
  const double z = width * lens.fx / (lens.width * rng.uniform(0.35, 0.75));
  const Vector3 ray = lens.unproject(
      {lens.width * rng.uniform(0.2, 0.8), lens.height * rng.uniform(0.25, 0.75)});
  const Matrix3 R =
      from_rpy(rng.uniform(-tilt, tilt), rng.uniform(-tilt, tilt), rng.normal(0, 0.2));
  const Vector3 middle((board.columns - 1) * board.square_m / 2,
                       (board.rows - 1) * board.square_m / 2, 0);
  return make_pose(R, ray * z - R * middle);
}

std::optional<BoardView> seen_by(const Intrinsics& lens, const BoardSpec& board,
                                 const Pose& X_CBoard, double sd_px, Rng& rng) {
  BoardView view;
  for (int v = 0; v < board.rows; ++v) {
    for (int u = 0; u < board.columns; ++u) {
      const Vector3 p(u * board.square_m, v * board.square_m, 0);
      const auto uv = lens.project(X_CBoard * p);
      if (!uv || !lens.contains(*uv, 4)) return std::nullopt;
      view.p_board.push_back(p);
      view.uv.push_back(*uv + Vector2(rng.normal(0, sd_px), rng.normal(0, sd_px)));
    }
  }
  return view;
}

std::vector<BoardView> views_of(const Intrinsics& lens, int count, double tilt,
                                Rng& rng) {
  std::vector<BoardView> views;
  while (static_cast<int>(views.size()) < count) {
    const BoardSpec board;
    const auto view =
        seen_by(lens, board, drawn_pose(lens, board, tilt, rng), 0.1, rng);
    if (view) views.push_back(*view);
  }
  return views;
}

Intrinsics guess(const Intrinsics& lens) {
  Intrinsics out;
  out.width = lens.width;
  out.height = lens.height;
  out.fx = out.fy = 450;
  out.cx = lens.width / 2;
  out.cy = lens.height / 2;
  return out;
}

TEST(Lens, NumbersAsSureAsSaid) {
  double squares = 0;
  int count = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    Rng rng(seed);
    const Intrinsics truth = drawn_lens(rng);
    const auto fit = calibrate_lens({}, guess(truth), views_of(truth, 24, 0.7, rng));
    ASSERT_TRUE(fit) << seed << ": " << fit.error().detail;
    const double errors[] = {
        fit->lens.fx - truth.fx,
        fit->lens.fy - truth.fy,
        fit->lens.cx - truth.cx,
        fit->lens.cy - truth.cy,
        fit->lens.distortion[0] - truth.distortion[0],
        fit->lens.distortion[1] - truth.distortion[1],
        fit->lens.distortion[2] - truth.distortion[2],
        fit->lens.distortion[3] - truth.distortion[3],
    };
    for (std::size_t i = 0; i < 8; ++i) {
      EXPECT_LT(std::abs(errors[i]), 5 * fit->sd[i]) << seed << " " << i;
      squares += std::pow(errors[i] / fit->sd[i], 2);
      ++count;
    }
    EXPECT_GT(fit->rms_before_px, 5 * fit->rms_px);
    EXPECT_LT(fit->rms_held_out_px, 1.5 * fit->rms_px);
  }
  EXPECT_LT(squares / count, 1.6);
  EXPECT_GT(squares / count, 0.3);
}

TEST(Lens, RefusesWeakViews) {
  Rng rng(5);
  const Intrinsics truth = drawn_lens(rng);
  const auto refused = [&](const std::vector<BoardView>& views, const char* word) {
    const auto fit = calibrate_lens({}, guess(truth), views);
    ASSERT_FALSE(fit) << word;
    EXPECT_NE(fit.error().detail.find(word), std::string::npos) << fit.error().detail;
  };
  refused({}, "only 0 pictures");
  refused(views_of(truth, 5, 0.7, rng), "only 5 pictures");
  refused(views_of(truth, 20, 0.02, rng), "tilt it");
  // Always in one corner.
  std::vector<BoardView> corner;
  while (corner.size() < 20) {
    const BoardSpec board;
    Pose X = drawn_pose(truth, board, 0.7, rng);
    X.translation() *= 2;
    const auto view = seen_by(truth, board, X, 0.1, rng);
    if (!view) continue;
    Vector2 high = Vector2::Zero();
    for (const Vector2& uv : view->uv) high = high.cwiseMax(uv);
    if (high.x() < 330 && high.y() < 230) corner.push_back(*view);
  }
  refused(corner, "corners");
}

TEST(Lens, AViewThatRepeatsOneIsNotKept) {
  Rng rng(3);
  const Intrinsics truth = drawn_lens(rng);
  const auto views = views_of(truth, 3, 0.7, rng);
  BoardViews kept{LensConfig{}};
  for (int k = 0; k < 10; ++k) {
    for (const BoardView& view : views) kept.add(view);
  }
  EXPECT_EQ(kept.views().size(), 3u);
}

/// The board as the lens shows it, four samples a pixel, with noise.
class Picture {
 public:
  Picture(const Intrinsics& lens, const BoardSpec& board, const Pose& X_CBoard,
          Rng& rng)
      : lens_(lens), pixels_(static_cast<std::size_t>(lens.width * lens.height)) {
    const Pose X_BoardC = X_CBoard.inverse();
    for (int v = 0; v < lens.height; ++v) {
      for (int u = 0; u < lens.width; ++u) {
        double light = 0;
        for (int k = 0; k < 4; ++k) {
          const Vector2 uv(u - 0.25 + 0.5 * (k % 2), v - 0.25 + 0.5 * (k / 2));
          light += 0.25 * shade(board, X_BoardC, lens.unproject(uv));
        }
        const double value = light + rng.normal(0, 2);
        pixels_[static_cast<std::size_t>(v * lens.width + u)] =
            static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0));
      }
    }
  }
  ImageView view() const {
    return {pixels_.data(), lens_.width, lens_.height, 1, lens_.width};
  }

 private:
  static double shade(const BoardSpec& board, const Pose& X_BoardC,
                      const Vector3& ray) {
    const Vector3 from = X_BoardC.translation(), along = X_BoardC.linear() * ray;
    const Vector3 p = from - along * (from.z() / along.z());
    // Corner (0, 0) is the first inner one.
    const double x = p.x() / board.square_m + 1, y = p.y() / board.square_m + 1;
    const bool on_board = x > 0 && y > 0 && x < board.columns + 1 && y < board.rows + 1;
    if (!on_board) return 215;
    return (static_cast<int>(x) + static_cast<int>(y)) % 2 == 0 ? 30 : 215;
  }
  Intrinsics lens_;
  std::vector<std::uint8_t> pixels_;
};

TEST(Board, RenderedBoardsGiveTheLens) {
  for (unsigned seed = 0; seed < 2; ++seed) {
    Rng rng(40 + seed);
    Intrinsics truth = drawn_lens(rng);
    truth.distortion[0] = -0.1;
    const BoardSpec board;
    std::vector<BoardView> views;
    for (int tries = 0; tries < 60 && views.size() < 16; ++tries) {
      const Pose X = drawn_pose(truth, board, 0.6, rng);
      if (!seen_by(truth, board, X, 0, rng)) continue;
      const Picture picture(truth, board, X, rng);
      const auto view = find_board(board, picture.view());
      if (view) views.push_back(*view);
    }
    ASSERT_GE(views.size(), 12u);
    const auto fit = calibrate_lens({}, guess(truth), views);
    ASSERT_TRUE(fit) << fit.error().detail;
    EXPECT_NEAR(fit->lens.fx, truth.fx, 0.005 * truth.fx);
    EXPECT_NEAR(fit->lens.fy, truth.fy, 0.005 * truth.fy);
    EXPECT_NEAR(fit->lens.cx, truth.cx, 2);
    EXPECT_NEAR(fit->lens.cy, truth.cy, 2);
    EXPECT_LT(fit->rms_px, 0.2);
    EXPECT_LT(std::abs(fit->lens.fx - truth.fx), 5 * fit->sd[0]);
  }
}

TEST(Board, NoBoardNoView) {
  const std::vector<std::uint8_t> grey(640 * 400, 128);
  EXPECT_FALSE(find_board({}, {grey.data(), 640, 400, 1, 640}));
}

}  // namespace
}  // namespace alight
