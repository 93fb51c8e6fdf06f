#include "alight/estimation/led_information.h"

#include <bit>

#include "alight/estimation/huber.h"

namespace alight {
namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor,
                           2 * kMaxGroup, 3 * kMaxLeds>;
using ByState =
    Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor, 2 * kMaxGroup, 6>;
using Residual = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 2 * kMaxGroup, 1>;

}  // namespace

bool tell_of_leds(const Camera& camera, const Constellation& leds,
                  const PictureMeasurements& measurements, double huber_sd,
                  const Pose& X_NB, const Eigen::Matrix<double, 6, 6>& cov,
                  const LedBias& bias, LedInformation& out) {
  const Eigen::Index n = 3 * leds.size();
  out.matrix.setZero(n, n);
  out.vector.setZero(n);
  Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 3 * kMaxLeds> T(6, n);
  T.setZero();
  for (const PictureMeasurement& m : measurements) {
    const auto rows = static_cast<Eigen::Index>(2 * m.images.size());
    ByState H(rows, 6);
    Residual r(rows);
    for (std::size_t k = 0; k < m.images.size(); ++k) {
      Matrix26 H_k;
      const auto at = static_cast<Eigen::Index>(2 * k);
      const auto uv = project_observation(camera, X_NB, leds, m.images[k].leds, &H_k);
      if (!uv) return false;
      H.middleRows<2>(at) = H_k;
      r.segment<2>(at) = m.images[k].uv - *uv;
    }
    Rows G = -H.lazyProduct(bias.topRows<6>());
    for (std::size_t k = 0; k < m.images.size(); ++k) {
      const std::uint16_t which = m.images[k].leds;
      const auto at = static_cast<Eigen::Index>(2 * k);
      const Eigen::Matrix<double, 2, 3> own =
          H.block<2, 3>(at, 0) * X_NB.linear() / std::popcount(which);
      for (int i = 0; i < leds.size(); ++i) {
        if ((which >> i) & 1) G.block<2, 3>(at, 3 * i) += own;
      }
    }
    const auto W = m.information.topLeftCorner(rows, rows);
    const double weight = huber_weight(r.dot(W.lazyProduct(r)), huber_sd * m.slack);
    const Rows WG = weight * W.lazyProduct(G);
    out.matrix.noalias() += G.transpose().lazyProduct(WG);
    out.vector.noalias() += WG.transpose().lazyProduct(r);
    T.noalias() += H.transpose().lazyProduct(WG);
  }
  const Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 3 * kMaxLeds> cov_T =
      cov.lazyProduct(T);
  out.matrix.noalias() -= T.transpose().lazyProduct(cov_T);
  return out.matrix.allFinite() && out.vector.allFinite();
}

}  // namespace alight
