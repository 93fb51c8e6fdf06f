#include "alight/vision/gamma_learner.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alight/geometry/rig.h"
#include "alight/vision/lanes.h"
#include "alight/vision/pixel.h"

namespace alight {
namespace {

constexpr double kReach = 4;  // sd around a light
constexpr double kSdLeast_px = 0.7, kSdMost_px = 2.5;
constexpr double kWidth[] = {0.55, 0.85, 1.25, 1.9, 2.9};  // sd
constexpr double kShare[] = {0.2, 0.3, 0.4, 0.1, 0.02};    // to begin with
constexpr int kBrightest = 200;  // grey levels; cameras bend what is brighter
constexpr float kShot = 0.06f;   // variance per grey level of light
constexpr float kMismatch = 0.005f, kRounding = 1.0f / 12;
constexpr double kNoiseLeast = 0.5;
constexpr double kLightLeast = 40;  // grey levels over the background

// Standard deviations about the start.
constexpr double kPlaceSd_px = 0.5, kBrightnessSd = 1, kBackSd = 20, kShareSd = 0.3;
constexpr double kPowerSd = 0.7;  // of its logarithm

constexpr int kIterations = 14;
constexpr double kEnough = 1e-3;    // of the cost; a step that gains less is the last
constexpr float kFaint = 1e-3f;     // grey levels, for what has no logarithm
constexpr double kPowerMost = 1.8;  // of its logarithm, either way

constexpr int kRestsLeast = 4, kRestsMost = 128;  // pictures, after a vain look
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
  if (rest_ > 0) {
    --rest_;
    return;
  }
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
  float darkest = 255, brightest = 0;
  std::size_t count = 0;
  for (int v = static_cast<int>(low.y() - reach); v <= high.y() + reach + 1; ++v) {
    for (int u = static_cast<int>(low.x() - reach); u <= high.x() + reach + 1; ++u) {
      const std::uint8_t* p = stored.row(v) + u * stored.channels;
      const auto near = [&](const Vector2& uv) {
        return squared(u - uv.x()) + squared(v - uv.y()) < reach * reach;
      };
      if (std::none_of(lights.begin(), lights.end(), near)) continue;
      if (grey_of(p, stored.channels) >= kBrightest) continue;
      if (count == kPixelsMost) return;
      const float value = luminance_of(p, stored.channels);
      darkest = std::min(darkest, value);
      brightest = std::max(brightest, value);
      pixels_.u[count] = static_cast<float>(u);
      pixels_.v[count] = static_cast<float>(v);
      pixels_.value[count++] = value;
    }
  }
  lights_ = static_cast<int>(lights.size());
  const int n = parameters();
  pixels_.count = static_cast<int>(count);
  if (pixels_.count < 2 * n || brightest - darkest < kLightLeast) return;
  weigh(noise);
  start_.setZero(n);
  prior_.setZero(n);
  for (int k = 0; k < lights_; ++k) {
    start_.segment<2>(2 * k) = lights[static_cast<std::size_t>(k)];
    start_[2 * lights_ + k] = std::log(static_cast<double>(brightest));
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
  const auto power = static_cast<float>(std::exp(-exponent()));
  const auto dark = std::max(static_cast<float>(noise.dark), 1.0f);
  const auto light_of = [&](float value) { return pow_of(value / 255, 1 / power); };
  const auto slope = [&](float value, float light) {
    return power * value / (255 * light);
  };
  const float in_dark = slope(dark, light_of(dark));
  const float of_light =
      static_cast<float>(std::max(noise.luminance_variance, kNoiseLeast)) /
      (in_dark * in_dark);
  std::size_t i = 0;
  for (; i < static_cast<std::size_t>(pixels_.count); ++i) {
    const float value = std::max(pixels_.value[i], dark), light = light_of(value);
    const float bent = slope(value, light), mismatch = kMismatch * pixels_.value[i];
    pixels_.weight[i] = 1 / (bent * bent * (of_light + kShot * 255 * light) +
                             kRounding + mismatch * mismatch);
  }
  for (; i % kLane != 0; ++i) {
    pixels_.u[i] = pixels_.u[0];
    pixels_.v[i] = pixels_.v[0];
    pixels_.value[i] = pixels_.value[0];
    pixels_.weight[i] = 0;
  }
  pixels_.padded = static_cast<int>(i);
}

/// The picture as parameters have it, pixel by pixel.
struct GammaLearner::Model {
  alignas(32) float J[kParametersMost][kPixelsMost];  // derivatives
  alignas(32) float rest[kPixelsMost];                // of what is stored
  alignas(32) float A[kParametersMost][kParametersMost], g[kParametersMost];
  float chi2;

  ALIGHT_INLINE void compute(const Pixels& pixels, int lights, const Vector& at,
                             const std::array<double, kWidths>& variances) {
    const auto n = static_cast<int>(at.size());
    const int back = 3 * lights, power = n - 1;
    const int padded = pixels.padded;
    const auto a = static_cast<float>(std::exp(at[power]));
    const float gamma = 1 / a;
    const auto x_back = std::max(static_cast<float>(at[back]), kFaint) / 255;
    const float log2_back = log2_of(x_back), back_light = exp2_of(gamma * log2_back);
    float share[kWidths], per_variance[kWidths];
    for (int j = 0; j < kWidths; ++j) {
      share[j] = static_cast<float>(at[back + 1 + j]);
      per_variance[j] = static_cast<float>(1 / variances[static_cast<std::size_t>(j)]);
    }
    // Of each pixel: light, light times its logarithm, and what it is stored as; of
    // each light there: its bells by width, what it gives, and that by its own value.
    alignas(32) float light[kPixelsMost], logs[kPixelsMost], stored[kPixelsMost];
    alignas(32) float bell[kLightsMost][kWidths][kPixelsMost];
    alignas(32) float given[kLightsMost][kPixelsMost];
    alignas(32) float by_value[kLightsMost][kPixelsMost];
    for (int i = 0; i < padded; ++i) {
      light[i] = back_light;
      logs[i] = back_light * log2_back;
    }
    for (int k = 0; k < lights; ++k) {
      const auto u = static_cast<float>(at[2 * k]),
                 v = static_cast<float>(at[2 * k + 1]);
      const auto height = static_cast<float>(std::exp(at[2 * lights + k]));
      float* const given_k = given[k];
      float* const by_value_k = by_value[k];
      for (int i = 0; i < padded; ++i) by_value_k[i] = 0;
      for (int j = 0; j < kWidths; ++j) {
        float* const bell_j = bell[k][j];
        const float share_j = share[j], half = -0.5f * per_variance[j];
        for (int i = 0; i < padded; ++i) {
          const auto p = static_cast<std::size_t>(i);
          const float du = pixels.u[p] - u, dv = pixels.v[p] - v;
          bell_j[i] = exp_of(half * (du * du + dv * dv));
          by_value_k[i] += share_j * bell_j[i];
        }
      }
      for (int i = 0; i < padded; ++i) {
        const float value = height * by_value_k[i];
        const float known = value > kFaint ? 1.0f : 0.0f;
        const float some = std::max(value, kFaint);
        const float log2_value = log2_of(some / 255);
        given_k[i] = known * exp2_of(gamma * log2_value);
        light[i] += given_k[i];
        logs[i] += given_k[i] * log2_value;
        by_value_k[i] = height * given_k[i] / some;
      }
    }
    constexpr float kLn2 = 0.69314718f;
    float* const J_back = J[back];
    float* const J_power = J[power];
    for (int i = 0; i < padded; ++i) {
      const auto p = static_cast<std::size_t>(i);
      const float log2_light = log2_of(light[i]);
      stored[i] = 255 * exp2_of(a * log2_light);
      rest[i] = pixels.value[p] - stored[i];
      stored[i] /= light[i];
      J_back[i] = stored[i] * (back_light / (255 * x_back));
      J_power[i] = kLn2 * stored[i] * (a * light[i] * log2_light - logs[i]);
    }
    for (int j = 0; j < kWidths; ++j) {
      float* const J_j = J[back + 1 + j];
      for (int i = 0; i < padded; ++i) J_j[i] = 0;
      for (int k = 0; k < lights; ++k) {
        const float* const bell_j = bell[k][j];
        const float* const by_value_k = by_value[k];
        for (int i = 0; i < padded; ++i)
          J_j[i] += stored[i] * by_value_k[i] * bell_j[i];
      }
    }
    for (int k = 0; k < lights; ++k) {
      const auto u = static_cast<float>(at[2 * k]),
                 v = static_cast<float>(at[2 * k + 1]);
      float* const J_u = J[2 * k];
      float* const J_v = J[2 * k + 1];
      float* const J_h = J[2 * lights + k];
      for (int i = 0; i < padded; ++i) J_u[i] = 0;
      for (int j = 0; j < kWidths; ++j) {
        const float* const bell_j = bell[k][j];
        const float narrow = share[j] * per_variance[j];
        for (int i = 0; i < padded; ++i) J_u[i] += narrow * bell_j[i];
      }
      for (int i = 0; i < padded; ++i) {
        const auto p = static_cast<std::size_t>(i);
        const float by_place = stored[i] * by_value[k][i] * J_u[i];
        J_h[i] = stored[i] * given[k][i];
        J_u[i] = by_place * (pixels.u[p] - u);
        J_v[i] = by_place * (pixels.v[p] - v);
      }
    }
    alignas(32) float weighted[kPixelsMost];
    const float* const weight = pixels.weight.data();
    for (int i = 0; i < padded; ++i) weighted[i] = weight[i] * rest[i];
    chi2 = dot(weighted, rest, padded);
    for (int p = 0; p < n; ++p) {
      for (int i = 0; i < padded; ++i) weighted[i] = weight[i] * J[p][i];
      g[p] = dot(weighted, rest, padded);
      for (int q = 0; q <= p; ++q) A[p][q] = dot(weighted, J[q], padded);
    }
  }

#if defined(ALIGHT_WIDE)
  ALIGHT_WIDE void compute_wide(const Pixels& pixels, int lights, const Vector& at,
                                const std::array<double, kWidths>& variances) {
    compute(pixels, lights, at, variances);
  }
#endif
};

GammaLearner::Equations GammaLearner::equations(const Vector& at) const {
  Model model;
#if defined(ALIGHT_WIDE)
  if (is_wide()) {
    model.compute_wide(pixels_, lights_, at, variance_);
  } else {
    model.compute(pixels_, lights_, at, variance_);
  }
#else
  model.compute(pixels_, lights_, at, variance_);
#endif
  const int n = parameters();
  Equations out;
  out.A.resize(n, n);
  out.g.resize(n);
  for (int p = 0; p < n; ++p) {
    out.g[p] = static_cast<double>(model.g[p]);
    for (int q = 0; q <= p; ++q) {
      out.A(p, q) = out.A(q, p) = static_cast<double>(model.A[p][q]);
    }
  }
  out.chi2 = static_cast<double>(model.chi2);
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
    const bool told = last && finish();
    rests_ = told ? 0 : std::clamp(2 * rests_, kRestsLeast, kRestsMost);
    rest_ = rests_;
    iteration_ = -1;
  }
}

bool GammaLearner::finish() {
  const int n = parameters(), power = n - 1;
  const double chi2 = now_.chi2 / (pixels_.count - n);
  if (!(chi2 < kChi2Most)) return false;
  const Eigen::LLT<Matrix> llt(now_.A);
  if (llt.info() != Eigen::Success) return false;
  const Vector unit = Vector::Unit(n, power);
  // What the pixels say, without the prior.
  const double with_prior = 1 / llt.solve(unit)[power];
  const double information = with_prior - prior_[power];
  const double variance = std::max(chi2, kChi2Least) / information;
  if (!(information > 0 && variance < squared(kVagueSd))) return false;
  const double value = at_[power] * with_prior / information;
  const double weight = 1 / (variance + squared(kLookSd));
  information_ += weight;
  sum_ -= weight * std::clamp(value, -kPowerMost, kPowerMost);
  ++looks_;
  return true;
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
