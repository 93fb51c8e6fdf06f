#include "alight/sim/cubic_spline.h"

#include <algorithm>
#include <cassert>

namespace alight {

CubicSpline::CubicSpline(std::vector<double> t, std::vector<double> values, End first,
                         End last)
    : t_(std::move(t)), value_(std::move(values)), slope_(t_.size()) {
  const std::size_t n = t_.size();
  assert(n >= 2 && value_.size() == n);
  // One equation a point for its slope, each coupled to its neighbours: eliminated
  // forwards, solved backwards.
  std::vector<double> above(n), right(n);
  const auto h = [&](std::size_t i) { return t_[i + 1] - t_[i]; };
  const auto secant = [&](std::size_t i) { return (value_[i + 1] - value_[i]) / h(i); };
  for (std::size_t i = 0; i < n; ++i) {
    double low = 0, mid = 1, high = 0, value = 0;
    if (i == 0 && first == End::free) {
      mid = 2, high = 1, value = 3 * secant(0);
    } else if (i == n - 1 && last == End::free) {
      low = 1, mid = 2, value = 3 * secant(n - 2);
    } else if (i > 0 && i < n - 1) {
      low = h(i), mid = 2 * (h(i - 1) + h(i)), high = h(i - 1);
      value = 3 * (h(i) * secant(i - 1) + h(i - 1) * secant(i));
    }
    if (i > 0) {
      mid -= low * above[i - 1];
      value -= low * right[i - 1];
    }
    above[i] = high / mid;
    right[i] = value / mid;
  }
  for (std::size_t i = n; i-- > 0;) {
    slope_[i] = right[i] - (i + 1 < n ? above[i] * slope_[i + 1] : 0);
  }
}

CubicSpline::Sample CubicSpline::at(double t) const {
  t = std::clamp(t, t_.front(), t_.back());
  const auto after = std::upper_bound(t_.begin() + 1, t_.end() - 1, t);
  const auto i = static_cast<std::size_t>(after - t_.begin()) - 1;
  const double h = t_[i + 1] - t_[i];
  const double u = (t - t_[i]) / h;
  const double rise = value_[i + 1] - value_[i];
  const double a = h * slope_[i], b = h * slope_[i + 1];
  // value + a u + c2 u^2 + c3 u^3, both slopes met.
  const double c2 = 3 * rise - 2 * a - b;
  const double c3 = a + b - 2 * rise;
  return {value_[i] + u * (a + u * (c2 + u * c3)), (a + u * (2 * c2 + 3 * c3 * u)) / h,
          (2 * c2 + 6 * c3 * u) / (h * h)};
}

}  // namespace alight
