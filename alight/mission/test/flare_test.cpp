#include "alight/mission/flare.h"

#include <gtest/gtest.h>

namespace alight {
namespace {

const Vector3 kLean(1.5, -0.7, 0);
constexpr Seconds kDuration = 0.8;

FlatState added(const Flare& flare, Seconds to_go) {
  FlatState state;
  flare.add_to(state, to_go);
  return state;
}

TEST(Flare, BeginsFromNothingAndEndsWithItsAccelerationAlone) {
  for (const Seconds early : {0.0, 0.07}) {
    const Flare flare(kLean, kDuration, early);
    for (const Seconds tau : {kDuration, kDuration + 0.3, 5.0}) {
      const FlatState before = added(flare, tau + early);
      EXPECT_LT(before.p_NB.norm() + before.v_NB.norm() + before.a_NB.norm(), 1e-12);
    }
    const FlatState end = added(flare, early);
    EXPECT_LT(end.p_NB.norm(), 1e-12);
    EXPECT_LT(end.v_NB.norm(), 1e-12);
    EXPECT_LT((end.a_NB - kLean).norm(), 1e-12);
  }
}

TEST(Flare, EachDerivativeIsTheOneBeforeItsRate) {
  const Flare flare(kLean, kDuration, 0.05, Vector3(0.03, -0.05, 0));
  constexpr Seconds h = 1e-5;
  for (Seconds to_go = 0.01; to_go < kDuration + 0.04; to_go += 0.0123) {
    if (std::abs(to_go - 0.05) < 2 * h) continue;
    // Time runs against the time to go.
    const FlatState later = added(flare, to_go - h), sooner = added(flare, to_go + h);
    const FlatState at = added(flare, to_go);
    EXPECT_LT(((later.p_NB - sooner.p_NB) / (2 * h) - at.v_NB).norm(), 1e-6) << to_go;
    EXPECT_LT(((later.v_NB - sooner.v_NB) / (2 * h) - at.a_NB).norm(), 1e-5) << to_go;
    if (to_go > 0.05) {
      EXPECT_LT(((later.a_NB - sooner.a_NB) / (2 * h) - at.j_NB).norm(), 1e-2) << to_go;
    }
  }
}

TEST(Flare, MovesLittleAndFadesAfterTheEnd) {
  const Flare flare(kLean, kDuration, 0);
  for (Seconds to_go = 0; to_go < kDuration; to_go += 0.001) {
    EXPECT_LE(added(flare, to_go).p_NB.norm(),
              0.0175 * kLean.norm() * kDuration * kDuration);
  }
  double last = kLean.norm();
  for (Seconds past = 0.01; past < 0.3; past += 0.01) {
    const double a = added(flare, -past).a_NB.norm();
    EXPECT_LE(a, last);
    last = a;
  }
  EXPECT_EQ(last, 0);
}

TEST(Flare, EndsAsFarAsideAsItIsToldAndStaysThere) {
  const Vector3 aside(0.03, 0.01, 0);
  const Flare plain(kLean, kDuration, 0.05), flare(kLean, kDuration, 0.05, aside);
  EXPECT_LT(added(flare, kDuration + 0.05).p_NB.norm(), 1e-12);
  for (const Seconds to_go : {0.05, 0.02, 0.0, -0.1, -0.5, -3.0}) {
    const FlatState with = added(flare, to_go), without = added(plain, to_go);
    EXPECT_LT((with.p_NB - without.p_NB - aside).norm(), 1e-12) << to_go;
    EXPECT_LT((with.v_NB - without.v_NB).norm(), 1e-12) << to_go;
    EXPECT_LT((with.a_NB - without.a_NB).norm(), 1e-12) << to_go;
  }
  double last = 0;
  for (Seconds to_go = kDuration + 0.05; to_go > 0.04; to_go -= 0.001) {
    const double moved = (added(flare, to_go).p_NB - added(plain, to_go).p_NB).norm();
    EXPECT_GE(moved, last - 1e-12);
    last = moved;
  }
}

TEST(Flare, NoneAddsNothing) {
  for (const Seconds to_go : {-1.0, 0.0, 0.4, 2.0}) {
    const FlatState state = added(Flare(), to_go);
    EXPECT_EQ(state.p_NB.norm() + state.v_NB.norm() + state.a_NB.norm(), 0);
  }
}

}  // namespace
}  // namespace alight
