#include "alight/vision/blob_pose.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "alight/geometry/small_solve.h"

namespace alight {
namespace {

constexpr double kImbalance = 0.15;  // sd of the weight one of two LEDs has too much

// A step that promises to take less than this share of the cost off is the last.
constexpr double kGain = 1e-4, kLeastGain = 1e-6;

struct Step {
  Pose X_CB;
  Matrix6 H;  // its lower half
  Vector6 g;
  double chi2_place = 0, chi2_stretch = 0, chi2_tilt = 0;
  double square = 0;

  double cost() const { return chi2_place + chi2_stretch + chi2_tilt; }
};

/// H += J' WJ, its lower half.
void add_square(const Matrix26& J, const Matrix26& WJ, Matrix6& H) {
  for (int c = 0; c < 6; ++c) {
    for (int r = c; r < 6; ++r) {
      H(r, c) += J(0, r) * WJ(0, c) + J(1, r) * WJ(1, c);
    }
  }
}

/// By (dp_CB, a turn in C about B's origin), where images have the shortest Jacobians.
class Problem {
 public:
  Problem(const Camera& camera, const Constellation& leds,
          std::span<const BlobTerm> terms, double tilt_sd)
      : lens_(camera.intrinsics),
        leds_(leds),
        terms_(terms),
        up_C_(camera.X_NC.linear().row(2)),
        tilt_weight_(1 / (tilt_sd * tilt_sd)) {
    for (const BlobTerm& term : terms) weights_.push_back(term.cov.inverse());
  }

  /// @returns false: an LED is not in view
  bool linearize(const Pose& X_CB, Step& out) const {
    out.X_CB = X_CB;
    out.H.setZero();
    out.g.setZero();
    out.chi2_place = out.chi2_stretch = out.square = 0;
    for (std::size_t t = 0; t < terms_.size(); ++t) {
      const std::uint16_t leds = terms_[t].leds;
      if (!std::has_single_bit(leds)) {
        if (!add_several(t, out)) return false;
        continue;
      }
      Vector2 uv;
      Matrix26 J;
      if (!image_of(std::countr_zero(leds), X_CB, uv, J)) return false;
      add_place(t, uv, J, out);
      out.chi2_stretch += stretch_weight(t) * terms_[t].stretch.squaredNorm();
    }
    add_tilt(out);
    return true;
  }

 private:
  double stretch_weight(std::size_t t) const {
    return 1 / (terms_[t].stretch_sd * terms_[t].stretch_sd);
  }

  bool image_of(int led, const Pose& X_CB, Vector2& uv, Matrix26& J) const {
    const Vector3 arm = X_CB.linear() * leds_.p_BL(led);
    Matrix23 D;
    const auto image = lens_.project(Vector3(X_CB.translation() + arm), D);
    if (!image) return false;
    uv = *image;
    J.leftCols<3>() = D;
    // D * -[arm]x, column by column.
    J.col(3) = D.col(2) * arm.y() - D.col(1) * arm.z();
    J.col(4) = D.col(0) * arm.z() - D.col(2) * arm.x();
    J.col(5) = D.col(1) * arm.x() - D.col(0) * arm.y();
    return true;
  }

  void add_place(std::size_t t, const Vector2& uv, const Matrix26& J, Step& out) const {
    const Vector2 r = terms_[t].uv - uv;
    const Matrix26 WJ = weights_[t] * J;
    add_square(J, WJ, out.H);
    out.g.noalias() += WJ.transpose() * r;
    out.chi2_place += r.dot(weights_[t] * r);
    out.square += r.squaredNorm();
  }

  /// Several LEDs in one blob: their middle, and how far apart they are.
  bool add_several(std::size_t t, Step& out) const {
    Vector2 uv[kMaxLeds];
    Matrix26 J[kMaxLeds];
    Vector2 mean = Vector2::Zero();
    Matrix26 J_mean = Matrix26::Zero();
    int n = 0;
    for (unsigned left = terms_[t].leds; left != 0; left &= left - 1) {
      if (!image_of(std::countr_zero(left), out.X_CB, uv[n], J[n])) return false;
      mean += uv[n];
      J_mean += J[n];
      ++n;
    }
    if (n == 0) return false;
    const double share = 1.0 / n;
    mean *= share;
    J_mean *= share;
    add_place(t, mean, J_mean, out);

    Vector2 stretch = Vector2::Zero();
    Matrix26 J_stretch = Matrix26::Zero();
    for (int k = 0; k < n; ++k) {
      const Vector2 d = uv[k] - mean;
      const Matrix26 J_d = J[k] - J_mean;
      stretch += share * Vector2(d.x() * d.x() - d.y() * d.y(), 2 * d.x() * d.y());
      J_stretch.row(0) += 2 * share * (d.x() * J_d.row(0) - d.y() * J_d.row(1));
      J_stretch.row(1) += 2 * share * (d.y() * J_d.row(0) + d.x() * J_d.row(1));
    }
    const double w = stretch_weight(t);
    const Vector2 q = terms_[t].stretch - stretch;
    out.chi2_stretch += w * q.squaredNorm();
    add_square(w * J_stretch, J_stretch, out.H);
    out.g.noalias() += w * J_stretch.transpose() * q;
    return true;
  }

  void add_tilt(Step& out) const {
    const double w = tilt_weight_;
    const Matrix3 R_BC = out.X_CB.linear().transpose();
    // Up as B sees it; by a turn d in B it changes by up x d.
    const Vector3 up = R_BC * up_C_;
    Eigen::Matrix<double, 2, 3> T;
    T << 0, -up.z(), up.y(), up.z(), 0, -up.x();
    const Eigen::Matrix<double, 2, 3> T_C = T * R_BC;
    out.H.bottomRightCorner<3, 3>().noalias() += w * T_C.transpose() * T_C;
    out.g.tail<3>().noalias() -= w * T_C.transpose() * up.head<2>();
    out.chi2_tilt = w * up.head<2>().squaredNorm() + (up.z() < 0 ? w : 0.0);
  }

  const Intrinsics& lens_;
  const Constellation& leds_;
  std::span<const BlobTerm> terms_;
  FixedVector<Matrix2, kMaxLeds> weights_;
  Vector3 up_C_;  // N's z axis
  double tilt_weight_;
};

/// Of (dp_NB, dR in B).
Matrix6 information_of(const Step& at, const Matrix3& R_CN) {
  const Matrix6 H = at.H.selfadjointView<Eigen::Lower>();
  const Matrix3& R_CB = at.X_CB.linear();
  Matrix6 out;
  out.topLeftCorner<3, 3>() = R_CN.transpose() * H.topLeftCorner<3, 3>() * R_CN;
  out.bottomLeftCorner<3, 3>() = R_CB.transpose() * H.bottomLeftCorner<3, 3>() * R_CN;
  out.topRightCorner<3, 3>() = out.bottomLeftCorner<3, 3>().transpose();
  out.bottomRightCorner<3, 3>() = R_CB.transpose() * H.bottomRightCorner<3, 3>() * R_CB;
  return out;
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
  const Problem problem(camera, leds, terms, tilt_sd);
  const Pose X_CN = camera.X_NC.inverse(Eigen::Isometry);
  Step at, next;
  if (!problem.linearize(X_CN * X_NB_0, at)) return std::nullopt;
  double damping = 1e-4;
  for (int k = 0; k < iterations_max; ++k) {
    Matrix6 H = at.H;
    H.diagonal() *= 1 + damping;
    const Vector6 d = solve_positive(H, at.g);
    if (!d.allFinite()) return std::nullopt;
    const Pose X_next = make_pose(so3_exp(d.tail<3>()) * at.X_CB.linear(),
                                  at.X_CB.translation() + d.head<3>());
    const double enough = kGain * at.cost() + kLeastGain;
    if (at.g.dot(d) <= enough) {
      at.X_CB = X_next;
      break;
    }
    if (problem.linearize(X_next, next) && next.cost() <= at.cost()) {
      const bool done = at.cost() - next.cost() <= enough;
      at = next;
      damping = std::max(damping / 10, 1e-9);
      if (done) break;
    } else {
      damping *= 30;
      if (damping > 1e6) break;
    }
  }
  BlobFit fit;
  fit.X_NB = camera.X_NC * at.X_CB;
  fit.X_NB.linear() = orthonormalized(fit.X_NB.linear());
  fit.information = information_of(at, X_CN.linear());
  fit.chi2_place = at.chi2_place;
  fit.chi2_stretch = at.chi2_stretch;
  fit.chi2_tilt = at.chi2_tilt;
  fit.rms_px = std::sqrt(at.square / static_cast<double>(terms.size()));
  return fit;
}

}  // namespace alight
