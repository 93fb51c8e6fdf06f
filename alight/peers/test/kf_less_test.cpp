#include "alight/peers/kf_less.h"

#include <gtest/gtest.h>

#include "alight/peers/robust_fit.h"
#include "alight/vision/test/scene.h"

namespace alight {
namespace {

/// Images of the rig's LEDs and of `strays` other lights, in no order.
struct Seen {
  Lights lights;
  std::vector<int> led;  ///< Of each light, -1 a stray.
};

Seen see(const Rig& rig, const Pose& X_NB, int strays, double sd_px, Rng& rng) {
  const Intrinsics& lens = rig.camera.intrinsics;
  std::vector<std::pair<Vector2, int>> all;
  for (int i = 0; i < rig.leds.size(); ++i) {
    const Vector2 noise(rng.normal(), rng.normal());
    all.emplace_back(*project_led(rig.camera, X_NB, rig.leds.p_BL(i)) + sd_px * noise,
                     i);
  }
  for (int i = 0; i < strays; ++i) {
    all.emplace_back(Vector2(rng.uniform(0, lens.width), rng.uniform(0, lens.height)),
                     -1);
  }
  for (std::size_t i = all.size(); i > 1; --i) {
    std::swap(all[i - 1], all[rng.bits() % i]);
  }
  Seen seen;
  for (const auto& [uv, led] : all) {
    seen.lights.uv.push_back(uv);
    seen.lights.rays.push_back(lens.unproject(uv));
    seen.led.push_back(led);
  }
  return seen;
}

double least_distance(const Rig& rig, const Pose& X_NB) {
  double least = 1e9;
  for (int i = 0; i < rig.leds.size(); ++i) {
    for (int j = 0; j < i; ++j) {
      least = std::min(least, (*project_led(rig.camera, X_NB, rig.leds.p_BL(i)) -
                               *project_led(rig.camera, X_NB, rig.leds.p_BL(j)))
                                  .norm());
    }
  }
  return least;
}

/// Poses with LEDs at least `apart_px` from each other.
Pose pose_with_leds_apart(const Rig& rig, double apart_px, Rng& rng) {
  for (;;) {
    const Pose X_NB = test::random_pose(rig, rng, 0.4, 1.5);
    if (least_distance(rig, X_NB) > apart_px) return X_NB;
  }
}

class Voting : public testing::TestWithParam<unsigned> {
 protected:
  Rng rng{GetParam()};
  Rig rig = alan_rig();
  LedVoting voting{{}, rig.camera.intrinsics, rig.leds};
};

TEST_P(Voting, PairsEveryLedWithItsLightWhenTheyAreWellApart) {
  const Pose X_NB = pose_with_leds_apart(rig, 12, rng);
  const int strays = static_cast<int>(GetParam() % 4);
  const Seen seen = see(rig, X_NB, strays, 0.1, rng);
  const LedMatches matches = voting.search(seen.lights);
  ASSERT_GE(matches.size(), 5u);
  for (const LedMatch& m : matches) {
    EXPECT_EQ(seen.led[static_cast<std::size_t>(m.light)], m.led);
  }
  Pose X_CB;
  ASSERT_TRUE(voting.agree(seen.lights, matches, X_CB));
  EXPECT_LT((rig.camera.X_NC * X_CB * X_NB.inverse()).translation().norm(), 0.3);
}

TEST_P(Voting, LightsThatAreNoDroneGiveNone) {
  Seen seen;
  const Intrinsics& lens = rig.camera.intrinsics;
  // Spread over the picture: no drone looks like that within any range.
  for (int i = 0; i < 6; ++i) {
    const Vector2 uv(60 + 140 * i + rng.uniform(-30, 30), rng.uniform(20, 460));
    seen.lights.uv.push_back(uv);
    seen.lights.rays.push_back(lens.unproject(uv));
  }
  const LedMatches matches = voting.search(seen.lights);
  Pose X_CB;
  if (voting.agree(seen.lights, matches, X_CB)) {
    // An answer there may be, if it brings the LEDs onto the lights.
    for (const LedMatch& m : matches) {
      const auto uv = lens.project(X_CB * rig.leds.p_BL(m.led));
      ASSERT_TRUE(uv);
      EXPECT_LT((*uv - seen.lights.uv[static_cast<std::size_t>(m.light)]).norm(), 60);
    }
  }
}

TEST_P(Voting, SwappedLedsDoNotAgree) {
  const Pose X_NB = pose_with_leds_apart(rig, 12, rng);
  const Seen seen = see(rig, X_NB, 0, 0, rng);
  LedMatches matches;
  for (int d = 0; d < seen.lights.size(); ++d) {
    matches.push_back({seen.led[static_cast<std::size_t>(d)], d});
  }
  Pose X_CB;
  EXPECT_TRUE(voting.agree(seen.lights, matches, X_CB));
  std::swap(matches[0].light, matches[3].light);
  EXPECT_FALSE(voting.agree(seen.lights, matches, X_CB));
}

INSTANTIATE_TEST_SUITE_P(Seeds, Voting, testing::Range(0u, 24u));

class Fit : public testing::TestWithParam<unsigned> {};

TEST_P(Fit, FindsThePoseThatMadeTheImageAndBearsAWrongPair) {
  Rng rng(GetParam());
  const Rig rig = alan_rig();
  const Pose X_NB = test::random_pose(rig, rng, 0.5, 1.5);
  std::vector<LedObservation> seen;
  for (int i = 0; i < rig.leds.size(); ++i) {
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << i);
    o.uv = *project_led(rig.camera, X_NB, rig.leds.p_BL(i));
    seen.push_back(o);
  }
  const Pose start = make_pose(X_NB.linear() * so3_exp(Vector3(0.05, -0.04, 0.06)),
                               X_NB.translation() + Vector3(0.03, 0.02, -0.02));
  const auto exact = robust_fit(rig.camera, rig.leds, seen, start, 1, 2);
  ASSERT_TRUE(exact);
  EXPECT_TRUE(exact->X_NB.isApprox(X_NB, 1e-7));
  EXPECT_LT(exact->rms_px, 1e-6);

  seen[GetParam() % 6].uv += Vector2(12, -8);
  const auto plain = robust_fit(rig.camera, rig.leds, seen, start, 1, 1e6);
  const auto robust = robust_fit(rig.camera, rig.leds, seen, start, 1, 1);
  if (!plain || !robust) return;
  EXPECT_LT((robust->X_NB.translation() - X_NB.translation()).norm(),
            (plain->X_NB.translation() - X_NB.translation()).norm() + 1e-3);
}
INSTANTIATE_TEST_SUITE_P(Seeds, Fit, testing::Range(0u, 30u));

TEST(KfLess, RefusesSettingsOutOfRangeByName) {
  KfLessConfig config;
  config.search_lights_max = 3;
  const auto peer = KfLess::create(config, alan_rig());
  ASSERT_FALSE(peer);
  EXPECT_NE(peer.error().detail.find("search_lights_max is 3"), std::string::npos);
  config = {};
  config.sd_px = 0;
  EXPECT_FALSE(KfLess::create(config, alan_rig()));
}

TEST(KfLess, FollowsASmoothFlightAndTellsADarkRoom) {
  const Rig rig = alan_rig();
  for (unsigned seed = 0; seed < 5; ++seed) {
    Rng rng(seed);
    auto peer = create_peer(PeerMethod::kf_less, rig);
    ASSERT_TRUE(peer);
    int tracked = 0;
    for (int i = 0; i < 20; ++i) {
      const double t = i / 60.0 + seed;
      const Pose X_NB = make_pose(
          from_rpy(0.1 * std::sin(2 * t), 0.1 * std::cos(t), 0.2 * std::sin(t)),
          Vector3(-0.3 + 0.1 * std::sin(t), 0.1 * std::cos(1.3 * t), 0.4));
      test::Picture picture;
      for (const Led& led : rig.leds.leds) {
        picture.add(*project_led(rig.camera, X_NB, led.p_BL), led.color);
      }
      const ImageView view = picture.expose(rng);
      const PeerReport out = (*peer)->fuse(from_seconds(i / 60.0), view, {});
      if (!out.tracked) continue;
      ++tracked;
      EXPECT_EQ(out.initialized, tracked == 1);
      EXPECT_LT((out.X_NB.translation() - X_NB.translation()).norm(), 0.03);
      EXPECT_LT(angle_between(out.X_NB.linear(), X_NB.linear()), 3 * kDegree);
      for (const LedObservation& o : out.seen) {
        const auto uv = project_observation(rig.camera, X_NB, rig.leds, o.leds);
        EXPECT_LT((*uv - o.uv).norm(), 2) << "swapped";
      }
      EXPECT_GT(out.cov.diagonal().minCoeff(), 0);
    }
    EXPECT_GE(tracked, 19);
    test::Picture dark;
    const ImageView view = dark.expose(rng);
    const PeerReport out = (*peer)->fuse(from_seconds(1), view, {});
    EXPECT_FALSE(out.tracked);
    EXPECT_STREQ(out.why_not, "fewer than four lights");
    EXPECT_FALSE((*peer)->fuse(from_seconds(2), ImageView{}, {}).tracked);
  }
}

TEST(Peers, ATagMethodWithoutItsTagSaysWhatToAdd) {
  for (const auto method : {PeerMethod::aruco, PeerMethod::apriltag}) {
    Rig rig = alan_rig();
    auto none = create_peer(method, rig);
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().detail.find("add tag:"), std::string::npos);
    rig.tag.emplace();
    rig.tag->family =
        method == PeerMethod::aruco ? TagFamily::tag36h11 : TagFamily::dict_4x4_50;
    auto other = create_peer(method, rig);
    ASSERT_FALSE(other);
    EXPECT_NE(other.error().detail.find("looks for"), std::string::npos);
  }
}

}  // namespace
}  // namespace alight
