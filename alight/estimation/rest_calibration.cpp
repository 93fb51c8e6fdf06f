#include "alight/estimation/rest_calibration.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <sstream>

#include "alight/estimation/rest_model.h"

namespace alight {
namespace {

/// Marginal, whatever else is not known.
LedCovariance led_covariance(const RestMap& fit, const RestUnknowns& sd) {
  const Eigen::Index n = sd.size() - kRestLeds;
  const Eigen::LLT<RestInformation> llt(fit.A);
  RestInformation columns(sd.size(), n);
  columns.setZero();
  columns.bottomRows(n).setIdentity();
  const RestInformation cov = llt.solve(columns);
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
  const RestUnknowns sd = standard_deviations(config, leds.size());
  const auto found = fit_rest(start, seen, config.pixel_sd_px, sd);
  if (!found) return fail(Fault::no_convergence);
  if (found->chi2 > config.chi2_max_per_led * static_cast<double>(seen.size())) {
    return fail(Fault::degenerate);
  }
  // The rig as written: only the pose may move.
  RestUnknowns pose_only = sd;
  pose_only.tail(sd.size() - kRestMount).setConstant(1e-9);
  const auto written = fit_rest(start, seen, config.pixel_sd_px, pose_only);

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
