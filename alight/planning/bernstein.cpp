#include "alight/planning/bernstein.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace alight {
namespace {

constexpr int kDegreeOfCurve = kControlPoints - 1;
constexpr int kMost = 2 * kDegreeOfCurve + 1;
constexpr int kDepth = 24;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

using Square = std::array<double, kMost>;

void refine(const Square& c, int count, double gap, int depth, double& known,
            double& bound) {
  const auto n = static_cast<std::size_t>(count);
  const double high = *std::max_element(c.begin(), c.begin() + count);
  known = std::max({known, c[0], c[n - 1]});
  if (high <= known + gap || depth == 0) {
    bound = std::max(bound, high);
    return;
  }
  Square left{};
  Square right = c;
  for (std::size_t level = 0; level < n; ++level) {
    left[level] = right[0];
    for (std::size_t i = 0; i + level + 1 < n; ++i) {
      right[i] = 0.5 * (right[i] + right[i + 1]);
    }
  }
  refine(left, count, gap, depth - 1, known, bound);
  refine(right, count, gap, depth - 1, known, bound);
}

double binomial(int n, int k) {
  double value = 1;
  for (int i = 1; i <= k; ++i) value = value * (n - k + i) / i;
  return value;
}

/// Coefficients, degree 14, of a'b for curves a and b.
template <class Product>
Square product(Product&& of) {
  Square out{};
  for (int i = 0; i <= kDegreeOfCurve; ++i) {
    for (int j = 0; j <= kDegreeOfCurve; ++j) {
      static const auto weights = [] {
        std::array<std::array<double, kControlPoints>, kControlPoints> w{};
        for (int a = 0; a <= kDegreeOfCurve; ++a) {
          for (int b = 0; b <= kDegreeOfCurve; ++b) {
            w[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)] =
                binomial(kDegreeOfCurve, a) * binomial(kDegreeOfCurve, b) /
                binomial(2 * kDegreeOfCurve, a + b);
          }
        }
        return w;
      }();
      const auto a = static_cast<std::size_t>(i);
      const auto b = static_cast<std::size_t>(j);
      out[a + b] += weights[a][b] * of(a, b);
    }
  }
  return out;
}

}  // namespace

double bernstein_maximum(const double* coefficients, int count, double gap) {
  Square c{};
  double known = -kInfinite;
  double bound = known;
  for (int i = 0; i < count; ++i) {
    if (std::isnan(coefficients[i])) return kInfinite;
    c[static_cast<std::size_t>(i)] = coefficients[i];
  }
  refine(c, count, gap, kDepth, known, bound);
  return bound;
}

Curve derivative(const Curve& c, Seconds T) {
  constexpr int n = kDegreeOfCurve;
  std::array<Vector3, n> d;
  for (std::size_t i = 0; i < n; ++i) d[i] = n / T * (c[i + 1] - c[i]);
  Curve raised;
  for (std::size_t i = 0; i <= n; ++i) {
    const double share = static_cast<double>(i) / n;
    raised[i] = Vector3::Zero();
    if (i > 0) raised[i] += share * d[i - 1];
    if (i < n) raised[i] += (1 - share) * d[i];
  }
  return raised;
}

double maximum_along(const Curve& c, const Vector3& n, double gap) {
  std::array<double, kControlPoints> s;
  for (std::size_t i = 0; i < s.size(); ++i) s[i] = n.dot(c[i]);
  return bernstein_maximum(s.data(), kControlPoints, gap);
}

double maximum_norm(const Curve& c, double gap) {
  const Square square =
      product([&](std::size_t i, std::size_t j) { return c[i].dot(c[j]); });
  return std::sqrt(std::max(0.0, bernstein_maximum(square.data(), kMost, gap)));
}

double maximum_ratio(const Curve& c, const Curve& by, double gap) {
  if (!(maximum_along(by, -Vector3::UnitZ(), gap) < 0)) return kInfinite;
  const Square above =
      product([&](std::size_t i, std::size_t j) { return c[i].dot(c[j]); });
  const Square below =
      product([&](std::size_t i, std::size_t j) { return by[i].z() * by[j].z(); });
  const auto holds = [&](double rate) {
    Square left;
    for (std::size_t i = 0; i < left.size(); ++i) {
      left[i] = above[i] - rate * rate * below[i];
    }
    return bernstein_maximum(left.data(), kMost, gap) <= 0;
  };
  double low = 0;
  double high = 1e-3;
  while (!holds(high)) {
    low = high;
    high *= 2;
    if (!(high < 1e6)) return kInfinite;
  }
  while (high - low > 1e-3 * high) {
    const double middle = 0.5 * (low + high);
    (holds(middle) ? high : low) = middle;
  }
  return high;
}

}  // namespace alight
