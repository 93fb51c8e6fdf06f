#pragma once
#include <vector>

namespace alight {

/// A confidence interval of a share.
struct Interval {
  double low = 0;
  double high = 1;
};

/// Interval of the success probability after `successes` of `trials` (Wilson 1927);
/// z = 1.96 is 95 %. [0, 1] without trials.
Interval wilson_interval(int successes, int trials, double z = 1.959963984540054);

/// The p-quantile, p in [0, 1], linear between order statistics (Hyndman and Fan's
/// type 7); NaN when empty. NaNs in `values` are left out.
double percentile(std::vector<double> values, double p);

double mean(const std::vector<double>& values);  ///< NaN when empty
double rms(const std::vector<double>& values);   ///< NaN when empty

}  // namespace alight
