#include "alight/vision/blob_pose.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "alight/geometry/small_solve.h"

namespace alight {
namespace {

constexpr double kImbalance = 0.15;  // sd of the weight one of two LEDs has too much

struct Step {
  Matrix6 H;  // its lower half
  Vector6 g;
  BlobFit fit;
  double square = 0;
};

/// H += J' WJ, its lower half.
void add_square(const Matrix26& J, const Matrix26& WJ, Matrix6& H) {
  for (int c = 0; c < 6; ++c) {
    for (int r = c; r < 6; ++r) {
      H(r, c) += J(0, r) * WJ(0, c) + J(1, r) * WJ(1, c);
    }
  }
}

bool linearize(const Camera& camera, const Constellation& leds,
               std::span<const BlobTerm> terms, double tilt_sd, const Pose& X_NB,
               Step& out) {
  out.H.setZero();
  out.g.setZero();
  out.fit = BlobFit();
  out.fit.X_NB = X_NB;
  out.square = 0;
  const Matrix3 R_CN = camera.X_NC.linear().transpose();
  const Matrix3 R_CB = R_CN * X_NB.linear();
  const Vector3 p_CB = R_CN * (X_NB.translation() - camera.X_NC.translation());
  const auto image_of = [&](const Vector3& p, Vector2& uv, Matrix26& J) {
    Matrix23 D;
    const auto image = camera.intrinsics.project(Vector3(p_CB + R_CB * p), D);
    if (!image) return false;
    uv = *image;
    J.leftCols<3>().noalias() = D * R_CN;
    const Matrix23 DR = D * R_CB;
    // DR * -[p]x, column by column.
    J.col(3) = DR.col(2) * p.y() - DR.col(1) * p.z();
    J.col(4) = DR.col(0) * p.z() - DR.col(2) * p.x();
    J.col(5) = DR.col(1) * p.x() - DR.col(0) * p.y();
    return true;
  };
  for (const BlobTerm& term : terms) {
    Vector2 uv[kMaxLeds];
    Matrix26 J[kMaxLeds];
    Vector2 mean = Vector2::Zero();
    Matrix26 J_mean = Matrix26::Zero();
    int n = 0;
    double share = 1;
    if (std::has_single_bit(term.leds)) {  // as most have
      if (!image_of(leds.p_BL(std::countr_zero(term.leds)), mean, J_mean)) return false;
      n = 1;
    } else {
      for (int i = 0; i < leds.size(); ++i) {
        if (((term.leds >> i) & 1) == 0) continue;
        if (!image_of(leds.p_BL(i), uv[n], J[n])) return false;
        mean += uv[n];
        J_mean += J[n];
        ++n;
      }
      if (n == 0) return false;
      share = 1.0 / n;
      mean *= share;
      J_mean *= share;
    }
    const Vector2 r = term.uv - mean;
    const Matrix2 W = term.cov.inverse();
    const Matrix26 WJ = W * J_mean;
    add_square(J_mean, WJ, out.H);
    out.g.noalias() += WJ.transpose() * r;
    out.fit.chi2_place += r.dot(W * r);
    out.square += r.squaredNorm();

    const double w = 1 / (term.stretch_sd * term.stretch_sd);
    if (n == 1) {
      out.fit.chi2_stretch += w * term.stretch.squaredNorm();
      continue;
    }
    Vector2 stretch = Vector2::Zero();
    Matrix26 J_stretch = Matrix26::Zero();
    for (int k = 0; k < n; ++k) {
      const Vector2 d = uv[k] - mean;
      const Matrix26 J_d = J[k] - J_mean;
      stretch += share * Vector2(d.x() * d.x() - d.y() * d.y(), 2 * d.x() * d.y());
      J_stretch.row(0) += 2 * share * (d.x() * J_d.row(0) - d.y() * J_d.row(1));
      J_stretch.row(1) += 2 * share * (d.y() * J_d.row(0) + d.x() * J_d.row(1));
    }
    const Vector2 q = term.stretch - stretch;
    out.fit.chi2_stretch += w * q.squaredNorm();
    add_square(w * J_stretch, J_stretch, out.H);
    out.g.noalias() += w * J_stretch.transpose() * q;
  }
  // Up as B sees it; by a turn d in B it changes by up x d.
  const Vector3 up = X_NB.linear().row(2).transpose();
  const double w = 1 / (tilt_sd * tilt_sd);
  Eigen::Matrix<double, 2, 3> T;
  T << 0, -up.z(), up.y(), up.z(), 0, -up.x();
  out.H.bottomRightCorner<3, 3>().noalias() += w * T.transpose() * T;
  out.g.tail<3>().noalias() -= w * T.transpose() * up.head<2>();
  out.fit.chi2_tilt = w * up.head<2>().squaredNorm() + (up.z() < 0 ? w : 0.0);
  return true;
}

}  // namespace

FixedVector<BlobTerm, kMaxLeds> blob_terms(const Assignment& assignment,
                                           const LedImages& images, BlobSpan blobs,
                                           double sd_px) {
  FixedVector<BlobTerm, kMaxLeds> terms;
  // Six LEDs in four blobs or more: at least two show one LED. The second least
  // stretched tells the blur, as the least may be a small one that shows none.
  Vector2 blur = Vector2::Zero(), blur_least = Vector2::Zero();
  double least = 1e9, second = 1e9;
  for (const LedObservation& o : observations(assignment, images, blobs, kImbalance)) {
    const auto first = static_cast<std::size_t>(__builtin_ctz(o.leds));
    const Blob& blob = blobs[static_cast<std::size_t>(assignment.blob[first])];
    BlobTerm term;
    term.leds = o.leds;
    term.uv = o.uv;
    term.stretch = stretch_of(blob.spread);
    const double length = term.stretch.norm();
    if (length < least) {
      second = least;
      blur = blur_least;
      least = length;
      blur_least = term.stretch;
    } else if (length < second) {
      second = length;
      blur = term.stretch;
    }
    const int n = __builtin_popcount(o.leds);
    term.cov = o.cov + sd_px * sd_px / n * Matrix2::Identity();
    Vector2 mean = Vector2::Zero();
    Matrix2 S = Matrix2::Zero();
    for (std::size_t k = 0; n > 1 && k < kMaxLeds; ++k) {
      if (((o.leds >> k) & 1) == 0) continue;
      mean += images.uv[k] / n;
      S += images.uv[k] * images.uv[k].transpose() / n;
    }
    const double expected = n > 1 ? stretch_of(S - mean * mean.transpose()).norm() : 0;
    term.stretch_sd = stretch_sd(blob, expected, sd_px);
    terms.push_back(term);
  }
  for (BlobTerm& term : terms) term.stretch -= blur;
  return terms;
}

std::optional<BlobFit> fit_blobs(const Camera& camera, const Constellation& leds,
                                 std::span<const BlobTerm> terms, double tilt_sd,
                                 const Pose& X_NB_0, int iterations_max) {
  Step at, next;
  if (!linearize(camera, leds, terms, tilt_sd, X_NB_0, at)) return std::nullopt;
  double damping = 1e-4;
  for (int k = 0; k < iterations_max; ++k) {
    Matrix6 H = at.H;
    H.diagonal() *= 1 + damping;
    const Vector6 d = solve_positive(H, at.g);
    if (!d.allFinite()) return std::nullopt;
    const Pose X_next = make_pose(at.fit.X_NB.linear() * so3_exp(d.tail<3>()),
                                  at.fit.X_NB.translation() + d.head<3>());
    if (linearize(camera, leds, terms, tilt_sd, X_next, next) &&
        next.fit.cost() <= at.fit.cost()) {
      const bool done = at.fit.cost() - next.fit.cost() <= 1e-4 * at.fit.cost() + 1e-6;
      at = next;
      damping = std::max(damping / 10, 1e-9);
      if (done) break;
    } else {
      damping *= 30;
      if (damping > 1e6) break;
    }
  }
  at.fit.X_NB.linear() = orthonormalized(at.fit.X_NB.linear());
  at.fit.information = at.H.selfadjointView<Eigen::Lower>();
  at.fit.rms_px = std::sqrt(at.square / static_cast<double>(terms.size()));
  return at.fit;
}

}  // namespace alight
