#pragma once
#include "alight/estimation/led_information.h"

namespace alight {

struct LedErrorsConfig {
  double share = 0.1;    ///< Of what a picture tells: the next looks much the same.
  double memory_s = 20;  ///< What pictures told is believed so long.
  double most_sds = 4;   ///< LEDs that would be off by more, all together, are not.

  Result<void> validate() const;
};

/// Where the LEDs of a drone really are, learnt while it is tracked: the filter takes
/// them for exact and knows what it owes to each (RelativeFilter's bias); what pictures
/// still contradict is told apart from their noise here (Friedland 1969). Together they
/// are the filter whose state has the LEDs in it. What no picture can tell stays as
/// written.
///
/// No allocation.
class LedErrors {
 public:
  /// LEDs where they are written down, each coordinate known to `led_sd_m`.
  LedErrors(const LedErrorsConfig& config, const Constellation& written,
            double led_sd_m);

  /// They have been measured: known to `cov`. What was learnt before is forgotten.
  /// @pre as many LEDs as before; `cov` positive definite.
  void measured(const Constellation& leds, const LedCovariance& cov);

  /// Adds what a picture tells, `since` after the one before. Then they have moved: the
  /// filter is to take them from leds().
  /// @returns false when they would have to stand where nobody mounts them: pictures
  ///          and LEDs do not belong together, and all that was learnt is forgotten.
  bool add(const LedInformation& told, Seconds since);

  /// They stand again where they were written or measured.
  void forget();

  const Constellation& leds() const { return leds_; }
  const LedCovariance& cov() const { return cov_; }

 private:
  LedErrorsConfig config_;
  Constellation begun_, leds_;
  LedCovariance cov_;
  LedCovariance begun_information_;
  LedCovariance begun_cov_;
  LedInformation told_;  // by pictures, of the displacement from leds_
};

}  // namespace alight
