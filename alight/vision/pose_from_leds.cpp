#include "alight/vision/pose_from_leds.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alight/geometry/small_solve.h"

namespace alight {
namespace {

struct Normal {
  Matrix6 H = Matrix6::Zero();
  Vector6 g = Vector6::Zero();
  double chi2 = 0;  ///< Of the observations alone.
  double cost = 0;  ///< With the prior.
  double square = 0;
};

Vector6 pose_difference(const Pose& X, const Pose& X_0) {
  Vector6 d;
  d.head<3>() = X.translation() - X_0.translation();
  d.tail<3>() = so3_log(X_0.linear().transpose() * X.linear());
  return d;
}

Pose moved(const Pose& X, const Vector6& d) {
  return make_pose(X.linear() * so3_exp(d.tail<3>()), X.translation() + d.head<3>());
}

/// False when an LED would lie behind the lens.
bool linearize(const Camera& camera, const Constellation& leds, ObservationSpan seen,
               const Pose& X_NB, const Pose& X_NB_0, const Matrix6* prior,
               Normal& out) {
  out = Normal();
  for (const LedObservation& o : seen) {
    Matrix26 J;
    const auto uv = project_observation(camera, X_NB, leds, o.leds, &J);
    if (!uv) return false;
    const Vector2 r = o.uv - *uv;
    const Matrix2 W = o.cov.inverse();
    const Matrix26 WJ = W * J;
    out.H.noalias() += J.transpose() * WJ;
    out.g.noalias() += WJ.transpose() * r;
    out.chi2 += r.dot(W * r);
    out.square += r.squaredNorm();
  }
  out.cost = out.chi2;
  if (prior != nullptr) {
    const Vector6 d = pose_difference(X_NB, X_NB_0);
    Matrix6 A = Matrix6::Identity();
    A.bottomRightCorner<3, 3>() = so3_right_jacobian_inverse(d.tail<3>());
    const Matrix6 AtP = A.transpose() * *prior;
    out.H.noalias() += AtP * A;
    out.g.noalias() -= AtP * d;
    out.cost += d.dot(*prior * d);
  }
  return true;
}

bool same_pose(const Pose& a, const Pose& b) {
  return angle_between(a.linear(), b.linear()) < 3 * kDegree &&
         (a.translation() - b.translation()).norm() < 0.02;
}

Vector3 middle(const Constellation& leds, std::uint16_t which) {
  Vector3 sum = Vector3::Zero();
  int count = 0;
  for (int i = 0; i < leds.size(); ++i) {
    if (((which >> i) & 1) == 0) continue;
    sum += leds.p_BL(i);
    ++count;
  }
  return sum / std::max(count, 1);
}

}  // namespace

Result<PoseFit> refine_pose(const Camera& camera, const Constellation& leds,
                            ObservationSpan seen, const Pose& X_NB_0,
                            const Matrix6* prior_information, int iterations_max) {
  if (seen.size() < 3 && prior_information == nullptr) {
    return fail(Fault::too_few_points);
  }
  PoseFit fit;
  fit.X_NB = X_NB_0;
  Normal at, next;
  if (!linearize(camera, leds, seen, X_NB_0, X_NB_0, prior_information, at)) {
    return fail(Fault::degenerate);
  }
  double damping = 1e-6;
  bool converged = false;
  for (int k = 0; k < iterations_max && !converged; ++k) {
    Matrix6 H = at.H;
    H.diagonal() *= 1 + damping;
    const Vector6 d = solve_positive(H, at.g);
    if (!d.allFinite()) return fail(Fault::degenerate);
    const Pose X_next = moved(fit.X_NB, d);
    if (linearize(camera, leds, seen, X_next, X_NB_0, prior_information, next) &&
        next.cost <= at.cost) {
      converged = at.cost - next.cost <= 1e-9 * at.cost + 1e-18 || d.norm() < 1e-11;
      fit.X_NB = X_next;
      at = next;
      damping = std::max(damping / 10, 1e-12);
    } else {
      converged = d.norm() < 1e-9;
      damping = std::max(damping * 30, 1e-4);
      if (damping > 1e8) break;
    }
  }
  const auto ldlt = at.H.ldlt();
  const double largest = ldlt.vectorD().maxCoeff();
  if (!(ldlt.vectorD().minCoeff() > 1e-10 * largest)) return fail(Fault::degenerate);
  if (!converged && iterations_max >= 20) return fail(Fault::no_convergence);
  fit.X_NB.linear() = orthonormalized(fit.X_NB.linear());
  fit.cov = inverse_of(ldlt);
  fit.chi2 = at.chi2;
  fit.rms_px =
      seen.empty() ? 0 : std::sqrt(at.square / static_cast<double>(seen.size()));
  return fit;
}

ThreePointPoses three_point_poses(const Intrinsics& lens, const Vector3 p_BL[3],
                                  const Vector2 uv[3]) {
  ThreePointPoses out;
  const Vector3 rays[3] = {lens.unproject(uv[0]), lens.unproject(uv[1]),
                           lens.unproject(uv[2])};
  // V: the camera turned so that its axis runs through the three.
  const Vector3 z = (rays[0] + rays[1] + rays[2]).normalized();
  const Vector3 x = Vector3::UnitY().cross(z).normalized();
  Matrix3 R_VC;
  R_VC << x.transpose(), z.cross(x).transpose(), z.transpose();
  Vector2 q[3];
  for (int i = 0; i < 3; ++i) {
    const Vector3 ray = R_VC * rays[i];
    q[i] = ray.head<2>() / ray.z();
  }
  const Vector3 a = p_BL[1] - p_BL[0], b = p_BL[2] - p_BL[0];
  const Vector2 e = q[1] - q[0], f = q[2] - q[0];
  // Heights h, k of the two LEDs over the first complete the images to the sides of the
  // triangle, scaled by s: s2 a'a = e'e + h2, s2 b'b = f'f + k2, s2 a'b = e'f + h k.
  const double aa = a.squaredNorm(), bb = b.squaredNorm(), ab = a.dot(b);
  const double ee = e.squaredNorm(), ff = f.squaredNorm(), ef = e.dot(f);
  const double A = aa * bb - ab * ab;
  if (A < 1e-4 * aa * bb) return out;
  const double B = aa * ff + bb * ee - 2 * ab * ef;
  const double C = ee * ff - ef * ef;
  const double s2 = (B + std::sqrt(std::max(B * B - 4 * A * C, 0.0))) / (2 * A);
  if (!(s2 > 1e-12)) return out;
  const double h = std::sqrt(std::max(s2 * aa - ee, 0.0));
  double k = std::sqrt(std::max(s2 * bb - ff, 0.0));
  if (s2 * ab - ef < 0) k = -k;
  const double depth = 1 / std::sqrt(s2);

  Matrix3 M_B;
  M_B << a, b, a.cross(b);
  const Matrix3 M_B_inverse = M_B.inverse();
  const Vector3 centre_V =
      depth * Vector3((q[0] + q[1] + q[2]).x() / 3, (q[0] + q[1] + q[2]).y() / 3, 1);
  const Vector3 centre_B = (p_BL[0] + p_BL[1] + p_BL[2]) / 3;
  for (const double sign : {1.0, -1.0}) {
    const Vector3 a_V = depth * Vector3(e.x(), e.y(), sign * h);
    const Vector3 b_V = depth * Vector3(f.x(), f.y(), sign * k);
    Matrix3 M_V;
    M_V << a_V, b_V, a_V.cross(b_V);
    const Matrix3 R_VB = M_V * M_B_inverse;
    const Matrix3 R_CB = R_VC.transpose() * R_VB;
    out.X_CB[out.count++] =
        make_pose(R_CB, R_VC.transpose() * centre_V - R_CB * centre_B);
  }
  return out;
}

Result<PoseFit> solve_pnp(const Camera& camera, const Constellation& leds,
                          ObservationSpan seen, const Pose* X_NB_prior) {
  if (seen.size() < 4 || seen.size() > kMaxLeds) return fail(Fault::too_few_points);
  Result<PoseFit> best = fail(Fault::degenerate);
  const auto offer = [&](const Pose& X_NB_0) {
    auto fit = refine_pose(camera, leds, seen, X_NB_0, nullptr, 30);
    if (!fit) return;
    if (!best || fit->chi2 < best->chi2) {
      if (best && !same_pose(best->X_NB, fit->X_NB)) {
        fit->X_NB_runner_up = best->X_NB;
        fit->runner_up_rms_px = best->rms_px;
      } else if (best) {
        fit->X_NB_runner_up = best->X_NB_runner_up;
        fit->runner_up_rms_px = best->runner_up_rms_px;
      }
      best = std::move(fit);
    } else if (!same_pose(best->X_NB, fit->X_NB) &&
               fit->rms_px < best->runner_up_rms_px) {
      best->X_NB_runner_up = fit->X_NB;
      best->runner_up_rms_px = fit->rms_px;
    }
  };
  if (X_NB_prior != nullptr) {
    offer(*X_NB_prior);
    return best;
  }
  // The widest triangles in the body carry the least error.
  struct Triple {
    double area;
    std::size_t i, j, k;
  };
  FixedVector<Triple, 4> widest;
  Vector3 p_BL[kMaxLeds];
  for (std::size_t i = 0; i < seen.size(); ++i) p_BL[i] = middle(leds, seen[i].leds);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t j = i + 1; j < seen.size(); ++j) {
      for (std::size_t k = j + 1; k < seen.size(); ++k) {
        const double area = (p_BL[j] - p_BL[i]).cross(p_BL[k] - p_BL[i]).norm();
        if (widest.full()) {
          if (area <= widest.back().area) continue;
          widest.back() = {area, i, j, k};
        } else {
          widest.push_back({area, i, j, k});
        }
        for (std::size_t n = widest.size() - 1; n > 0; --n) {
          if (widest[n].area > widest[n - 1].area) std::swap(widest[n], widest[n - 1]);
        }
      }
    }
  }
  for (const Triple& t : widest) {
    const Vector3 p[3] = {p_BL[t.i], p_BL[t.j], p_BL[t.k]};
    const Vector2 uv[3] = {seen[t.i].uv, seen[t.j].uv, seen[t.k].uv};
    const ThreePointPoses start = three_point_poses(camera.intrinsics, p, uv);
    for (int i = 0; i < start.count; ++i) offer(camera.X_NC * start.X_CB[i]);
  }
  return best;
}

}  // namespace alight
