#include "alight/peers/tag_pose.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace alight {

void pose_from_tag(const Rig& rig, const TagCorners& corners, double sd_px,
                   PeerReport& out) {
  const Intrinsics& lens = rig.camera.intrinsics;
  const double h = 0.5 * rig.tag->size_m;
  const Vector3 p_T[4] = {{-h, h, 0}, {h, h, 0}, {h, -h, 0}, {-h, -h, 0}};
  // On the plane z = 1, where our lens model has already taken the distortion out.
  std::vector<cv::Point3d> model;
  std::vector<cv::Point2d> image;
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector3 ray = lens.unproject(corners[i]);
    model.emplace_back(p_T[i].x(), p_T[i].y(), 0);
    image.emplace_back(ray.x(), ray.y());
  }
  std::vector<cv::Mat> rotations, translations;
  cv::solvePnPGeneric(model, image, cv::Matx33d::eye(), cv::noArray(), rotations,
                      translations, false, cv::SOLVEPNP_IPPE_SQUARE);
  double least = std::numeric_limits<double>::infinity();
  Pose X_CT;
  for (std::size_t k = 0; k < rotations.size(); ++k) {
    const cv::Vec3d w = rotations[k], p = translations[k];
    const Pose X =
        make_pose(so3_exp(Vector3(w[0], w[1], w[2])), Vector3(p[0], p[1], p[2]));
    if (!X.matrix().allFinite()) continue;
    double sum = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto uv = lens.project(X * p_T[i]);
      sum += uv ? (*uv - corners[i]).squaredNorm()
                : std::numeric_limits<double>::infinity();
    }
    if (sum < least) {
      least = sum;
      X_CT = X;
    }
  }
  if (!std::isfinite(least)) {
    out.why_not = "the tag's corners give no pose";
    return;
  }
  out.X_NB = rig.camera.X_NC * X_CT * rig.tag->X_BT.inverse();
  out.reprojection_px = std::sqrt(least / 4);
  Matrix6 H = Matrix6::Zero();
  for (const Vector3& p : p_T) {
    Matrix26 J;
    if (!project_led(rig.camera, out.X_NB, rig.tag->X_BT * p, &J)) continue;
    H += J.transpose() * J / (sd_px * sd_px);
  }
  out.cov = H.ldlt().solve(Matrix6::Identity());
  out.tracked = out.initialized = out.cov.allFinite();
  if (!out.tracked) out.why_not = "the tag's corners give no pose";
}

}  // namespace alight
