#include "alight/mission/rival_poses.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "alight/base/rng.h"
#include "alight/mission/other_poses.h"
#include "alight/vision/led_finder.h"

namespace alight {
namespace {

Blob light(const Vector2& uv, Rng& rng) {
  Blob blob;
  blob.uv = uv + 0.1 * Vector2(rng.normal(), rng.normal());
  blob.cov = 0.01 * Matrix2::Identity();
  blob.spread = 1.2 * Matrix2::Identity();
  blob.area_px = 12;
  blob.brightness = 1500;
  blob.peak = 255;
  return blob;
}

/// An infrared drone that hovers about a place before the lens, some of its LEDs dark,
/// among lamps that stand still.
class Hall {
 public:
  Hall(const Rig& rig, int dark, int lamps, unsigned seed) : rig_(rig), rng_(seed) {
    for (;;) {
      const Vector3 p_NB(rng_.uniform(-1.2, -0.2), rng_.uniform(-0.4, 0.4),
                         rng_.uniform(0.3, 0.9));
      X_NB_ = make_pose(from_rpy(0, 0, rng_.uniform(-20, 20) * kDegree), p_NB);
      way_ = Vector3(rng_.normal(), rng_.normal(), rng_.normal()).normalized();
      bool inside = true;
      for (const double t : {0.0, 0.5, 1.0}) {
        for (const Led& led : rig.leds.leds) {
          const auto uv = project_led(rig.camera, at(t), led.p_BL);
          inside = inside && uv && rig.camera.intrinsics.contains(*uv, 20);
        }
      }
      if (inside) break;
    }
    lit_.assign(static_cast<std::size_t>(rig.leds.size()), true);
    for (int n = 0; n < dark;) {
      const auto i = static_cast<std::size_t>(rng_.uniform(0, rig.leds.size()));
      n += lit_[i];
      lit_[i] = false;
    }
    for (int n = 0; n < lamps; ++n) {
      lamps_.emplace_back(rng_.uniform(0, 847), rng_.uniform(0, 479));
    }
  }

  /// On its way at 0.5 m/s, swaying by 6 deg.
  Pose at(double t) const {
    const Matrix3 sway =
        from_rpy(6 * kDegree * std::sin(5 * t), 6 * kDegree * std::sin(4 * t), 0.2 * t);
    return make_pose(X_NB_.linear() * sway, X_NB_.translation() + 0.5 * t * way_);
  }

  std::vector<Blob> picture(double t) {
    std::vector<Blob> blobs;
    for (int i = 0; i < rig_.leds.size(); ++i) {
      if (!lit_[static_cast<std::size_t>(i)]) continue;
      blobs.push_back(light(*project_led(rig_.camera, at(t), rig_.leds.p_BL(i)), rng_));
    }
    for (const Vector2& lamp : lamps_) blobs.push_back(light(lamp, rng_));
    return blobs;
  }

  /// The pose by LEDs 2 to 5, each told for what `as` says.
  Result<PoseFit> read(double s, std::initializer_list<int> as) {
    const auto blobs = picture(s);
    FixedVector<LedObservation, kMaxLeds> seen;
    for (const int led : as) {
      LedObservation o;
      o.leds = static_cast<std::uint16_t>(1u << led);
      o.uv = blobs[seen.size() + 2].uv;
      o.cov = 0.01 * Matrix2::Identity();
      seen.push_back(o);
    }
    return refine_pose(rig_.camera, rig_.leds, {seen.data(), seen.size()}, at(s));
  }

 private:
  Rig rig_;
  Rng rng_;
  Pose X_NB_ = Pose::Identity();
  Vector3 way_;
  std::vector<bool> lit_;
  std::vector<Vector2> lamps_;
};

struct Start {
  double after_s = -1;  ///< Never, if negative.
  bool wrong = false;
};

/// Finder, tracker and rivals of a rig whose LEDs are of one colour.
struct Watcher {
  Rig rig = one_color();
  LedFinder finder = LedFinder::create({}, rig.camera, rig.leds).value();
  LedTracker tracker = LedTracker::create({}, rig.camera, rig.leds).value();
  RelativeFilter filter =
      RelativeFilter::create(RelativeFilterConfig::camera_only(), rig.camera, rig.leds)
          .value();
  RivalPoses rivals{{}, rig.camera, filter};

  static Rig one_color() {
    Rig rig = alan_rig();
    for (Led& led : rig.leds.leds) led.color = LedColor::none;
    return rig;
  }
};

Start start(Hall& hall, Watcher& watcher, double until_s) {
  const NoMotion motion;
  LedFinder& finder = watcher.finder;
  RivalPoses& rivals = watcher.rivals;
  rivals.clear();
  for (int k = 0; k / 60.0 <= until_s; ++k) {
    const double s = k / 60.0;
    const Time t = from_seconds(100 + s);
    const auto blobs = hall.picture(s);
    auto found = finder.find(blobs, t);
    if (!found) {
      found = rivals.decide(blobs, t, finder.left_open(), watcher.tracker, motion,
                            from_seconds(0.005));
    }
    if (!found) continue;
    const Pose truth = hall.at(s);
    const double off = (found->fit.X_NB.translation() - truth.translation()).norm();
    const double turned = angle_between(found->fit.X_NB.linear(), truth.linear());
    return {s, off > 0.15 || turned > 15 * kDegree};
  }
  return {};
}

struct Case {
  const char* name;
  int dark, lamps, seeds;
  double started_share;
};
class RivalPosesMany : public testing::TestWithParam<Case> {};

TEST_P(RivalPosesMany, OneIsLeftWithinHalfASecondAndItIsRight) {
  const Case c = GetParam();
  Watcher watcher;
  int started = 0;
  for (int seed = 0; seed < c.seeds; ++seed) {
    Hall hall(watcher.rig, c.dark, c.lamps, static_cast<unsigned>(seed));
    const Start s = start(hall, watcher, 0.5);
    started += s.after_s >= 0;
    if (s.wrong) ADD_FAILURE() << "seed " << seed << " after " << s.after_s << " s";
  }
  RecordProperty("started", started);
  EXPECT_GE(started, c.started_share * c.seeds);
}
INSTANTIATE_TEST_SUITE_P(Cases, RivalPosesMany,
                         testing::Values(Case{"AllLit", 0, 0, 40, 0.95},
                                         Case{"TwoDark", 2, 0, 40, 0.9},
                                         Case{"TwoDarkAmong100", 2, 100, 4, 0}),
                         [](const auto& of) { return of.param.name; });

/// What the rivals say of LEDs 2 to 5 at `s`, `fresh` having been proposed.
Result<FoundLeds> decide(Watcher& watcher, Hall& hall, double s,
                         const std::vector<LedRival>& fresh) {
  auto blobs = hall.picture(s);
  blobs.erase(blobs.begin(), blobs.begin() + 2);
  return watcher.rivals.decide(blobs, from_seconds(100 + s), fresh, watcher.tracker,
                               NoMotion{}, from_seconds(0.005));
}

/// Four lights that are read as other LEDs from the first picture on, and as what they
/// are only later: who came first has no right to stay.
TEST(RivalPoses, WhoComesLaterStartsLevel) {
  Watcher watcher;
  int halls = 0, told = 0, right = 0;
  for (unsigned seed = 0; seed < 80; ++seed) {
    Hall hall(watcher.rig, 0, 0, seed);
    const auto taken = hall.read(0, {1, 3, 4, 5});
    if (!taken || taken->rms_px > 1 ||
        angle_between(taken->X_NB.linear(), hall.at(0).linear()) < 15 * kDegree) {
      continue;  // such a pose is not followed, or no other
    }
    ++halls;
    watcher.rivals.clear();
    for (int k = 0; k < 40; ++k) {
      const double s = k / 60.0;
      std::vector<LedRival> fresh;
      const auto wrong = hall.read(s, {1, 3, 4, 5}),
                 as_they_are = hall.read(s, {2, 3, 4, 5});
      if (wrong && wrong->rms_px < 1) fresh.push_back({wrong->X_NB, wrong->cov, 4});
      if (k >= 7 && as_they_are) {
        fresh.push_back({as_they_are->X_NB, as_they_are->cov, 4});
      }
      const auto found = decide(watcher, hall, s, fresh);
      if (!found) continue;
      ++told;
      right +=
          angle_between(found->fit.X_NB.linear(), hall.at(s).linear()) < 10 * kDegree;
      break;
    }
  }
  EXPECT_GE(halls, 10);
  EXPECT_GE(told, halls / 2);
  EXPECT_GE(right,
            0.6 * told);  // of those that came later; none, were it age that counts
}

/// Another reading that is proposed again and again, and fits worse each time, does not
/// hold up the one that fits.
TEST(RivalPoses, WhoComesLateAndFitsWorseStartsBehind) {
  Watcher watcher;
  int halls = 0, told = 0;
  for (unsigned seed = 0; seed < 80; ++seed) {
    Hall hall(watcher.rig, 0, 0, seed);
    const auto taken = hall.read(0, {1, 3, 4, 5});
    if (!taken || taken->rms_px < 0.5 || taken->rms_px > 2 ||
        angle_between(taken->X_NB.linear(), hall.at(0).linear()) < 15 * kDegree) {
      continue;
    }
    ++halls;
    watcher.rivals.clear();
    for (int k = 0; k < 13; ++k) {
      const double s = k / 60.0;
      std::vector<LedRival> fresh;
      const auto wrong = hall.read(s, {1, 3, 4, 5}),
                 as_they_are = hall.read(s, {2, 3, 4, 5});
      if (as_they_are) fresh.push_back({as_they_are->X_NB, as_they_are->cov, 4});
      if (k >= 9 && wrong) fresh.push_back({wrong->X_NB, wrong->cov, 4});
      const auto found = decide(watcher, hall, s, fresh);
      if (!found) continue;
      ++told;
      EXPECT_LT(angle_between(found->fit.X_NB.linear(), hall.at(s).linear()),
                10 * kDegree)
          << seed;
      break;
    }
  }
  EXPECT_GE(halls, 10);
  EXPECT_GE(told, 0.8 * halls);
}

/// Four LEDs in a plane are seen alike from afar turned to either side of the line of
/// sight; but a drone that goes straight on stands level.
TEST(RivalPoses, WhoLeansOtherwiseThanItFliesIsWrong) {
  Rig rig = alan_rig();
  rig.leds.leds.clear();
  for (const double y : {-0.08, 0.08}) {
    for (const double z : {-0.03, 0.03}) {
      rig.leds.leds.push_back({Vector3(0.06, y, z), LedColor::none});
    }
  }
  auto tracker = LedTracker::create({}, rig.camera, rig.leds).value();
  const auto filter =
      RelativeFilter::create(RelativeFilterConfig::camera_only(), rig.camera, rig.leds)
          .value();
  RivalPoses rivals({}, rig.camera, filter);
  const NoMotion motion;
  int started = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    const Vector3 from(rng.uniform(-2.2, -1.8), rng.uniform(-0.3, 0.3),
                       rng.uniform(1.1, 1.4));
    const Vector3 way(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), 0.2);
    const double heading = rng.uniform(-15, 15) * kDegree;
    rivals.clear();
    for (int k = 0; k < 60; ++k) {
      const double s = k / 60.0;
      const Pose X_NB = make_pose(from_rpy(0, 0, heading), from + s * way);
      std::vector<Blob> blobs;
      FixedVector<LedObservation, kMaxLeds> seen;
      for (int i = 0; i < rig.leds.size(); ++i) {
        blobs.push_back(light(*project_led(rig.camera, X_NB, rig.leds.p_BL(i)), rng));
        LedObservation o;
        o.leds = static_cast<std::uint16_t>(1u << i);
        o.uv = blobs.back().uv;
        o.cov = blobs.back().cov;
        seen.push_back(o);
      }
      const ObservationSpan lights(seen.data(), seen.size());
      std::vector<LedRival> fresh;
      const auto own = refine_pose(rig.camera, rig.leds, lights, X_NB);
      if (own) fresh.push_back({own->X_NB, own->cov, 4});
      const auto other = mirrored_pose(rig.camera, rig.leds, lights, X_NB);
      if (k == 0) {
        ASSERT_TRUE(other) << seed;
        ASSERT_GT(std::acos(other->X_NB.linear()(2, 2)), 25 * kDegree) << seed;
      }
      if (other) fresh.push_back({other->X_NB, other->cov, 4});
      const auto found =
          rivals.decide(blobs, from_seconds(100 + s), {fresh.data(), fresh.size()},
                        tracker, motion, from_seconds(0.005));
      if (!found) continue;
      ++started;
      EXPECT_LT(std::acos(found->fit.X_NB.linear()(2, 2)), 15 * kDegree) << seed;
      break;
    }
  }
  EXPECT_GE(started, 15);
}

/// Lamps that do not move are never taken for a drone, however long one looks.
TEST(RivalPoses, LampsAloneAreNoDrone) {
  Watcher watcher;
  for (unsigned seed = 0; seed < 3; ++seed) {
    Hall hall(watcher.rig, 6, 20 + 5 * static_cast<int>(seed), seed);
    EXPECT_LT(start(hall, watcher, 0.4).after_s, 0) << seed;
  }
}

}  // namespace
}  // namespace alight
