#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/calib3d.hpp>

#include "alight/vision/led_finder_search.h"

namespace alight {
namespace {

/// Mean distance to the centroid.
template <class Points>
double mean_deviation(const Points& points) {
  Vector3 centre = Vector3::Zero();
  for (const Vector3& p : points) centre += p / static_cast<double>(points.size());
  double sum = 0;
  for (const Vector3& p : points) sum += (p - centre).norm();
  return sum / static_cast<double>(points.size());
}

}  // namespace

/// algo:RSE_INIT. Departures, each because the text leaves it open or it fails without:
/// the MAD difference is taken absolutely; each EPnP pose is refined before it is
/// compared (raw EPnP picks the wrong order in one case of ten at 2 m); a best order
/// worse than rms_max_px is none.
Result<FoundLeds> LedFinder::Search::find_paper(BlobSpan blobs, Time t) {
  const auto p = static_cast<std::size_t>(leds.size());
  if (blobs.size() != p || p > 8) return fail(Fault::too_few_points);

  // eqn:PCD and eqn:RSE_mad, when there is depth for all.
  FixedVector<Vector3, kMaxLeds> cloud, body;
  for (std::size_t i = 0; i < p; ++i) {
    body.push_back(leds.leds[i].p_BL);
    if (blobs[i].depth_m > 0) {
      cloud.push_back(blobs[i].depth_m * camera.intrinsics.unproject(blobs[i].uv));
    }
  }
  if (cloud.size() == p) {
    const double difference = mean_deviation(body) - mean_deviation(cloud);
    if (std::abs(difference) > config.mad_limit_m) return fail(Fault::degenerate);
  }

  const Intrinsics& lens = camera.intrinsics;
  const cv::Matx33d K(lens.fx, 0, lens.cx, 0, lens.fy, lens.cy, 0, 0, 1);
  const cv::Mat distortion(1, 5, CV_64F, const_cast<double*>(lens.distortion.data()));
  std::vector<cv::Point3d> model(p);
  std::vector<cv::Point2d> image(p);
  for (std::size_t i = 0; i < p; ++i) {
    const Vector3& p_BL = leds.leds[i].p_BL;
    model[i] = {p_BL.x(), p_BL.y(), p_BL.z()};
  }
  std::vector<int> order(p);
  std::iota(order.begin(), order.end(), 0);
  FoundLeds found;
  found.score = found.runner_up_score = std::numeric_limits<double>::infinity();
  do {
    bool hues = true;
    FixedVector<LedObservation, kMaxLeds> seen;
    for (std::size_t i = 0; i < p; ++i) {
      const Blob& blob = blobs[static_cast<std::size_t>(order[i])];
      hues = hues &&
             (!config.use_color || colors_agree(blob.color, leds.leds[i].color, false));
      image[i] = {blob.uv.x(), blob.uv.y()};
      LedObservation o;
      o.leds = static_cast<std::uint16_t>(1u << i);
      o.uv = blob.uv;
      o.cov = blob.cov;
      o.depth_m = blob.depth_m;
      seen.push_back(o);
    }
    if (!hues) continue;
    cv::Vec3d rotation, translation;
    if (!cv::solvePnP(model, image, K, distortion, rotation, translation, false,
                      cv::SOLVEPNP_EPNP)) {
      continue;
    }
    const Pose X_CB =
        make_pose(so3_exp(Vector3(rotation[0], rotation[1], rotation[2])),
                  Vector3(translation[0], translation[1], translation[2]));
    if (!X_CB.matrix().allFinite()) continue;
    auto fit = refine_pose(camera, leds, {seen.data(), seen.size()}, camera.X_NC * X_CB,
                           nullptr, 15);
    // A mirror image under the lens fits as well as the drone above it.
    if (!fit || !plausible(fit->X_NB)) continue;
    const double error = fit->rms_px * fit->rms_px * static_cast<double>(p);
    if (error < found.score) {
      found.runner_up_score = found.score;
      fit->X_NB_runner_up = found.fit.X_NB;
      fit->runner_up_rms_px = found.fit.rms_px > 0
                                  ? found.fit.rms_px
                                  : std::numeric_limits<double>::infinity();
      found.score = error;
      found.fit = *fit;
      found.frame.seen = seen;
    } else if (error < found.runner_up_score) {
      found.runner_up_score = error;
      found.fit.X_NB_runner_up = fit->X_NB;
      found.fit.runner_up_rms_px = fit->rms_px;
    }
  } while (std::next_permutation(order.begin(), order.end()));
  if (!std::isfinite(found.score) || found.fit.rms_px > config.rms_max_px) {
    return fail(Fault::too_few_points);
  }
  found.frame.t = t;
  return found;
}

}  // namespace alight
