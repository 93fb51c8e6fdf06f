#include "alight/mission/pose_doubt.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr double kNoise_px = 0.03;

/// A drone that passes before the lens and turns, some of its LEDs lit.
class Pass {
 public:
  explicit Pass(unsigned seed, double range_m = 1.4)
      : rng_(seed), finder_(LedFinder::create({}, rig_.camera, rig_.leds).value()) {
    start_ = Vector3(0.54 - range_m, rng_.uniform(-0.2, 0.2), rng_.uniform(0.3, 0.5));
    way_ = Vector3(rng_.normal(), rng_.normal(), 0.3 * rng_.normal()).normalized();
    yaw_ = rng_.uniform(-25, 25) * kDegree;
    turn_ = rng_.uniform(-40, 40) * kDegree;
  }

  Pose at(double t) const {
    return make_pose(from_rpy(0, 0, yaw_ + turn_ * t), start_ + 0.4 * t * way_);
  }

  /// The lit ones, each told for what `as` says.
  FixedVector<LedObservation, kMaxLeds> see(double t, std::initializer_list<int> lit,
                                            std::initializer_list<int> as) {
    FixedVector<LedObservation, kMaxLeds> seen;
    auto told = as.begin();
    for (const int led : lit) {
      LedObservation o;
      o.leds = static_cast<std::uint16_t>(1u << *told++);
      o.uv = *project_led(rig_.camera, at(t), rig_.leds.p_BL(led)) +
             kNoise_px * Vector2(rng_.normal(), rng_.normal());
      o.cov = kNoise_px * kNoise_px * Matrix2::Identity();
      seen.push_back(o);
    }
    return seen;
  }

  void look(PoseDoubt& doubt, ObservationSpan seen, const Pose& X_NB) const {
    doubt.look(rig_.camera, rig_.leds, true, finder_, seen, X_NB);
  }

  const Rig& rig() const { return rig_; }
  const LedFinder& finder() const { return finder_; }

 private:
  Rig rig_ = alan_rig();
  Rng rng_;
  LedFinder finder_;
  Vector3 start_, way_;
  double yaw_, turn_;
};

double apart_m(const Pose& a, const Pose& b) {
  return (a.translation() - b.translation()).norm();
}

class FewLeds : public testing::TestWithParam<unsigned> {};

TEST_P(FewLeds, TakenForOthersAreReadAsWhatTheyAre) {
  Pass pass(GetParam());
  // LED 2 is taken for LED 0, of the same colour.
  const auto seen = pass.see(0, {2, 3, 4, 5}, {0, 3, 4, 5});
  const auto fit = refine_pose(pass.rig().camera, pass.rig().leds,
                               {seen.data(), seen.size()}, pass.at(0));
  ASSERT_TRUE(fit);
  OtherPoses others;
  find_other_poses(pass.rig().camera, pass.rig().leds, true, pass.finder(),
                   {seen.data(), seen.size()}, fit->X_NB, 2, others);
  ASSERT_FALSE(others.empty());
  EXPECT_TRUE(std::is_sorted(others.begin(), others.end(),
                             [](const OtherPose& a, const OtherPose& b) {
                               return a.fit.rms_px < b.fit.rms_px;
                             }));
  const auto is_true = [&](const OtherPose& other) {
    return other.seen[0].leds == 1u << 2 && other.seen[1].leds == 1u << 3 &&
           apart_m(other.fit.X_NB, pass.at(0)) < 0.05;
  };
  EXPECT_TRUE(std::any_of(others.begin(), others.end(), is_true));
}

/// LED 2 has been taken for LED 0, a second long: that is found out. `Between` is done
/// after each picture.
template <class Between>
void expect_found_out(Pass& pass, PoseDoubt& doubt, Between&& between) {
  Pose X_NB = pass.at(0);
  for (int k = 0; k < 60; ++k) {
    const double t = k / 60.0;
    const auto seen = pass.see(t, {2, 3, 4, 5}, {0, 3, 4, 5});
    const auto fit = refine_pose(pass.rig().camera, pass.rig().leds,
                                 {seen.data(), seen.size()}, X_NB);
    if (!fit || fit->rms_px > 4) return;  // such a pose is not followed
    X_NB = fit->X_NB;
    pass.look(doubt, {seen.data(), seen.size()}, X_NB);
    between(t, X_NB);
    if (doubt.better() == nullptr) continue;
    EXPECT_LT(apart_m(doubt.better()->fit.X_NB, pass.at(t)), 0.05);
    EXPECT_EQ(doubt.better()->seen[0].leds, 1u << 2);
    return;
  }
  ADD_FAILURE() << "never found out";
}

void expect_found_out(Pass& pass, PoseDoubt& doubt) {
  expect_found_out(pass, doubt, [](double, const Pose&) {});
}

TEST_P(FewLeds, TakenForOthersAreFoundOutWithinASecond) {
  Pass pass(GetParam());
  PoseDoubt doubt({});
  expect_found_out(pass, doubt);
}

TEST_P(FewLeds, AreFoundOutThoughNoiseFeignsOneMoreNowAndThen) {
  Pass pass(GetParam());
  PoseDoubt doubt({});
  expect_found_out(pass, doubt, [&](double t, const Pose& X_NB) {
    // Noise where a wrong pose has another LED: of no reading but its own.
    auto more = pass.see(t, {2, 3, 4, 5}, {0, 3, 4, 5});
    LedObservation o = more[0];
    o.leds = 1u << 1;
    o.uv = *project_led(pass.rig().camera, X_NB, pass.rig().leds.p_BL(1));
    more.push_back(o);
    pass.look(doubt, {more.data(), more.size()}, X_NB);
  });
}

// For one picture the light of LED 2 has been taken for LED 0, which is not seen again.
TEST_P(FewLeds, OneThatIsGoneRaisesNoDoubtAnyMore) {
  Pass pass(GetParam());
  PoseDoubt doubt({});
  const auto taken = pass.see(0, {2, 3, 4, 5}, {0, 3, 4, 5});
  pass.look(doubt, {taken.data(), taken.size()}, pass.at(0));
  EXPECT_TRUE(doubt.open());
  for (int k = 1; k < 20; ++k) {
    const double t = k / 60.0;
    const auto seen = pass.see(t, {2, 3, 4, 5}, {2, 3, 4, 5});
    pass.look(doubt, {seen.data(), seen.size()}, pass.at(t));
    EXPECT_FALSE(doubt.open()) << k;
  }
}

TEST_P(FewLeds, TakenForWhatTheyAreAreNotGivenUp) {
  Pass pass(GetParam());
  PoseDoubt doubt({});
  for (int k = 0; k < 60; ++k) {
    const double t = k / 60.0;
    const auto seen = pass.see(t, {1, 2, 3, 5}, {1, 2, 3, 5});
    pass.look(doubt, {seen.data(), seen.size()}, pass.at(t));
    EXPECT_EQ(doubt.better(), nullptr) << k;
  }
  EXPECT_FALSE(doubt.open());
}

INSTANTIATE_TEST_SUITE_P(Seeds, FewLeds, testing::Range(1u, 21u));

TEST(PoseDoubt, AFlatBodySeenFromAfarMayBeMirrored) {
  Pass pass(3, 2.8);
  const Pose X_NB = make_pose(from_rpy(0, 0, 15 * kDegree), Vector3(-2.2, 0, 0.5));
  FixedVector<LedObservation, kMaxLeds> seen;
  for (const int led : {1, 2, 3, 4}) {  // all but flat
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << led);
    o.uv = *project_led(pass.rig().camera, X_NB, pass.rig().leds.p_BL(led));
    o.cov = 0.0025 * Matrix2::Identity();
    seen.push_back(o);
  }
  const ObservationSpan all(seen.data(), seen.size());
  const auto& [camera, leds] = std::tie(pass.rig().camera, pass.rig().leds);
  const auto mirrored = mirrored_pose(camera, leds, all, X_NB);
  ASSERT_TRUE(mirrored);
  EXPECT_GT(angle_between(mirrored->X_NB.linear(), X_NB.linear()), 10 * kDegree);
  EXPECT_LT(mirrored->rms_px, 1);
  const auto back = mirrored_pose(camera, leds, all, mirrored->X_NB);
  ASSERT_TRUE(back);
  EXPECT_LT(angle_between(back->X_NB.linear(), X_NB.linear()), 0.1 * kDegree);
}

TEST_P(FewLeds, OneThatComesLaterMayBeAnother) {
  Pass pass(GetParam());
  PoseDoubt doubt({});
  // Five are known; LED 0 was not among them.
  const auto five = pass.see(0, {1, 2, 3, 4, 5}, {1, 2, 3, 4, 5});
  doubt.be_sure({five.data(), five.size()});
  expect_found_out(pass, doubt);
}

TEST(PoseDoubt, LedsOnceKnownAreNotTakenForOthers) {
  Pass pass(5);
  PoseDoubt doubt({});
  const auto known = pass.see(0, {2, 3, 4, 5}, {0, 3, 4, 5});
  doubt.be_sure({known.data(), known.size()});
  for (int k = 0; k < 60; ++k) {
    const double t = k / 60.0;
    const auto seen = pass.see(t, {2, 3, 4, 5}, {0, 3, 4, 5});
    const auto fit = refine_pose(pass.rig().camera, pass.rig().leds,
                                 {seen.data(), seen.size()}, pass.at(t));
    ASSERT_TRUE(fit);
    pass.look(doubt, {seen.data(), seen.size()}, fit->X_NB);
    const OtherPose* better = doubt.better();
    EXPECT_TRUE(better == nullptr || better->seen[0].leds == 1u << 0) << k;
  }
}

/// A drone that hovers, four of its LEDs lit.
struct Hovers {
  Pass pass{3};
  Pose X_NB = Pose::Identity();

  FixedVector<LedObservation, kMaxLeds> see(Rng& rng) const {
    FixedVector<LedObservation, kMaxLeds> seen;
    for (const int led : {1, 2, 3, 4}) {  // all but flat
      LedObservation o;
      o.leds = static_cast<std::uint16_t>(1u << led);
      o.uv = *project_led(pass.rig().camera, X_NB, pass.rig().leds.p_BL(led)) +
             0.3 * Vector2(rng.normal(), rng.normal());
      o.cov = 0.09 * Matrix2::Identity();
      seen.push_back(o);
    }
    return seen;
  }
  /// Pictures, of 120, until another reading takes the place of this one.
  int follow(const Pose& as, const std::optional<Push>& push) const {
    Rng rng(5);
    PoseDoubt doubt({});
    int k = 0;
    for (; k < 120 && doubt.better() == nullptr; ++k) {
      const auto seen = see(rng);
      doubt.feel(push);
      pass.look(doubt, {seen.data(), seen.size()}, as);
    }
    return k;
  }
};

TEST(PoseDoubt, AMirrorImageThatLeansOtherwiseThanItFliesIsRefuted) {
  Hovers drone;
  Rng rng(5);
  int drones = 0, with = 0, without = 0;
  for (int n = 0; n < 400 && drones < 12; ++n) {
    drone.X_NB = make_pose(from_rpy(0, 0, rng.uniform(-40, 40) * kDegree),
                           Vector3(-rng.uniform(1.8, 2.6), 0, rng.uniform(0.8, 2)));
    const auto seen = drone.see(rng);
    const auto mirrored = mirrored_pose(drone.pass.rig().camera, drone.pass.rig().leds,
                                        {seen.data(), seen.size()}, drone.X_NB);
    if (!mirrored || mirrored->rms_px > 0.3 ||
        !drone.pass.finder().plausible(mirrored->X_NB) ||
        std::acos(mirrored->X_NB.linear()(2, 2)) < 35 * kDegree) {
      continue;
    }
    ++drones;
    const Push push{Vector3(0, 0, kGravity), 0.1 * Matrix3::Identity()};
    const auto longer = [&](const std::optional<Push>& felt) {
      return drone.follow(drone.X_NB, felt) - drone.follow(mirrored->X_NB, felt);
    };
    with += longer(push);
    without += longer(std::nullopt);
  }
  ASSERT_EQ(drones, 12);
  // By so many pictures longer the true one stands.
  EXPECT_GT(with, 12 * 60);
  EXPECT_GT(with, without + 60);
}

}  // namespace
}  // namespace alight
