#include "alight/sim/seaway.h"

#include <cmath>
#include <complex>

namespace alight {
namespace {

using Complex = std::complex<double>;

constexpr int kWaves = 60;
// Frequencies over the peak's. Below there is no energy; above the hull does not
// follow.
constexpr double kLowest = 0.5;
constexpr double kHighest = 3.0;

/// An oscillator, its own frequency over that of the sea's peak.
struct Oscillator {
  double natural, damping;
  Complex operator()(double frequency) const {
    const double r = frequency / natural;
    return 1.0 / Complex(1 - r * r, 2 * damping * r);
  }
};
constexpr Oscillator kHeave{2.0, 0.4};
constexpr Oscillator kPitch{2.0, 0.4};
constexpr Oscillator kRoll{1.3, 0.15};

/// JONSWAP by frequency over the peak's, up to a factor.
double jonswap(double r, double gamma) {
  const double width = r <= 1 ? 0.07 : 0.09;
  const double beside = (r - 1) / width;
  return std::pow(r, -5) * std::exp(-1.25 * std::pow(r, -4)) *
         std::pow(gamma, std::exp(-0.5 * beside * beside));
}

}  // namespace

Seaway::Seaway(const SeaScenario& sea, Rng rng) {
  const double peak = 2 * kPi / sea.period_s;
  const double off_bow = rng.uniform(30, 60) * kDegree;
  const double side = rng.chance(0.5) ? 1 : -1;  // 1: the waves come from the left
  const double step = (kHighest - kLowest) / kWaves;
  Vector3 variance = Vector3::Zero();
  for (int k = 0; k < kWaves; ++k) {
    // Not evenly apart, or all would come again after one period of the spacing.
    const double r = kLowest + step * (k + rng.uniform());
    const Complex height = std::polar(std::sqrt(2 * jonswap(r, sea.gamma) * step),
                                      rng.uniform(0, 2 * kPi));
    // Height a exp(i (w t - k d.x)), d the way the waves go: its slope along x is
    // -i k d_x times it, and k goes with w^2 (deep water). Bow down is a falling slope.
    const Complex slope = Complex(0, -1) * (r * r) * height;
    const Complex along = -std::cos(off_bow) * slope;
    const Complex to_left = -side * std::sin(off_bow) * slope;
    const Complex motion[3] = {kHeave(r) * height, kRoll(r) * to_left,
                               kPitch(r) * -along};
    Wave wave{peak * r, {}, {}};
    for (int i = 0; i < 3; ++i) {
      wave.c[i] = motion[i].real();  // of Re(motion exp(i w t))
      wave.s[i] = -motion[i].imag();
      variance[i] += 0.5 * std::norm(motion[i]);
    }
    waves_.push_back(wave);
  }
  const Vector3 wanted(sea.heave_m, sea.roll_deg * kDegree, sea.pitch_deg * kDegree);
  const Vector3 scale = 0.5 * wanted.cwiseQuotient(variance.cwiseSqrt());
  for (Wave& wave : waves_) {
    wave.c = wave.c.cwiseProduct(scale);
    wave.s = wave.s.cwiseProduct(scale);
  }
}

Seaway::Deck Seaway::at(Seconds t) const {
  Vector3 value = Vector3::Zero(), rate = Vector3::Zero(), twice = Vector3::Zero();
  for (const Wave& wave : waves_) {
    const double c = std::cos(wave.omega * t), s = std::sin(wave.omega * t);
    const Vector3 now = c * wave.c + s * wave.s;
    value += now;
    rate += wave.omega * (c * wave.s - s * wave.c);
    twice -= wave.omega * wave.omega * now;
  }
  const auto motion = [&](int i) { return Motion{value[i], rate[i], twice[i]}; };
  return {motion(0), motion(1), motion(2)};
}

}  // namespace alight
