#include "alight/mission/flare.h"

#include <algorithm>
#include <cassert>

namespace alight {
namespace {

// The feet come down some hundredths of a second about the trajectory's end.
constexpr Seconds kFade = 0.15;

}  // namespace

Flare::Flare(const Vector3& a_N, Seconds duration, Seconds early, const Vector3& d_N)
    : a_N_(a_N), d_N_(d_N), duration_(duration), early_(early) {
  assert(a_N.allFinite() && d_N.allFinite() && duration > 0 && early >= 0);
}

void Flare::add_to(FlatState& state, Seconds to_go) const {
  const double tau = to_go - early_;
  if (tau >= duration_) return;
  if (tau < 0) state.p_NB += d_N_;
  if (to_go < 0) {
    state.a_NB += std::max(1 + to_go / kFade, 0.0) * a_N_;
  } else if (tau < 0) {
    state.p_NB += (0.5 * tau * tau) * a_N_;
    state.v_NB -= tau * a_N_;
    state.a_NB += a_N_;
  } else {
    const double T = duration_, x = tau / T, y = 1 - x;
    state.p_NB += (1 - x * x * x * (10 + x * (-15 + 6 * x))) * d_N_;
    state.v_NB += (30 * x * x * y * y / T) * d_N_;
    state.a_NB -= (60 * x * y * (1 - 2 * x) / (T * T)) * d_N_;
    state.j_NB += (60 * (1 + 6 * x * (x - 1)) / (T * T * T)) * d_N_;
    state.p_NB += (0.5 * T * T * x * x * y * y * y) * a_N_;
    state.v_NB -= (0.5 * T * x * (2 + x * (-9 + x * (12 - 5 * x)))) * a_N_;
    state.a_NB += (1 + x * (-9 + x * (18 - 10 * x))) * a_N_;
    state.j_NB -= ((-9 + x * (36 - 30 * x)) / T) * a_N_;
  }
}

}  // namespace alight
