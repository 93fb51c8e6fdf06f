#pragma once
#include <cmath>
#include <cstdint>
#include <string_view>

namespace alight {

/// Seeded random numbers whose bits do not depend on the standard library
/// (xoshiro256++, Blackman and Vigna 2019, seeded by splitmix64).
///
/// Each consumer takes its own stream with `fork("name")`, so that adding a draw to one
/// sensor changes no other.
class Rng {
 public:
  explicit Rng(std::uint64_t seed = 0) {
    for (auto& word : state_) word = splitmix(seed);
  }

  /// An independent stream; the same name of the same generator gives the same stream,
  /// whatever has been drawn since.
  Rng fork(std::string_view name) const {
    std::uint64_t hash = 1469598103934665603ull;
    for (const char c : name) {
      hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
    }
    return Rng(hash ^ seed_mark_);
  }

  std::uint64_t bits() {
    const std::uint64_t result = rotl(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = rotl(state_[3], 45);
    return result;
  }

  /// In [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }
  /// In [low, high).
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  bool chance(double probability) { return uniform() < probability; }

  /// Standard normal (Box and Muller 1958; one of the pair, no hidden state).
  double normal() {
    const double u = 1.0 - uniform();
    const double v = uniform();
    return std::sqrt(-2.0 * std::log(u)) * std::cos(6.283185307179586 * v);
  }
  double normal(double mean, double sd) { return mean + sd * normal(); }

 private:
  static std::uint64_t rotl(std::uint64_t x, int k) {
    return (x << k) | (x >> (64 - k));
  }
  std::uint64_t splitmix(std::uint64_t& seed) {
    seed_mark_ = seed;
    std::uint64_t z = (seed += 0x9e3779b97f4a7c15ull);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }

  std::uint64_t state_[4];
  std::uint64_t seed_mark_ = 0;
};

}  // namespace alight
