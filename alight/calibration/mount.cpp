#include "alight/calibration/mount.h"

#include <Eigen/Dense>
#include <bit>
#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>

namespace alight {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kImageSdPx = 0.15;  // of an LED's mean image
constexpr double kMovesPx = 1;       // sd of its images, at rest
constexpr int kFewestPictures = 5;
constexpr int kSteps = 50;
constexpr double kDifference = 1e-6;
constexpr double kChi2PerView = 25;  // of six residuals

// Unknowns: mount (6, dp in N and dR in C), the body's own (6), x, y, yaw of each view.
constexpr int kOwn = 6, kViews = 12;

struct Off {
  double m = 0, deg = 0;
};

/// Where it stands, seen with this mount, against where it was placed.
Off off_of(const Pose& X_NC, const StandingView& view) {
  const Pose X_NK = X_NC * view.X_CK;
  return {(X_NK.translation() - view.X_NK.translation()).norm(),
          angle_between(X_NK.linear(), view.X_NK.linear()) / kDegree};
}

Off rms(const std::vector<Off>& all) {
  Off out;
  for (const Off& off : all) {
    out.m += off.m * off.m;
    out.deg += off.deg * off.deg;
  }
  const auto n = static_cast<double>(all.size());
  return {std::sqrt(out.m / n), std::sqrt(out.deg / n)};
}

Off rms_off(const Pose& X_NC, const std::vector<StandingView>& views) {
  std::vector<Off> all;
  for (const StandingView& view : views) all.push_back(off_of(X_NC, view));
  return rms(all);
}

class MountSolver {
 public:
  MountSolver(const MountConfig& config, const std::vector<StandingView>& views)
      : config_(config),
        views_(views),
        unknowns_(kViews + 3 * static_cast<int>(views.size())) {
    sd_ = VectorXd::Zero(unknowns_);
    sd_.segment<6>(kOwn) << config.own_place_sd_m, config.own_place_sd_m,
        config.height_sd_m, config.tilt_sd_deg * kDegree, config.tilt_sd_deg * kDegree,
        config.own_heading_sd_deg * kDegree;
    for (std::size_t k = 0; k < views.size(); ++k) {
      sd_.segment<3>(place(k)) << config.place_sd_m, config.place_sd_m,
          config.heading_sd_deg * kDegree;
      whiten_.push_back(views[k].cov.llt().matrixL().solve(Matrix6::Identity()));
    }
  }

  struct Answer {
    Pose X_NC;
    Matrix6 cov;  // of dp in N, dR in C
    double chi2 = 0;
  };

  std::optional<Answer> solve() const {
    // The first view decides where to begin.
    Pose base = views_[0].X_NK * views_[0].X_CK.inverse();
    VectorXd x = VectorXd::Zero(unknowns_);
    for (int step = 0; step < kSteps; ++step) {
      const VectorXd r = residual(base, x);
      MatrixXd J(r.size(), unknowns_);
      for (int i = 0; i < unknowns_; ++i) {
        VectorXd up = x, down = x;
        up(i) += kDifference;
        down(i) -= kDifference;
        J.col(i) = (residual(base, up) - residual(base, down)) / (2 * kDifference);
      }
      const MatrixXd A = J.transpose() * J;
      const Eigen::LDLT<MatrixXd> ldlt(A);
      const VectorXd d = ldlt.solve(-J.transpose() * r);
      if (!d.allFinite()) return std::nullopt;
      x += d;
      base = moved(base, x.head<6>());
      x.head<6>().setZero();
      if (d.norm() > 1e-9) continue;
      const MatrixXd cov = ldlt.solve(MatrixXd::Identity(unknowns_, unknowns_));
      return Answer{base, cov.topLeftCorner<6, 6>(), r.squaredNorm()};
    }
    return std::nullopt;
  }

 private:
  static int place(std::size_t k) { return kViews + 3 * static_cast<int>(k); }
  static Pose moved(const Pose& X, const Vector6& d) {
    return make_pose(orthonormalized(X.linear() * so3_exp(d.tail<3>())),
                     X.translation() + d.head<3>());
  }

  VectorXd residual(const Pose& base, const VectorXd& x) const {
    const auto n = static_cast<Eigen::Index>(views_.size());
    VectorXd r(6 * n + unknowns_ - 6);
    const Pose X_CN = moved(base, x.head<6>()).inverse();
    const Vector6 own = x.segment<6>(kOwn);
    for (std::size_t k = 0; k < views_.size(); ++k) {
      const StandingView& view = views_[k];
      const Vector3 at = x.segment<3>(place(k));
      // Placed: shifted and turned about z of N; then the body's own.
      const Pose X_NK = make_pose(
          from_rpy(0, 0, at.z()) * view.X_NK.linear() * so3_exp(own.tail<3>()),
          view.X_NK.translation() + Vector3(at.x(), at.y(), 0) +
              from_rpy(0, 0, at.z()) * view.X_NK.linear() * own.head<3>());
      const Pose X_CK = X_CN * X_NK;
      Vector6 e;
      e << X_CK.translation() - view.X_CK.translation(),
          so3_log(view.X_CK.linear().transpose() * X_CK.linear());
      r.segment<6>(6 * static_cast<Eigen::Index>(k)) = whiten_[k] * e;
    }
    r.tail(unknowns_ - 6) =
        x.tail(unknowns_ - 6).cwiseQuotient(sd_.tail(unknowns_ - 6));
    return r;
  }

  const MountConfig& config_;
  const std::vector<StandingView>& views_;
  int unknowns_;
  VectorXd sd_;
  std::vector<Matrix6> whiten_;
};

}  // namespace

MountConfig MountConfig::tag() {
  MountConfig config;
  config.place_sd_m = 0.002;
  config.heading_sd_deg = 1;
  config.height_sd_m = 0.001;
  config.tilt_sd_deg = 0.5;
  config.own_place_sd_m = 1e-5;
  config.own_heading_sd_deg = 1e-3;
  return config;
}

Vector3 mount_rpy_deg(const Pose& X_NC) {
  const Matrix3 R = housing_from_optical(X_NC).linear();
  return Vector3(std::atan2(R(2, 1), R(2, 2)),
                 -std::asin(std::clamp(R(2, 0), -1.0, 1.0)),
                 std::atan2(R(1, 0), R(0, 0))) /
         kDegree;
}

Result<StandingView> parked_view(const Rig& rig, std::span<const ObservedFrame> frames,
                                 double led_sd_m, double heading_deg) {
  FixedVector<LedObservation, kMaxLeds> seen;
  Camera lens = rig.camera;
  lens.X_NC = Pose::Identity();
  if (frames.empty()) return fail(Fault::too_few_points, "the drone is not seen");
  const Pose X_CB_0 = rig.camera.X_NC.inverse() * frames.back().X_NB;
  const double led_px =
      led_sd_m * lens.intrinsics.fx / std::max(X_CB_0.translation().norm(), 0.05);
  for (int i = 0; i < rig.leds.size(); ++i) {
    Vector2 sum = Vector2::Zero();
    double squares = 0;
    int count = 0;
    for (const ObservedFrame& frame : frames) {
      for (const LedObservation& o : frame.seen) {
        if (o.leds != (1u << i)) continue;
        sum += o.uv;
        squares += o.uv.squaredNorm();
        ++count;
      }
    }
    if (count < kFewestPictures) continue;
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << i);
    o.uv = sum / count;
    if (squares / count - o.uv.squaredNorm() > kMovesPx * kMovesPx) {
      return fail(Fault::degenerate,
                  "the drone moves; record it at rest on the pad, motors off");
    }
    o.cov = (kImageSdPx * kImageSdPx + led_px * led_px) * Matrix2::Identity();
    seen.push_back(o);
  }
  if (seen.size() < 4) {
    return fail(Fault::too_few_points,
                "fewer than four LEDs are seen apart in " +
                    std::to_string(kFewestPictures) +
                    " pictures; turn the drone's LEDs towards the camera");
  }
  const auto fit = solve_pnp(lens, rig.leds, {seen.data(), seen.size()}, &X_CB_0);
  if (!fit) return fail(fit.error().fault, "the LEDs give no pose of the parked drone");
  StandingView view;
  view.X_CK = fit->X_NB;
  view.cov = fit->cov;
  view.X_NK = make_pose(from_rpy(0, 0, heading_deg * kDegree),
                        Vector3(0, 0, rig.drone.gear_height_m));
  return view;
}

Result<MountFit> calibrate_mount(const MountConfig& config, const Pose& X_NC_written,
                                 const std::vector<StandingView>& views) {
  if (views.empty())
    return fail(Fault::too_few_points, "nothing stands in the picture");
  const auto answer = MountSolver(config, views).solve();
  if (!answer)
    return fail(Fault::no_convergence, "the views give no place of the camera");
  const auto n = static_cast<double>(views.size());
  if (answer->chi2 > kChi2PerView * n) {
    return fail(Fault::degenerate,
                "the views contradict each other or where things were placed: see "
                "whether the headings are right (about z of N, forward is 0) and the "
                "drone stood over the pad's centre");
  }
  MountFit fit;
  fit.X_NC = answer->X_NC;
  fit.position_sd_m = answer->cov.topLeftCorner<3, 3>().diagonal().cwiseSqrt();
  // Roll, pitch, yaw by small turns of the camera.
  Matrix3 J;
  for (int i = 0; i < 3; ++i) {
    Pose turned = fit.X_NC;
    turned.linear() = fit.X_NC.linear() * so3_exp(1e-6 * Vector3::Unit(i));
    const Vector3 d = mount_rpy_deg(turned) - mount_rpy_deg(fit.X_NC);
    for (int k = 0; k < 3; ++k) J(k, i) = wrap_angle(d[k] * kDegree) / kDegree / 1e-6;
  }
  const Matrix3 turn_cov = answer->cov.bottomRightCorner<3, 3>();
  fit.rpy_sd_deg = (J * turn_cov * J.transpose()).diagonal().cwiseSqrt();
  const Off before = rms_off(X_NC_written, views), after = rms_off(fit.X_NC, views);
  fit.off_before_m = before.m;
  fit.off_before_deg = before.deg;
  fit.off_m = after.m;
  fit.off_deg = after.deg;
  fit.off_held_out_m = fit.off_held_out_deg = std::numeric_limits<double>::quiet_NaN();
  if (views.size() > 1) {
    std::vector<Off> held_out;
    for (std::size_t k = 0; k < views.size(); ++k) {
      std::vector<StandingView> others = views;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
      const auto without = MountSolver(config, others).solve();
      if (without) held_out.push_back(off_of(without->X_NC, views[k]));
    }
    const Off off = rms(held_out);
    fit.off_held_out_m = off.m;
    fit.off_held_out_deg = off.deg;
  }
  if (fit.position_sd_m.maxCoeff() > config.position_sd_max_m ||
      std::sqrt(turn_cov.diagonal().maxCoeff()) >
          config.rotation_sd_max_deg * kDegree) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(1)
         << "the camera's place stays uncertain by up to "
         << 1e3 * fit.position_sd_m.maxCoeff() << " mm and "
         << std::sqrt(turn_cov.diagonal().maxCoeff()) / kDegree
         << " deg: measure the LEDs first (alight calibrate constellation), park the "
            "drone at several headings, or stand a larger tag upright";
    return fail(Fault::degenerate, text.str());
  }
  return fit;
}

}  // namespace alight
