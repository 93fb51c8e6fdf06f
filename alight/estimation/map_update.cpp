#include "alight/estimation/map_update.h"

#include <Eigen/Cholesky>
#include <array>
#include <bit>
#include <cmath>

#include "alight/estimation/huber.h"
#include "alight/geometry/small_solve.h"

namespace alight {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix63 = Eigen::Matrix<double, 6, 3>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// The picture linearized at one state: normal equations of the pose.
struct Linearized {
  Matrix6 M = Matrix6::Zero();  ///< sum of H' R^-1 H
  Vector6 b = Vector6::Zero();  ///< sum of H' R^-1 r
  double cost = 0;
  /// H' R^-1 H_p of each image, for the response to displaced LEDs.
  std::array<Matrix63, kMaxLeds> pull;
};

/// Huber's loss (Huber 1964) of the squared normalized residual: cost and weight.
double robust_weight(double s, double limit, double& cost) {
  const double weight = huber_weight(s, limit);
  cost += weight == 1 ? s : 2 * limit * std::sqrt(s) - limit * limit;
  return weight;
}

/// Adds a measurement of K images; `pull` is that of its first.
template <int K>
bool add(const Camera& camera, const Constellation& leds, const PictureMeasurement& m,
         double huber_sd, const Pose& X_NB, Linearized& out, Matrix63* pull) {
  Eigen::Matrix<double, 2 * K, 6> H;
  Eigen::Matrix<double, 2 * K, 1> r;
  for (int k = 0; k < K; ++k) {
    const MeasuredImage& image = m.images[static_cast<std::size_t>(k)];
    Matrix26 H_k;
    const auto uv = project_observation(camera, X_NB, leds, image.leds, &H_k);
    if (!uv) return false;
    r.template segment<2>(2 * k) = image.uv - *uv;
    H.template middleRows<2>(2 * k) = H_k;
  }
  const Eigen::Matrix<double, 2 * K, 2 * K> W =
      m.information.template topLeftCorner<2 * K, 2 * K>();
  const double weight = robust_weight(r.dot(W * r), huber_sd * m.slack, out.cost);
  const Eigen::Matrix<double, 6, 2 * K> HtW = weight * H.transpose() * W;
  out.M.noalias() += HtW * H;
  out.b.noalias() += HtW * r;
  for (int k = 0; k < K; ++k) {
    const MeasuredImage& image = m.images[static_cast<std::size_t>(k)];
    pull[k].noalias() =
        HtW.template middleCols<2>(2 * k) * H.template block<2, 3>(2 * k, 0);
    if (!(image.depth_variance > 0)) continue;
    Eigen::Matrix<double, 1, 6> H_z;
    const double r_z =
        image.depth_m - predicted_depth(camera, X_NB, leds, image.leds, &H_z);
    const double w_z =
        robust_weight(r_z * r_z / image.depth_variance, huber_sd, out.cost) /
        image.depth_variance;
    out.M.noalias() += w_z * H_z.transpose() * H_z;
    out.b.noalias() += w_z * r_z * H_z.transpose();
  }
  return true;
}

bool linearize(const Camera& camera, const Constellation& leds,
               const PictureMeasurements& measurements, double huber_sd,
               const Pose& X_NB, Linearized& out) {
  static_assert(kMaxGroup == 4);
  out.M.setZero();
  out.b.setZero();
  out.cost = 0;
  Matrix63* pull = out.pull.data();
  for (const PictureMeasurement& m : measurements) {
    bool ahead = false;
    switch (m.images.size()) {
      case 1:
        ahead = add<1>(camera, leds, m, huber_sd, X_NB, out, pull);
        break;
      case 2:
        ahead = add<2>(camera, leds, m, huber_sd, X_NB, out, pull);
        break;
      case 3:
        ahead = add<3>(camera, leds, m, huber_sd, X_NB, out, pull);
        break;
      default:
        ahead = add<4>(camera, leds, m, huber_sd, X_NB, out, pull);
    }
    if (!ahead) return false;
    pull += m.images.size();
  }
  return std::isfinite(out.cost);
}

/// The update with the first N (6 or 9) components of the tangent measured.
template <int N>
Result<MapUpdate> solve(const Camera& camera, const Constellation& leds,
                        const PictureMeasurements& measurements,
                        const MapUpdateOptions& options, MotionState& state,
                        Matrix15& P, LedBias* bias) {
  using MatrixN = Eigen::Matrix<double, N, N>;
  using VectorN = Eigen::Matrix<double, N, 1>;
  constexpr int kRest = 15 - N;
  using MatrixRestN = Eigen::Matrix<double, kRest, N>;

  const MatrixN P_prior = P.topLeftCorner<N, N>();
  const Eigen::LLT<MatrixN> P_llt(P_prior);
  if (P_llt.info() != Eigen::Success) return fail(Fault::no_convergence);
  const MatrixN P_inverse = inverse_of(P_llt);

  const RelativeState prior = state.x;
  RelativeState x = prior;     // where the picture is linearized
  RelativeState accepted = x;  // last x that lowered the cost
  VectorN step = VectorN::Zero();
  VectorN e = VectorN::Zero();      // x [-] prior
  MatrixN J = MatrixN::Identity();  // its derivative
  MatrixN M = MatrixN::Zero();      // information of the measurements
  Eigen::LLT<MatrixN> A;            // of the posterior
  Linearized picture;
  double cost = 0;
  MapUpdate done;
  int halvings = 0;

  for (bool first = true;;) {
    Vector9 offset = boxminus(x, prior);
    const bool ahead =
        linearize(camera, leds, measurements, options.huber_sd, x.X_NB(), picture);
    double new_cost = picture.cost + offset.head<N>().dot(P_inverse * offset.head<N>());
    const Vector3 r_v = options.v_NB - x.v_NB;
    if constexpr (N == 9) new_cost += r_v.squaredNorm() / options.velocity_variance;
    if (first && !ahead) return fail(Fault::no_convergence);
    // The cost is known to about its own rounding.
    if (!first && !(ahead && new_cost <= cost * (1 + 1e-9) + 1e-9)) {
      if (++halvings > 8) {
        if (done.iterations < 2) return fail(Fault::no_convergence);
        x = accepted;  // as low as rounding lets the cost be told
        break;
      }
      step *= 0.5;
      Vector9 shorter = Vector9::Zero();
      shorter.head<N>() = step;
      x = boxplus(accepted, shorter);
      continue;
    }
    first = false;
    halvings = 0;
    cost = new_cost;
    accepted = x;
    e = offset.head<N>();
    J.template block<3, 3>(3, 3) = so3_right_jacobian_inverse(e.template segment<3>(3));
    M.setZero();
    M.template topLeftCorner<6, 6>() = picture.M;
    const VectorN pull = P_inverse * e;
    VectorN g = -J.transpose() * pull;
    g.template head<6>() += picture.b;
    if constexpr (N == 9) {
      M.template bottomRightCorner<3, 3>().diagonal().array() +=
          1 / options.velocity_variance;
      g.template tail<3>() += r_v / options.velocity_variance;
    }
    A.compute(J.transpose() * P_inverse * J + M);
    if (A.info() != Eigen::Success) return fail(Fault::no_convergence);
    step = A.solve(g);
    if (!step.allFinite()) return fail(Fault::no_convergence);
    ++done.iterations;
    done.converged = step.norm() < options.tolerance;
    Vector9 full = Vector9::Zero();
    full.head<N>() = step;
    x = boxplus(accepted, full);
    if (done.converged || done.iterations >= options.max_iterations) break;
  }
  e = boxminus(x, prior).head<N>();
  done.moved = e.dot(P_inverse * e);
  J.template block<3, 3>(3, 3) = so3_right_jacobian_inverse(e.template segment<3>(3));

  // The rest follows by regression on what was measured.
  const MatrixRestN G = P.bottomLeftCorner<kRest, N>() * P_inverse;
  const MatrixRestN GJ = G * J;
  Vector15 change = Vector15::Zero();
  change.tail<kRest>() = G * e;
  state.x = x;
  state = boxplus(state, change);

  // Joseph's form, K H = A^-1 M and K R K' = A^-1 M A^-1. The prior is carried to the
  // tangent at the solution.
  const MatrixN A_inverse = inverse_of(A);
  const MatrixN KH = A_inverse * M;
  MatrixN J_inverse = MatrixN::Identity();
  J_inverse.template block<3, 3>(3, 3) = so3_right_jacobian(e.template segment<3>(3));
  const MatrixN I_KH = (MatrixN::Identity() - KH) * J_inverse;
  MatrixN C = I_KH * P_prior * I_KH.transpose() + KH * A_inverse;
  C = 0.5 * (C + C.transpose()).eval();
  const MatrixN e_C = J * C * J.transpose() - P_prior;
  P.topLeftCorner<N, N>() = C;
  P.bottomLeftCorner<kRest, N>() = GJ * C;
  P.topRightCorner<N, kRest>() = P.bottomLeftCorner<kRest, N>().transpose();
  Eigen::Matrix<double, kRest, kRest> rest =
      P.bottomRightCorner<kRest, kRest>() + (G * e_C).lazyProduct(G.transpose());
  P.bottomRightCorner<kRest, kRest>() = 0.5 * (rest + rest.transpose());

  if (bias != nullptr) {
    const int columns = 3 * leds.size();
    Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 3 * kMaxLeds> T(6, columns);
    T.setZero();
    const Matrix63* pull = picture.pull.data();
    for (const PictureMeasurement& m : measurements) {
      for (const MeasuredImage& image : m.images) {
        const Matrix63 share = *pull++ * x.R_NB / std::popcount(image.leds);
        for (int k = 0; k < leds.size(); ++k) {
          if ((image.leds >> k) & 1) T.middleCols<3>(3 * k) += share;
        }
      }
    }
    T.noalias() -= picture.M.lazyProduct(bias->topRows<6>());
    Eigen::Matrix<double, N, Eigen::Dynamic, 0, N, 3 * kMaxLeds> change_N(N, columns);
    change_N.noalias() = A_inverse.template leftCols<6>().lazyProduct(T);
    if constexpr (N == 9) {
      change_N.noalias() -= A_inverse.template rightCols<3>() *
                            (bias->middleRows<3>(6) / options.velocity_variance);
    }
    bias->bottomRows<kRest>().noalias() += GJ.lazyProduct(change_N);
    bias->topRows<N>() += change_N;
  }
  return done;
}

}  // namespace

double predicted_depth(const Camera& camera, const Pose& X_NB,
                       const Constellation& leds, std::uint16_t which,
                       Eigen::Matrix<double, 1, 6>* J) {
  Vector3 p_BL = Vector3::Zero();
  int count = 0;
  for (int i = 0; i < leds.size(); ++i) {
    if (((which >> i) & 1) == 0) continue;
    p_BL += leds.p_BL(i);
    ++count;
  }
  p_BL /= count;
  const Vector3 axis_N = camera.X_NC.linear().col(2);
  if (J != nullptr) {
    J->leftCols<3>() = axis_N.transpose();
    J->rightCols<3>() = -axis_N.transpose() * X_NB.linear() * hat(p_BL);
  }
  return axis_N.dot(X_NB * p_BL - camera.X_NC.translation());
}

Result<MapUpdate> map_update(const Camera& camera, const Constellation& leds,
                             const PictureMeasurements& measurements,
                             const MapUpdateOptions& options, MotionState& state,
                             Matrix15& P, LedBias* bias) {
  return options.velocity_variance > 0
             ? solve<9>(camera, leds, measurements, options, state, P, bias)
             : solve<6>(camera, leds, measurements, options, state, P, bias);
}

}  // namespace alight
