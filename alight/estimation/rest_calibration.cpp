#include "alight/estimation/rest_calibration.h"

#include <Eigen/Cholesky>
#include <bit>
#include <cmath>
#include <sstream>

namespace alight {
namespace {

// Unknowns, each in units of its own standard deviation: pose (6), mount (6), focal
// length (1), principal point (2), three for each LED.
constexpr int kPose = 0, kMount = 6, kFocal = 12, kPrincipal = 13, kLeds = 15;
constexpr int kMost = kLeds + 3 * kMaxLeds;
constexpr int kSteps = 40;
constexpr double kSmall = 1e-4;  // a step of so many sd moves nothing any more

using Unknowns = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;
using Information =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;
using Row2 = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMost>;

struct Rest {
  Pose X_NB;
  Camera camera;
  Constellation leds;
};

Unknowns standard_deviations(const RestCalibrationConfig& c, int leds) {
  Unknowns sd(kLeds + 3 * leds);
  sd.segment<3>(kPose) << c.place_sd_m, c.place_sd_m, c.height_sd_m;
  sd.segment<3>(kPose + 3) << Vector3(c.tilt_sd_deg, c.tilt_sd_deg, c.heading_sd_deg) *
                                  kDegree;
  sd.segment<3>(kMount).setConstant(c.mount_position_sd_m);
  sd.segment<3>(kMount + 3).setConstant(c.mount_rotation_sd_deg * kDegree);
  sd(kFocal) = c.focal_sd_share;
  sd.segment<2>(kPrincipal).setConstant(c.principal_sd_px);
  sd.tail(3 * leds).setConstant(c.led_sd_m);
  return sd;
}

/// The rig and pose that lie `x` away, in physical units, from what was expected.
Rest moved(const Rest& from, const Unknowns& x) {
  Rest to = from;
  to.X_NB.translation() += x.segment<3>(kPose);
  to.X_NB.linear() = from.X_NB.linear() * so3_exp(x.segment<3>(kPose + 3));
  to.camera.X_NC.translation() += x.segment<3>(kMount);
  to.camera.X_NC.linear() =
      from.camera.X_NC.linear() * so3_exp(x.segment<3>(kMount + 3));
  Intrinsics& lens = to.camera.intrinsics;
  lens.fx *= 1 + x(kFocal);
  lens.fy *= 1 + x(kFocal);
  lens.cx += x(kPrincipal);
  lens.cy += x(kPrincipal + 1);
  for (int i = 0; i < to.leds.size(); ++i) {
    to.leds.leds[static_cast<std::size_t>(i)].p_BL += x.segment<3>(kLeds + 3 * i);
  }
  return to;
}

/// Image of an observation's LEDs and its derivative by the unknowns at `rest`.
std::optional<Vector2> image_of(const Rest& rest, const Unknowns& x,
                                std::uint16_t which, Row2& J) {
  J.setZero(2, x.size());
  const Pose X_CN = rest.camera.X_NC.inverse();
  const Matrix3 R_CB = X_CN.linear() * rest.X_NB.linear();
  const Matrix3 turned_B = so3_right_jacobian(x.segment<3>(kPose + 3));
  const Matrix3 turned_C = so3_right_jacobian(x.segment<3>(kMount + 3));
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
    J.middleCols<3>(kPose) += share * by_p * X_CN.linear();
    J.middleCols<3>(kPose + 3) -= share * by_p * R_CB * hat(p_BL) * turned_B;
    J.middleCols<3>(kMount) -= share * by_p * X_CN.linear();
    J.middleCols<3>(kMount + 3) += share * by_p * hat(p_CL) * turned_C;
    J.col(kFocal) += share * (*uv - Vector2(lens.cx, lens.cy)) / (1 + x(kFocal));
    J.middleCols<2>(kPrincipal) += share * Matrix2::Identity();
    J.middleCols<3>(kLeds + 3 * i) += share * by_p * R_CB;
  }
  return mean;
}

struct Fit {
  Unknowns x;  // physical units
  double chi2 = 0;
  double rms_px = 0;
  Information A;  // in units of the standard deviations
};

std::optional<Fit> fit(const Rest& start, std::span<const LedObservation> seen,
                       double pixel_sd_px, const Unknowns& sd) {
  const Eigen::Index n = sd.size();
  const double w = 1 / (pixel_sd_px * pixel_sd_px);
  Fit best{Unknowns::Zero(n), 0, 0, {}};
  Unknowns s = Unknowns::Zero(n);
  double moved_by = 1;
  for (int step = 0; step <= kSteps; ++step) {
    best.x = s.cwiseProduct(sd);
    const Rest rest = moved(start, best.x);
    Information A = Information::Identity(n, n);
    Unknowns b = -s;
    double sum = 0;
    Row2 J;
    for (const LedObservation& o : seen) {
      const auto uv = image_of(rest, best.x, o.leds, J);
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
    const Eigen::LLT<Eigen::Ref<Information>> llt(A);
    if (llt.info() != Eigen::Success) return std::nullopt;
    const Unknowns ds = llt.solve(b);
    if (!ds.allFinite()) return std::nullopt;
    s += ds;
    moved_by = ds.norm();
  }
  return std::nullopt;
}

/// Marginal, whatever else is not known.
LedCovariance led_covariance(const Fit& fit, const Unknowns& sd) {
  const Eigen::Index n = sd.size() - kLeds;
  const Eigen::LLT<Information> llt(fit.A);
  Information columns(sd.size(), n);
  columns.setZero();
  columns.bottomRows(n).setIdentity();
  const Information cov = llt.solve(columns);
  return sd.tail(n).asDiagonal() * cov.bottomRows(n) * sd.tail(n).asDiagonal();
}

}  // namespace

Result<void> RestCalibrationConfig::validate() const {
  const struct {
    const char* field;
    double value;
  } positive[] = {{"led_sd_m", led_sd_m},
                  {"mount_position_sd_m", mount_position_sd_m},
                  {"mount_rotation_sd_deg", mount_rotation_sd_deg},
                  {"focal_sd_share", focal_sd_share},
                  {"principal_sd_px", principal_sd_px},
                  {"pixel_sd_px", pixel_sd_px},
                  {"place_sd_m", place_sd_m},
                  {"height_sd_m", height_sd_m},
                  {"tilt_sd_deg", tilt_sd_deg},
                  {"heading_sd_deg", heading_sd_deg},
                  {"chi2_max_per_led", chi2_max_per_led}};
  for (const auto& p : positive) {
    if (p.value > 0 && p.value < 1e3) continue;
    std::ostringstream detail;
    detail << "rest." << p.field << ": " << p.value << " is outside (0, 1000)";
    return fail(Fault::invalid_config, detail.str());
  }
  return {};
}

Result<RestFit> calibrate_at_rest(const RestCalibrationConfig& config,
                                  const Camera& camera, const Constellation& leds,
                                  std::span<const LedObservation> seen,
                                  const Pose& X_NB_rest) {
  if (seen.size() < 4) return fail(Fault::too_few_points);
  const unsigned known = (1u << leds.size()) - 1;
  for (const LedObservation& o : seen) {
    if (o.leds == 0 || (o.leds & ~known) != 0 || !o.uv.allFinite()) {
      return fail(Fault::too_few_points);
    }
  }
  const Rest start{X_NB_rest, camera, leds};
  const Unknowns sd = standard_deviations(config, leds.size());
  const auto found = fit(start, seen, config.pixel_sd_px, sd);
  if (!found) return fail(Fault::no_convergence);
  if (found->chi2 > config.chi2_max_per_led * static_cast<double>(seen.size())) {
    return fail(Fault::degenerate);
  }
  // The rig as written: only the pose may move.
  Unknowns pose_only = sd;
  pose_only.tail(sd.size() - kMount).setConstant(1e-9);
  const auto written = fit(start, seen, config.pixel_sd_px, pose_only);

  const Rest rest = moved(start, found->x);
  return RestFit{.camera = rest.camera,
                 .leds = rest.leds,
                 .led_cov = led_covariance(*found, sd),
                 .X_NB = rest.X_NB,
                 .rms_before_px = written ? written->rms_px : found->rms_px,
                 .rms_px = found->rms_px,
                 .chi2 = found->chi2};
}

}  // namespace alight
