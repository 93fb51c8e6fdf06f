#include "alight/peers/robust_fit.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace alight {
namespace {

constexpr int kSteps = 20;
constexpr double kSettled = 1e-10;  // rad and m

}  // namespace

Result<PoseFit> robust_fit(const Camera& camera, const Constellation& leds,
                           ObservationSpan seen, const Pose& X_NB_0, double sd_px,
                           double huber_px) {
  if (seen.size() < 3) return fail(Fault::too_few_points);
  PoseFit fit;
  fit.X_NB = X_NB_0;
  const double weight = 1 / (sd_px * sd_px);
  for (int k = 0; k < kSteps; ++k) {
    Matrix6 H = Matrix6::Zero();
    Vector6 g = Vector6::Zero();
    double square = 0;
    for (const LedObservation& o : seen) {
      Matrix26 J;
      const auto uv = project_observation(camera, fit.X_NB, leds, o.leds, &J);
      if (!uv) return fail(Fault::degenerate);
      const Vector2 r = o.uv - *uv;
      const double off = r.norm();
      const double trust = weight * (off > huber_px ? huber_px / off : 1);
      H.noalias() += trust * J.transpose() * J;
      g.noalias() += trust * J.transpose() * r;
      square += r.squaredNorm();
    }
    const auto ldlt = H.ldlt();
    if (!(ldlt.vectorD().minCoeff() > 1e-10 * ldlt.vectorD().maxCoeff())) {
      return fail(Fault::degenerate);
    }
    const Vector6 d = ldlt.solve(g);
    if (!d.allFinite()) return fail(Fault::degenerate);
    fit.X_NB = make_pose(fit.X_NB.linear() * so3_exp(d.tail<3>()),
                         fit.X_NB.translation() + d.head<3>());
    fit.cov = ldlt.solve(Matrix6::Identity());
    fit.chi2 = weight * square;
    fit.rms_px = std::sqrt(square / static_cast<double>(seen.size()));
    if (d.norm() < kSettled) {
      fit.X_NB.linear() = orthonormalized(fit.X_NB.linear());
      return fit;
    }
  }
  return fail(Fault::no_convergence);
}

}  // namespace alight
