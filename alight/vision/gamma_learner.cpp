#include "alight/vision/gamma_learner.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alight/geometry/rig.h"
#include "alight/vision/pixel.h"

namespace alight {
namespace {

constexpr double kReach = 4;  // sd around a light
constexpr double kSdLeast_px = 0.7, kSdMost_px = 2.5;
constexpr double kWidth[] = {0.55, 0.85, 1.25, 1.9, 2.9};  // sd
constexpr double kShare[] = {0.2, 0.3, 0.4, 0.1, 0.02};    // to begin with
constexpr int kBrightest = 200;  // grey levels; cameras bend what is brighter
constexpr double kShot = 0.06;   // variance per grey level of light
constexpr double kMismatch = 0.005, kRounding = 1.0 / 12;
constexpr double kNoiseLeast = 0.5;
constexpr double kLightLeast = 40;  // grey levels over the background

// Standard deviations about the start.
constexpr double kPlaceSd_px = 0.5, kBrightnessSd = 1, kBackSd = 20, kShareSd = 0.3;
constexpr double kPowerSd = 0.7;  // of its logarithm

constexpr int kIterations = 14;
constexpr double kEnough = 1e-3;    // of the cost; a step that gains less is the last
constexpr double kFaint = 1e-3;     // grey levels, for what has no logarithm
constexpr double kPowerMost = 1.8;  // of its logarithm, either way

constexpr double kVagueSd = 1;  // a look that tells less tells nothing
constexpr double kChi2Most = 3, kChi2Least = 0.2;
constexpr double kLookSd =
    0.12;  // a look tells no better: lights differ from one another
constexpr double kSaidSd = 0.12, kSettledSd = 0.04;
constexpr int kLooksLeast = 5;  // that say it is light itself
constexpr int kLooksOther = 2;  // that say it is not
// The logarithm that cameras which store light itself seem to have, for no light is a
// sum of these Gaussians, that of nearly all others, and of the rest: mean, sd, share.
struct Kind {
  double mean, sd, share;
};
constexpr Kind kLight = {0.05, 0.08, 0.55}, kUsual = {0.788, 0.06, 0.25},
               kOther = {0.5, 0.5, 0.2};

double squared(double x) { return x * x; }

/// How likely it is that one of a kind seems to have this.
double likelihood(const Kind& kind, double mean, double variance) {
  const double both = variance + squared(kind.sd);
  return kind.share * std::exp(-0.5 * squared(mean - kind.mean) / both) /
         std::sqrt(both);
}

}  // namespace

void GammaLearner::look(const ImageView& stored, std::span<const Vector2> lights,
                        double sd_px, const PictureNoise& noise) {
  if (busy() || settled() || lights.size() < 2 || lights.size() > kLightsMost) return;
  const double sd = std::clamp(sd_px, kSdLeast_px, kSdMost_px);
  Vector2 low = lights[0], high = lights[0];
  for (const Vector2& uv : lights) {
    low = low.cwiseMin(uv);
    high = high.cwiseMax(uv);
  }
  const double reach = kReach * sd;
  if (!(low.minCoeff() > reach && high.x() < stored.width - reach - 1 &&
        high.y() < stored.height - reach - 1)) {
    return;
  }
  double darkest = 255, brightest = 0;
  count_ = 0;
  for (int v = static_cast<int>(low.y() - reach); v <= high.y() + reach + 1; ++v) {
    for (int u = static_cast<int>(low.x() - reach); u <= high.x() + reach + 1; ++u) {
      const std::uint8_t* p = stored.row(v) + u * stored.channels;
      const auto near = [&](const Vector2& uv) {
        return squared(u - uv.x()) + squared(v - uv.y()) < reach * reach;
      };
      if (std::none_of(lights.begin(), lights.end(), near)) continue;
      if (grey_of(p, stored.channels) >= kBrightest) continue;
      if (count_ == kPixelsMost) return;
      const double value = static_cast<double>(luminance_of(p, stored.channels));
      darkest = std::min(darkest, value);
      brightest = std::max(brightest, value);
      pixels_[static_cast<std::size_t>(count_++)] = {static_cast<double>(u),
                                                     static_cast<double>(v), value, 0};
    }
  }
  lights_ = static_cast<int>(lights.size());
  const int n = parameters();
  if (count_ < 2 * n || brightest - darkest < kLightLeast) return;
  weigh(noise);
  start_.setZero(n);
  prior_.setZero(n);
  for (int k = 0; k < lights_; ++k) {
    start_.segment<2>(2 * k) = lights[static_cast<std::size_t>(k)];
    start_[2 * lights_ + k] = std::log(brightest);
  }
  prior_.head(2 * lights_).setConstant(1 / squared(kPlaceSd_px));
  prior_.segment(2 * lights_, lights_).setConstant(1 / squared(kBrightnessSd));
  const int back = 3 * lights_;
  start_[back] = std::max<double>(noise.dark, 1);
  prior_[back] = 1 / squared(kBackSd);
  for (int j = 0; j < kWidths; ++j) {
    variance_[static_cast<std::size_t>(j)] = squared(kWidth[j] * sd);
    start_[back + 1 + j] = kShare[j];
    prior_[back + 1 + j] = 1 / squared(kShareSd);
  }
  start_[n - 1] = 0;
  prior_[n - 1] = 1 / squared(kPowerSd);
  at_ = start_;
  now_ = equations(at_);
  damping_ = 1e-3;
  iteration_ = 0;
}

void GammaLearner::weigh(const PictureNoise& noise) {
  // Noise is that of light: of what is stored, brighter pixels have less.
  const double power = std::exp(-exponent());
  const double dark = std::max<double>(noise.dark, 1);
  const auto slope = [&](double value) {
    return power * std::pow(std::max(value, dark) / 255, 1 - 1 / power);
  };
  const double of_light =
      std::max(noise.luminance_variance, kNoiseLeast) / squared(slope(dark));
  for (int i = 0; i < count_; ++i) {
    Pixel& pixel = pixels_[static_cast<std::size_t>(i)];
    const double light = 255 * std::pow(pixel.value / 255, 1 / power);
    pixel.weight = 1 / (squared(slope(pixel.value)) * (of_light + kShot * light) +
                        kRounding + squared(kMismatch * pixel.value));
  }
}

GammaLearner::Equations GammaLearner::equations(const Vector& at) const {
  const int n = parameters(), back = 3 * lights_, power = n - 1;
  Equations out;
  out.A.setZero(n, n);
  out.g.setZero(n);
  const double a = std::exp(at[power]), gamma = 1 / a;
  const double x_back = std::max(at[back], kFaint) / 255;
  const double back_light = std::pow(x_back, gamma);
  Vector J(n);
  for (int i = 0; i < count_; ++i) {
    const Pixel& pixel = pixels_[static_cast<std::size_t>(i)];
    std::array<double, kLightsMost> share{}, of_value{};
    std::array<std::array<double, kWidths>, kLightsMost> bell{};
    double light = back_light, logs = back_light * std::log(x_back);
    for (int k = 0; k < lights_; ++k) {
      const auto c = static_cast<std::size_t>(k);
      const double d2 = squared(pixel.u - at[2 * k]) + squared(pixel.v - at[2 * k + 1]);
      double shape = 0;
      for (int j = 0; j < kWidths; ++j) {
        const auto w = static_cast<std::size_t>(j);
        bell[c][w] = std::exp(-0.5 * d2 / variance_[w]);
        shape += at[back + 1 + j] * bell[c][w];
      }
      const double value = std::exp(at[2 * lights_ + k]) * shape;
      if (value > kFaint) {
        share[c] = std::pow(value / 255, gamma);
        of_value[c] = 1 / value;
        light += share[c];
        logs += share[c] * std::log(value / 255);
      }
    }
    const double model = 255 * std::pow(light, a);
    J.setZero();
    J[back] = model * back_light / light / (255 * x_back);
    for (int k = 0; k < lights_; ++k) {
      const auto c = static_cast<std::size_t>(k);
      const double by_log = model * share[c] / light;
      J[2 * lights_ + k] = by_log;
      const double by_shape = by_log * of_value[c] * std::exp(at[2 * lights_ + k]);
      double by_place = 0;
      for (int j = 0; j < kWidths; ++j) {
        const auto w = static_cast<std::size_t>(j);
        J[back + 1 + j] += by_shape * bell[c][w];
        by_place += by_shape * at[back + 1 + j] * bell[c][w] / variance_[w];
      }
      J[2 * k] = by_place * (pixel.u - at[2 * k]);
      J[2 * k + 1] = by_place * (pixel.v - at[2 * k + 1]);
    }
    J[power] = a * model * (std::log(light) - gamma * logs / light);
    const double rest = pixel.value - model;
    out.A.selfadjointView<Eigen::Lower>().rankUpdate(J, pixel.weight);
    out.g += pixel.weight * rest * J;
    out.chi2 += pixel.weight * rest * rest;
  }
  const Vector off = at - start_;
  out.cost = out.chi2 + off.dot(prior_.cwiseProduct(off));
  out.g -= prior_.cwiseProduct(off);
  out.A.diagonal() += prior_;
  return out;
}

void GammaLearner::step() {
  if (!busy()) return;
  const int n = parameters(), back = 3 * lights_, power = n - 1;
  Matrix damped = now_.A;
  damped.diagonal() *= 1 + damping_;
  const Eigen::LLT<Matrix> llt(damped);
  Vector to = at_;
  if (llt.info() == Eigen::Success) to += llt.solve(now_.g);
  to[back] = std::max(to[back], 0.1);
  to[power] = std::clamp(to[power], -kPowerMost, kPowerMost);
  const Equations then = to.allFinite() ? equations(to) : now_;
  const double gained = now_.cost - then.cost;
  if (gained > 0) {
    at_ = to;
    now_ = then;
    damping_ = std::max(damping_ / 5, 1e-6);
  } else {
    damping_ *= 5;
  }
  const bool last = gained > 0 && gained < kEnough * now_.cost;
  if (++iteration_ >= kIterations || last) {
    if (last) finish();
    iteration_ = -1;
  }
}

void GammaLearner::finish() {
  const int n = parameters(), power = n - 1;
  const double chi2 = now_.chi2 / (count_ - n);
  if (!(chi2 < kChi2Most)) return;
  const Eigen::LLT<Matrix> llt(now_.A);
  if (llt.info() != Eigen::Success) return;
  const Vector unit = Vector::Unit(n, power);
  // What the pixels say, without the prior.
  const double with_prior = 1 / llt.solve(unit)[power];
  const double information = with_prior - prior_[power];
  const double variance = std::max(chi2, kChi2Least) / information;
  if (!(information > 0 && variance < squared(kVagueSd))) return;
  const double value = at_[power] * with_prior / information;
  const double weight = 1 / (variance + squared(kLookSd));
  information_ += weight;
  sum_ -= weight * std::clamp(value, -kPowerMost, kPowerMost);
  ++looks_;
}

double GammaLearner::exponent() const {
  if (looks_ < kLooksOther) return 0;
  const double mean = sum_ / information_, variance = 1 / information_;
  const double light = likelihood(kLight, mean, variance);
  const double usual = likelihood(kUsual, mean, variance);
  const double other = likelihood(kOther, mean, variance);
  if (usual + other < light) return 0;
  if (usual < other) return mean;
  return (kUsual.mean * variance + mean * squared(kUsual.sd)) /
         (variance + squared(kUsual.sd));
}

std::optional<double> GammaLearner::gamma() const {
  if (const double ln = exponent(); ln != 0) {
    return std::clamp(std::exp(ln), Rig::kGammaLeast, Rig::kGammaMost);
  }
  const bool well = looks_ >= kLooksLeast && information_ * squared(kSaidSd) >= 1;
  return well ? std::optional<double>(1) : std::nullopt;
}

bool GammaLearner::settled() const { return information_ * squared(kSettledSd) >= 1; }

}  // namespace alight
