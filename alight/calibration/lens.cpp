#include "alight/calibration/lens.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <opencv2/calib3d.hpp>
#include <sstream>

#include "alight/base/median.h"

namespace alight {
namespace {

constexpr double kDropBeyond = 3;  // times the median rms of the views

using Views = std::vector<const BoardView*>;

cv::Matx33d matrix_of(const Intrinsics& lens) {
  return {lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1};
}

std::vector<double> distortion_of(const Intrinsics& lens) {
  return {lens.distortion.begin(), lens.distortion.end()};
}

void copy_to(const BoardView& view, std::vector<cv::Point3f>& p,
             std::vector<cv::Point2f>& uv) {
  for (const Vector3& q : view.p_board) {
    p.emplace_back(static_cast<float>(q.x()), static_cast<float>(q.y()), 0.f);
  }
  for (const Vector2& q : view.uv) {
    uv.emplace_back(static_cast<float>(q.x()), static_cast<float>(q.y()));
  }
}

struct Solution {
  Intrinsics lens;
  std::array<double, kLensNumbers> sd{};
  std::vector<double> view_rms;
  std::vector<Matrix3> R_CBoard;
  double rms_px = 0;
};

Result<Solution> solve(const LensConfig& config, const Intrinsics& written,
                       const Views& views) {
  std::vector<std::vector<cv::Point3f>> p(views.size());
  std::vector<std::vector<cv::Point2f>> uv(views.size());
  for (std::size_t i = 0; i < views.size(); ++i) copy_to(*views[i], p[i], uv[i]);
  cv::Mat K, D, sd, sd_views, view_rms;
  std::vector<cv::Mat> rotations, translations;
  Solution out;
  try {
    out.rms_px = cv::calibrateCamera(
        p, uv, cv::Size(written.width, written.height), K, D, rotations, translations,
        sd, sd_views, view_rms, config.fit_k3 ? 0 : cv::CALIB_FIX_K3,
        cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-10));
  } catch (const cv::Exception&) {
    return fail(Fault::no_convergence,
                "the views of the board give no lens: is it flat, and of that many "
                "corners?");
  }
  out.lens = written;
  out.lens.fx = K.at<double>(0, 0);
  out.lens.fy = K.at<double>(1, 1);
  out.lens.cx = K.at<double>(0, 2);
  out.lens.cy = K.at<double>(1, 2);
  for (int i = 0; i < 5; ++i) {
    out.lens.distortion[static_cast<std::size_t>(i)] = D.at<double>(i);
  }
  for (int i = 0; i < kLensNumbers; ++i) {
    out.sd[static_cast<std::size_t>(i)] = sd.at<double>(i);
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    out.view_rms.push_back(view_rms.at<double>(static_cast<int>(i)));
    const cv::Vec3d w = rotations[i];
    out.R_CBoard.push_back(so3_exp(Vector3(w[0], w[1], w[2])));
  }
  return out;
}

/// rms distance of the corners with a pose of its own for each view.
double rms_of(const Intrinsics& lens, const Views& views) {
  double sum = 0, count = 0;
  for (const BoardView* view : views) {
    std::vector<cv::Point3f> p;
    std::vector<cv::Point2f> uv, seen;
    copy_to(*view, p, uv);
    cv::Vec3d w, t;
    if (!cv::solvePnP(p, uv, matrix_of(lens), distortion_of(lens), w, t)) continue;
    cv::projectPoints(p, w, t, matrix_of(lens), distortion_of(lens), seen);
    for (std::size_t i = 0; i < uv.size(); ++i) {
      const cv::Point2f d = seen[i] - uv[i];
      sum += static_cast<double>(d.x * d.x + d.y * d.y);
      ++count;
    }
  }
  return std::sqrt(sum / count);
}

/// Largest angle between the normals of two boards.
double tilt_between(const std::vector<Matrix3>& R) {
  double most = 0;
  for (std::size_t i = 0; i < R.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double c = R[i].col(2).dot(R[j].col(2));
      most = std::max(most, std::acos(std::clamp(c, -1.0, 1.0)));
    }
  }
  return most / kDegree;
}

std::string share(double x) {
  return std::to_string(static_cast<int>(std::lround(100 * x))) + " %";
}

Result<void> strong_enough(const LensConfig& config, const LensFit& fit) {
  if (fit.tilt_deg < config.tilt_min_deg) {
    return fail(
        Fault::degenerate,
        "the board is always seen from about the same side (within " +
            std::to_string(std::lround(fit.tilt_deg)) +
            " deg): tilt it by 20 to 40 deg to the left, right, front and back");
  }
  if (std::min(fit.reach_u, fit.reach_v) < config.reach_min) {
    return fail(Fault::degenerate,
                "the board reached only " + share(fit.reach_u) +
                    " of the picture's width and " + share(fit.reach_v) +
                    " of its height: carry it into all four corners");
  }
  std::ostringstream text;
  text << std::setprecision(2);
  if (std::max(fit.sd[0] / fit.lens.fx, fit.sd[1] / fit.lens.fy) >
      config.focal_sd_max) {
    text << "the focal length stays uncertain by " << 100 * fit.sd[0] / fit.lens.fx
         << " %: record more views of the tilted board, filling the picture";
    return fail(Fault::degenerate, text.str());
  }
  if (std::max(fit.sd[2], fit.sd[3]) > config.principal_sd_max_px) {
    text << "the principal point stays uncertain by " << std::max(fit.sd[2], fit.sd[3])
         << " px: record more views of the board tilted both ways";
    return fail(Fault::degenerate, text.str());
  }
  return {};
}

Result<void> enough_views(const LensConfig& config, std::size_t views) {
  if (static_cast<int>(views) >= config.views_min) return {};
  return fail(Fault::too_few_points,
              "only " + std::to_string(views) +
                  " pictures show the whole board in a new place, " +
                  std::to_string(config.views_min) +
                  " are needed: some twenty, near and tilted all ways, in the middle "
                  "and in all corners (and see that the number of corners is right)");
}

}  // namespace

void BoardViews::add(const BoardView& view) {
  if (static_cast<int>(views_.size()) >= config_.views_max) return;
  for (const BoardView& other : views_) {
    if (other.uv.size() != view.uv.size()) continue;
    double sum = 0;
    for (std::size_t i = 0; i < view.uv.size(); ++i) {
      sum += (view.uv[i] - other.uv[i]).norm();
    }
    if (sum < config_.new_view_px * static_cast<double>(view.uv.size())) return;
  }
  views_.push_back(view);
}

Result<LensFit> calibrate_lens(const LensConfig& config, const Intrinsics& written,
                               const std::vector<BoardView>& views) {
  Views used;
  for (const BoardView& view : views) used.push_back(&view);
  if (auto good = enough_views(config, used.size()); !good) return fail(good.error());
  auto found = solve(config, written, used);
  if (!found) return fail(found.error());
  LensFit fit;
  std::vector<double> sorted = found->view_rms;
  const double limit =
      std::max(kDropBeyond * median(sorted.begin(), sorted.end()), 0.1);
  Views kept;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (found->view_rms[i] <= limit) kept.push_back(used[i]);
  }
  fit.views_dropped = static_cast<int>(used.size() - kept.size());
  if (auto good = enough_views(config, kept.size()); !good) return fail(good.error());
  if (fit.views_dropped > 0) {
    found = solve(config, written, kept);
    if (!found) return fail(found.error());
  }
  fit.lens = found->lens;
  fit.views = static_cast<int>(kept.size());
  fit.rms_px = found->rms_px;
  fit.rms_before_px = rms_of(written, kept);
  fit.tilt_deg = tilt_between(found->R_CBoard);
  Vector2 low(1e9, 1e9), high(-1e9, -1e9);
  for (const BoardView* view : kept) {
    for (const Vector2& uv : view->uv) {
      low = low.cwiseMin(uv);
      high = high.cwiseMax(uv);
    }
  }
  fit.reach_u = (high.x() - low.x()) / written.width;
  fit.reach_v = (high.y() - low.y()) / written.height;

  Views in, out;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const bool held = i % static_cast<std::size_t>(config.hold_out) == 0;
    (held ? out : in).push_back(kept[i]);
  }
  const auto without = solve(config, written, in);
  if (!without) return fail(without.error());
  fit.rms_held_out_px = rms_of(without->lens, out);
  fit.views_held_out = static_cast<int>(out.size());
  // What the lens model leaves shows in the views it has not seen.
  const double grow = std::max(1.0, fit.rms_held_out_px / std::max(fit.rms_px, 1e-9));
  for (std::size_t i = 0; i < fit.sd.size(); ++i) fit.sd[i] = grow * found->sd[i];
  if (auto good = strong_enough(config, fit); !good) return fail(good.error());
  return fit;
}

}  // namespace alight
