#include "alight/estimation/rest_model.h"

#include <Eigen/Cholesky>
#include <bit>
#include <cmath>

namespace alight {
namespace {

constexpr int kSteps = 40;
constexpr double kSmall = 1e-4;  // a step of so many sd moves nothing any more

}  // namespace

RestUnknowns standard_deviations(const RestCalibrationConfig& c, int leds) {
  RestUnknowns sd(kRestLeds + 3 * leds);
  sd.segment<3>(kRestPose) << c.place_sd_m, c.place_sd_m, c.height_sd_m;
  sd.segment<3>(kRestPose + 3)
      << Vector3(c.tilt_sd_deg, c.tilt_sd_deg, c.heading_sd_deg) * kDegree;
  sd.segment<3>(kRestMount).setConstant(c.mount_position_sd_m);
  sd.segment<3>(kRestMount + 3).setConstant(c.mount_rotation_sd_deg * kDegree);
  sd(kRestFocal) = c.focal_sd_share;
  sd.segment<2>(kRestPrincipal).setConstant(c.principal_sd_px);
  sd.tail(3 * leds).setConstant(c.led_sd_m);
  return sd;
}

Rest moved(const Rest& from, const RestUnknowns& x) {
  Rest to = from;
  to.X_NB.translation() += x.segment<3>(kRestPose);
  to.X_NB.linear() = from.X_NB.linear() * so3_exp(x.segment<3>(kRestPose + 3));
  to.camera.X_NC.translation() += x.segment<3>(kRestMount);
  to.camera.X_NC.linear() =
      from.camera.X_NC.linear() * so3_exp(x.segment<3>(kRestMount + 3));
  Intrinsics& lens = to.camera.intrinsics;
  lens.fx *= 1 + x(kRestFocal);
  lens.fy *= 1 + x(kRestFocal);
  lens.cx += x(kRestPrincipal);
  lens.cy += x(kRestPrincipal + 1);
  for (int i = 0; i < to.leds.size(); ++i) {
    to.leds.leds[static_cast<std::size_t>(i)].p_BL += x.segment<3>(kRestLeds + 3 * i);
  }
  return to;
}

std::optional<Vector2> rest_image(const Rest& rest, const RestUnknowns& x,
                                  std::uint16_t which, RestRow& J) {
  J.setZero(2, x.size());
  const Pose X_CN = rest.camera.X_NC.inverse();
  const Matrix3 R_CB = X_CN.linear() * rest.X_NB.linear();
  const Matrix3 turned_B = so3_right_jacobian(x.segment<3>(kRestPose + 3));
  const Matrix3 turned_C = so3_right_jacobian(x.segment<3>(kRestMount + 3));
  const Intrinsics& lens = rest.camera.intrinsics;
  const double share = 1.0 / std::popcount(which);
  Vector2 mean = Vector2::Zero();
  for (int i = 0; i < rest.leds.size(); ++i) {
    if (((which >> i) & 1) == 0) continue;
    const Vector3& p_BL = rest.leds.p_BL(i);
    const Vector3 p_CL = X_CN * (rest.X_NB * p_BL);
    Matrix23 by_p;
    const auto uv = lens.project(p_CL, by_p);
    if (!uv) return std::nullopt;
    mean += share * *uv;
    J.middleCols<3>(kRestPose) += share * by_p * X_CN.linear();
    J.middleCols<3>(kRestPose + 3) -= share * by_p * R_CB * hat(p_BL) * turned_B;
    J.middleCols<3>(kRestMount) -= share * by_p * X_CN.linear();
    J.middleCols<3>(kRestMount + 3) += share * by_p * hat(p_CL) * turned_C;
    J.col(kRestFocal) +=
        share * (*uv - Vector2(lens.cx, lens.cy)) / (1 + x(kRestFocal));
    J.middleCols<2>(kRestPrincipal) += share * Matrix2::Identity();
    J.middleCols<3>(kRestLeds + 3 * i) += share * by_p * R_CB;
  }
  return mean;
}

std::optional<RestMap> fit_rest(const Rest& start, std::span<const LedObservation> seen,
                                double pixel_sd_px, const RestUnknowns& sd) {
  const Eigen::Index n = sd.size();
  const double w = 1 / (pixel_sd_px * pixel_sd_px);
  RestMap best{RestUnknowns::Zero(n), 0, 0, {}};
  RestUnknowns s = RestUnknowns::Zero(n);
  double moved_by = 1;
  for (int step = 0; step <= kSteps; ++step) {
    best.x = s.cwiseProduct(sd);
    const Rest rest = moved(start, best.x);
    RestInformation A = RestInformation::Identity(n, n);
    RestUnknowns b = -s;
    double sum = 0;
    RestRow J;
    for (const LedObservation& o : seen) {
      const auto uv = rest_image(rest, best.x, o.leds, J);
      if (!uv) return std::nullopt;
      const Vector2 r = o.uv - *uv;
      J = (J.array().rowwise() * sd.transpose().array()).matrix().eval();
      A.noalias() += w * J.transpose().lazyProduct(J);
      b.noalias() += w * J.transpose().lazyProduct(r);
      sum += r.squaredNorm();
    }
    best.rms_px = std::sqrt(sum / static_cast<double>(seen.size()));
    best.chi2 = w * sum + s.squaredNorm();
    if (moved_by < kSmall) {
      best.A = A;
      return best;
    }
    const Eigen::LLT<Eigen::Ref<RestInformation>> llt(A);
    if (llt.info() != Eigen::Success) return std::nullopt;
    const RestUnknowns ds = llt.solve(b);
    if (!ds.allFinite()) return std::nullopt;
    s += ds;
    moved_by = ds.norm();
  }
  return std::nullopt;
}

}  // namespace alight
