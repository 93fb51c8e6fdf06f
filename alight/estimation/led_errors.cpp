#include "alight/estimation/led_errors.h"

#include <Eigen/Cholesky>
#include <cassert>
#include <cmath>

#include "alight/base/bounds.h"

namespace alight {

Result<void> LedErrorsConfig::validate() const {
  return check_bounds({{"led_errors.share", share, 1e-3, 1},
                       {"led_errors.memory_s", memory_s, 0.1, 1e6},
                       {"led_errors.most_sds", most_sds, 1, 100}});
}

LedErrors::LedErrors(const LedErrorsConfig& config, const Constellation& written,
                     double led_sd_m)
    : config_(config), begun_(written), leds_(written) {
  const Eigen::Index n = 3 * written.size();
  measured(written, LedCovariance::Identity(n, n) * (led_sd_m * led_sd_m));
}

void LedErrors::measured(const Constellation& leds, const LedCovariance& cov) {
  assert(leds.size() == begun_.size() && cov.rows() == 3 * leds.size());
  const Eigen::LLT<LedCovariance> llt(cov);
  assert(llt.info() == Eigen::Success);
  begun_ = leds;
  begun_cov_ = cov;
  begun_information_ = llt.solve(LedCovariance::Identity(cov.rows(), cov.rows()));
  forget();
}

void LedErrors::forget() {
  leds_ = begun_;
  cov_ = begun_cov_;
  told_.matrix.setZero(cov_.rows(), cov_.rows());
  told_.vector.setZero(cov_.rows());
}

bool LedErrors::add(const LedInformation& told, Seconds since) {
  const Eigen::Index n = cov_.rows();
  const double kept = std::exp(-since / config_.memory_s);
  told_.matrix = kept * told_.matrix + config_.share * told.matrix;
  told_.vector = kept * told_.vector + config_.share * told.vector;
  LedVector off(n);
  for (int i = 0; i < leds_.size(); ++i) {
    off.segment<3>(3 * i) = leds_.p_BL(i) - begun_.p_BL(i);
  }
  const LedVector held = begun_information_.lazyProduct(off);
  const Eigen::LLT<LedCovariance> llt(LedCovariance(begun_information_ + told_.matrix));
  if (llt.info() != Eigen::Success) {
    forget();
    return false;
  }
  const LedVector change = llt.solve(told_.vector - held);
  const LedVector now = off + change;
  const double most = config_.most_sds * config_.most_sds * static_cast<double>(n);
  if (!(now.dot(begun_information_.lazyProduct(now)) < most)) {
    forget();
    return false;
  }
  for (int i = 0; i < leds_.size(); ++i) {
    leds_.leds[static_cast<std::size_t>(i)].p_BL += change.segment<3>(3 * i);
  }
  told_.vector -= told_.matrix.lazyProduct(change);
  cov_ = llt.solve(LedCovariance::Identity(n, n));
  return true;
}

}  // namespace alight
