#include "alight/vision/led_resolver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <vector>

#include "alight/vision/blob_detector.h"
#include "alight/vision/test/scene.h"

namespace alight {
namespace {

using test::Picture;

struct Scene {
  Rig rig = alan_rig();
  Pose X_NB;
  Picture picture;
  BlobDetector detector = *BlobDetector::create({}, 848, 480);
  FixedVector<Vector2, kMaxLeds> still;

  explicit Scene(Rng& rng, double range_min, double range_max, std::uint16_t dark = 0,
                 double skirt = 0) {
    X_NB = test::random_pose(rig, rng, range_min, range_max);
    for (int i = 0; i < rig.leds.size(); ++i) {
      still.push_back(Vector2::Zero());
      if ((dark >> i) & 1) continue;
      const Vector2 uv = *project_led(rig.camera, X_NB, rig.leds.p_BL(i));
      const double peak = rng.uniform(90, 220);
      picture.add(uv, rig.leds.color(i), peak, 0.9);
      if (skirt > 0) {
        picture.add(uv, rig.leds.color(i), skirt * peak,
                    0.9 * std::sqrt(PointSpread::kSkirtUsual));
      }
    }
    picture.expose(rng);
  }

  BlobSpan blobs() { return *detector.detect(picture.view()); }
  LedResolver resolver() const {
    return *LedResolver::create({}, rig.camera, rig.leds);
  }
  double error_px(const LedObservation& o) const {
    return (*project_observation(rig.camera, X_NB, rig.leds, o.leds) - o.uv).norm();
  }
  Pose predicted(Rng& rng) const {
    Vector3 off_m, turn;
    for (int k = 0; k < 3; ++k) {
      off_m[k] = 0.002 * rng.normal();
      turn[k] = 0.005 * rng.normal();
    }
    return make_pose(X_NB.linear() * so3_exp(turn), X_NB.translation() + off_m);
  }
};

TEST(LedResolver, FollowsEveryLedWhereBlobsRunTogether) {
  Rng rng(1);
  int runs = 0, followed = 0, leds = 0, wrong = 0, grouped = 0;
  double square = 0;
  for (; runs < 150; ++runs) {
    Scene scene(rng, 1.5, 3);
    LedResolver resolver = scene.resolver();
    const auto frame =
        resolver.follow(scene.picture.view(), scene.blobs(), scene.predicted(rng), 2.5,
                        {scene.still.data(), scene.still.size()}, 0);
    if (!frame) continue;
    ++followed;
    leds += static_cast<int>(frame->seen.size());
    grouped += static_cast<int>(frame->groups.size());
    for (const LedObservation& o : frame->seen) {
      EXPECT_TRUE(std::has_single_bit(o.leds));
      square += scene.error_px(o) * scene.error_px(o);
      if (scene.error_px(o) > 0.5) ++wrong;
    }
    for (const OverlappingLeds& group : frame->groups) {
      EXPECT_GE(group.count, 2);
      EXPECT_LE(static_cast<std::size_t>(group.first + group.count),
                frame->seen.size());
      EXPECT_EQ(group.information.rows(), 2 * group.count);
    }
  }
  EXPECT_GT(grouped, 50);  // else nothing ran together
  EXPECT_GE(followed, 0.9 * runs);
  EXPECT_GE(leds, 5.8 * followed);
  EXPECT_LE(wrong, 0.005 * leds);
  EXPECT_LT(std::sqrt(square / leds), 0.12);
}

// Nearly three times as bright as the others, two of them together cover more than four
// times what one of those does.
TEST(LedResolver, BrightLedsThatRunTogetherAreNoLamp) {
  Rng rng(4);
  int runs = 0, followed = 0;
  while (runs < 100) {
    Scene scene(rng, 1.5, 3, 0x3f);
    std::vector<Vector2> uv;
    for (const Led& led : scene.rig.leds.leds) {
      uv.push_back(*project_led(scene.rig.camera, scene.X_NB, led.p_BL));
    }
    double nearest = 1e9;
    std::size_t a = 0, b = 0;
    for (std::size_t i = 0; i < uv.size(); ++i) {
      for (std::size_t k = 0; k < i; ++k) {
        const double d = (uv[i] - uv[k]).norm();
        if (d >= nearest) continue;
        nearest = d;
        a = i;
        b = k;
      }
    }
    if (!(nearest > 2 && nearest < 4)) continue;
    const auto shine = [&](std::size_t i, double peak) {
      scene.picture.add(uv[i], scene.rig.leds.color(static_cast<int>(i)), peak, 0.9);
    };
    LedResolver resolver = scene.resolver();
    const auto follow = [&](Time t) {
      scene.picture.expose(rng);
      return resolver.follow(scene.picture.view(), scene.blobs(), scene.predicted(rng),
                             2.5, {scene.still.data(), scene.still.size()}, t);
    };
    for (std::size_t i = 0; i < uv.size(); ++i) shine(i, 90);
    if (!follow(0)) continue;  // that all of them shine is not known
    ++runs;
    shine(a, 160);
    shine(b, 160);
    followed += follow(1).has_value();
  }
  RecordProperty("followed", followed);
  EXPECT_GE(followed, 0.9 * runs);
}

TEST(LedResolver, AnLedThatIsDarkIsLeftOut) {
  Rng rng(2);
  int runs = 0, followed = 0, ghosts = 0;
  for (; runs < 120; ++runs) {
    const int dark = runs % 6;
    Scene scene(rng, 0.6, 2.5, static_cast<std::uint16_t>(1u << dark));
    LedResolver resolver = scene.resolver();
    const auto frame =
        resolver.follow(scene.picture.view(), scene.blobs(), scene.predicted(rng), 2.5,
                        {scene.still.data(), scene.still.size()}, 0);
    if (!frame) continue;
    ++followed;
    for (const LedObservation& o : frame->seen) {
      if (o.leds == (1u << dark) && o.cov.trace() < 0.1) ++ghosts;
    }
  }
  EXPECT_GE(followed, 0.8 * runs);
  EXPECT_LE(ghosts, 0.03 * followed);
}

// Of a light that runs together with where a dead LED would shine noise makes two.
TEST(LedResolver, ADeadLedIsNotMadeOfItsNeighboursLight) {
  Rng rng(12);
  int runs = 0, ghosts = 0, came_back = 0, missed = 0;
  while (runs < 60) {
    const int dead = runs % 6;
    Rng same = rng;
    Scene lit(rng, 2, 3), scene(same, 2, 3, static_cast<std::uint16_t>(1u << dead));
    const auto uv = [&](int led) {
      return *project_led(lit.rig.camera, lit.X_NB, lit.rig.leds.p_BL(led));
    };
    double nearest = 100;
    for (int i = 0; i < 6; ++i) {
      if (i != dead) nearest = std::min(nearest, (uv(i) - uv(dead)).norm());
    }
    if (nearest > 3.5) continue;
    ++runs;
    LedResolver resolver = scene.resolver();
    const auto seen = [&](Scene& of, Time t) {
      const auto frame =
          resolver.follow(of.picture.view(), of.blobs(), scene.predicted(rng), 2.5,
                          {of.still.data(), of.still.size()}, t);
      return frame && std::any_of(frame->seen.begin(), frame->seen.end(),
                                  [&](const LedObservation& o) {
                                    return o.leds == (1u << dead);
                                  });
    };
    for (int k = 0; k < 40; ++k) (void)seen(scene, k);
    for (int k = 40; k < 50; ++k) ghosts += seen(scene, k);
    // It shines again.
    (seen(lit, 50) || seen(lit, 51) ? came_back : missed) += 1;
  }
  EXPECT_LE(ghosts, 6) << "of " << 10 * runs;
  EXPECT_GE(came_back, 0.6 * runs);
}

TEST(LedResolver, ADimLedIsSeenBesideADeadOne) {
  Rng rng(14);
  const Rig rig = alan_rig();
  int runs = 0, followed = 0, dim_seen = 0, ghosts = 0;
  while (runs < 40) {
    Rng same = rng;
    const Pose X_NB = test::random_pose(rig, same, 1.8, 2.6);
    std::vector<Vector2> uv;
    for (const Led& led : rig.leds.leds) {
      uv.push_back(*project_led(rig.camera, X_NB, led.p_BL));
    }
    // The dead one comes first in some of the pairs.
    const std::size_t dim = static_cast<std::size_t>(runs) % 6;
    std::size_t dead = dim == 0 ? 1 : 0;
    for (std::size_t i = 0; i < uv.size(); ++i) {
      if (i != dim && (uv[i] - uv[dim]).norm() < (uv[dead] - uv[dim]).norm()) dead = i;
    }
    bool alone = (uv[dead] - uv[dim]).norm() < 3.5;
    for (std::size_t i = 0; i < uv.size(); ++i) {
      if (i == dead || i == dim) continue;
      alone = alone && (uv[i] - uv[dim]).norm() > 7 && (uv[i] - uv[dead]).norm() > 7;
    }
    if (!alone) {
      rng = same;
      continue;
    }
    ++runs;
    Scene scene(rng, 1.8, 2.6, 0x3f);
    for (std::size_t i = 0; i < uv.size(); ++i) {
      if (i == dead) continue;
      const double peak = i == dim ? 45 : 140;
      scene.picture.add(uv[i], rig.leds.color(static_cast<int>(i)), peak, 0.9);
    }
    scene.picture.expose(rng);
    LedResolver resolver = scene.resolver();
    for (int k = 0; k < 40; ++k) {
      if (k >= 36) scene.picture.expose(rng);
      const auto frame =
          resolver.follow(scene.picture.view(), scene.blobs(), scene.predicted(rng),
                          2.5, {scene.still.data(), scene.still.size()}, k);
      if (!frame || (k > 0 && k < 36)) continue;
      ++followed;
      for (const LedObservation& o : frame->seen) {
        dim_seen += o.leds == (1u << dim) && scene.error_px(o) < 0.5;
        ghosts += o.leds == (1u << dead);
      }
    }
  }
  EXPECT_GE(followed, 0.9 * 5 * runs);
  EXPECT_GE(dim_seen, 0.9 * followed);
  EXPECT_LE(ghosts, 0.1 * followed);
}

// Behind the edge of what covers part of the picture.
TEST(LedResolver, AnLedThatIsHalfCoveredSaysHowVaguelyItIsPlaced) {
  Rng rng(5);
  int seen = 0;
  double normalized = 0, off = 0;
  for (int run = 0; run < 200; ++run) {
    Scene scene(rng, 0.6, 1.2);
    LedResolver resolver = scene.resolver();
    const std::span<const Vector2> still(scene.still.data(), scene.still.size());
    if (!resolver.follow(scene.picture.view(), scene.blobs(), scene.X_NB, 2.5, still,
                         0)) {
      continue;
    }
    const int led = run % scene.rig.leds.size();
    const Vector2 uv =
        *project_led(scene.rig.camera, scene.X_NB, scene.rig.leds.p_BL(led));
    scene.picture.cover_left_of(static_cast<int>(std::lround(uv.x())), uv, 6);
    const auto frame =
        resolver.follow(scene.picture.view(), scene.blobs(), scene.X_NB, 2.5, still, 1);
    if (!frame) continue;
    for (const LedObservation& o : frame->seen) {
      if (o.leds != (1u << led)) continue;
      const Vector2 e =
          *project_observation(scene.rig.camera, scene.X_NB, scene.rig.leds, o.leds) -
          o.uv;
      ++seen;
      off += e.norm();
      normalized += e.dot(o.cov.inverse() * e);
    }
  }
  ASSERT_GT(seen, 60);
  EXPECT_GT(off / seen, 0.2);         // px: what is left of its light misleads,
  EXPECT_LT(normalized / seen, 6.0);  // and its covariance, of 2, says so
}

TEST(LedResolver, ALightNearbyThatMayBeTheMissingLedIsSomebodyElsesTask) {
  Rng rng(3);
  int handed_on = 0;
  for (int run = 0; run < 40; ++run) {
    Scene scene(rng, 0.8, 1.2, 1u << 3);
    const Vector2 led =
        *project_led(scene.rig.camera, scene.X_NB, scene.rig.leds.p_BL(3));
    scene.picture.add(led + Vector2(0, -14), LedColor::red, 200, 0.9);
    scene.picture.expose(rng);
    LedResolver resolver = scene.resolver();
    if (!resolver.follow(scene.picture.view(), scene.blobs(), scene.X_NB, 2.5,
                         {scene.still.data(), scene.still.size()}, 0)) {
      ++handed_on;
    }
  }
  EXPECT_GE(handed_on, 36);
}

TEST(LedResolver, ALampInFrontOfAnLedIsNotFollowedInItsPlace) {
  Rng rng(10);
  int wrong = 0;
  for (int run = 0; run < 120; ++run) {
    Scene scene(rng, 1, 2.5);
    LedResolver resolver = scene.resolver();
    const std::span<const Vector2> still(scene.still.data(), scene.still.size());
    resolver.follow(scene.picture.view(), scene.blobs(), scene.predicted(rng), 2.5,
                    still, 0);
    // A row of slats whose middle goes by.
    const int under = run % 6;
    const Vector2 led =
        *project_led(scene.rig.camera, scene.X_NB, scene.rig.leds.p_BL(under));
    const double turn = rng.uniform(0, kPi);
    const Vector2 along(std::cos(turn), std::sin(turn));
    const Vector2 middle = led + rng.uniform(1, 3) * Vector2(-along.y(), along.x());
    for (int k = -4; k <= 4; ++k) {
      scene.picture.add(middle + 4.0 * k * along, LedColor::white, 2000, 1.1);
    }
    scene.picture.expose(rng);
    const auto frame = resolver.follow(scene.picture.view(), scene.blobs(),
                                       scene.predicted(rng), 2.5, still, 1);
    if (!frame) continue;
    for (const LedObservation& o : frame->seen) {
      const double off = scene.error_px(o);
      if (off > 0.7 && off * off > 9 * o.cov.trace()) ++wrong;
    }
  }
  EXPECT_LE(wrong, 1);
}

/// Both ways to look at a picture: by the resolver alone, and after the tracker.
struct Looks {
  Looks(Scene& scene_in, Rng& rng_in)
      : scene(scene_in), rng(rng_in), resolver(scene_in.resolver()) {
    cov.diagonal() << Vector3::Constant(4e-6), Vector3::Constant(2.5e-5);
  }

  /// Whether it is seen by any.
  bool at(int led) {
    const std::span<const Vector2> still(scene.still.data(), scene.still.size());
    const Pose X_NB = scene.predicted(rng);
    std::vector<LedFrame> frames;
    if (const auto f =
            resolver.follow(scene.picture.view(), scene.blobs(), X_NB, 2.5, still, 1)) {
      frames.push_back(*f);
    }
    TrackDetail detail;
    LedFrame tracked = tracker.track(scene.blobs(), X_NB, cov, 1, &detail);
    resolver.resolve(scene.picture.view(), scene.blobs(), detail, still, tracked);
    frames.push_back(tracked);
    bool seen = false;
    for (const LedFrame& frame : frames) {
      for (const LedObservation& o : frame.seen) {
        const double off = scene.error_px(o);
        if (off > 0.7 && off * off > 9 * o.cov.trace()) ++wrong;
        seen = seen || ((o.leds >> led) & 1) != 0;
      }
    }
    for (const RefusedBlob& r : tracked.refused) {
      named += r.reason == Refusal::too_large;
    }
    return seen;
  }

  Scene& scene;
  Rng& rng;
  LedResolver resolver;
  LedTracker tracker = *LedTracker::create({}, alan_rig().camera, alan_rig().leds);
  Matrix6 cov = Matrix6::Zero();
  int wrong = 0, named = 0;
};

// So near the lens an LED is a disc that keeps its middle, and runs together with a
// slat that is about as large.
TEST(LedResolver, ALampThatRunsOnFromALargeLedDoesNotMoveIt) {
  Rng rng(15);
  int wrong = 0, alone = 0, kept = 0, named = 0, left_out = 0;
  for (int run = 0; run < 120; ++run) {
    Scene scene(rng, 0.3, 0.45, 0x3f);
    const auto draw = [&] {
      for (int i = 0; i < 6; ++i) {
        const Vector2 uv =
            *project_led(scene.rig.camera, scene.X_NB, scene.rig.leds.p_BL(i));
        scene.picture.add(uv, scene.rig.leds.color(i), 3000, 1.8);
      }
      scene.picture.expose(rng);
    };
    draw();
    Looks look(scene, rng);
    const int under = run % 6;
    kept += look.at(under);
    const Vector2 led =
        *project_led(scene.rig.camera, scene.X_NB, scene.rig.leds.p_BL(under));
    const double turn = rng.uniform(0, 2 * kPi);
    const Vector2 along(std::cos(turn), std::sin(turn));
    for (int k = 0; k < 5; ++k) {
      scene.picture.add(led + (4.0 + 2.0 * k) * along, LedColor::white, 1500, 1.3);
    }
    scene.picture.expose(rng);
    ++alone;
    left_out += !look.at(under);
    wrong += look.wrong;
    named += look.named;
  }
  EXPECT_EQ(kept, alone);
  EXPECT_GE(left_out, 0.5 * alone);
  EXPECT_GE(named, 0.2 * alone);
  EXPECT_LE(wrong, 0.02 * alone);
}

// A lamp and an LED in one round blob: only its size tells, beside LEDs as bright.
TEST(LedResolver, ABlobThatHasOutgrownItsLikeIsNoLed) {
  Rng rng(16);
  int wrong = 0, kept = 0, left_out = 0;
  constexpr int kRuns = 120;
  for (int run = 0; run < kRuns; ++run) {
    Scene scene(rng, 0.7, 0.9, 0x3f);
    for (int i = 0; i < 6; ++i) {
      const Vector2 uv =
          *project_led(scene.rig.camera, scene.X_NB, scene.rig.leds.p_BL(i));
      scene.picture.add(uv, scene.rig.leds.color(i), 450, 1.3);
    }
    scene.picture.expose(rng);
    Looks look(scene, rng);
    const int under = run % 6;
    kept += look.at(under);
    const Vector2 led =
        *project_led(scene.rig.camera, scene.X_NB, scene.rig.leds.p_BL(under));
    const double turn = rng.uniform(0, 2 * kPi);
    const Vector2 off = rng.uniform(3.2, 4.2) * Vector2(std::cos(turn), std::sin(turn));
    scene.picture.add(led + off, LedColor::white, 1500, 1.9);
    scene.picture.expose(rng);
    left_out += !look.at(under);
    wrong += look.wrong;
  }
  EXPECT_EQ(kept, kRuns);
  EXPECT_GE(left_out, 0.7 * kRuns);
  EXPECT_LE(wrong, 0.06 * kRuns);  // 1.8 without
}

// A lamp alone in an LED's place, as bright and as large: only its past tells.
TEST(LedResolver, AKnownStrayInAnLedsPlaceIsLeftOut) {
  Rng rng(14);
  Matrix6 cov = Matrix6::Zero();
  cov.diagonal() << Vector3::Constant(4e-6), Vector3::Constant(2.5e-5);
  int as_led = 0, held = 0;
  for (int run = 0; run < 40; ++run) {
    const unsigned gone = static_cast<unsigned>(run) % 6;
    Scene scene(rng, 1, 2, 1u << gone);
    const Vector2 lamp = *project_led(scene.rig.camera, scene.X_NB,
                                      scene.rig.leds.p_BL(static_cast<int>(gone)));
    scene.picture.add(lamp + Vector2(0.4, 0.3), LedColor::white, 600, 0.9);
    scene.picture.expose(rng);
    const std::span<const Vector2> still(scene.still.data(), scene.still.size());
    const BlobSpan blobs = scene.blobs();
    std::vector<Blob> marked(blobs.begin(), blobs.end());
    for (Blob& blob : marked) blob.stray = (blob.uv - lamp).norm() < 1;
    for (const bool known : {false, true}) {
      const BlobSpan seen =
          known ? BlobSpan(marked.data(), marked.size()) : scene.blobs();
      LedResolver resolver = scene.resolver();
      const LedFrame frame =
          resolver.hold(scene.picture.view(), seen, scene.X_NB, cov, 0, still, 0);
      bool taken = false;
      for (const LedObservation& o : frame.seen) taken |= ((o.leds >> gone) & 1) != 0;
      if (!known) {
        as_led += taken;
        continue;
      }
      EXPECT_FALSE(taken) << run;
      held += static_cast<int>(frame.seen.size()) >= 3;
      const auto followed =
          resolver.follow(scene.picture.view(), seen, scene.X_NB, 2.5, still, 1);
      if (!followed) continue;
      for (const LedObservation& o : followed->seen) {
        EXPECT_EQ((o.leds >> gone) & 1, 0) << run;
      }
    }
  }
  EXPECT_GT(as_led, 10) << "else there is nothing to tell";
  EXPECT_GT(held, 10);
}

TEST(LedResolver, HoldsTheLedsThatARowOfLampsLeavesInView) {
  Rng rng(8);
  Matrix6 cov = Matrix6::Zero();
  cov.diagonal() << Vector3::Constant(4e-6), Vector3::Constant(2.5e-5);
  int runs = 0, leds = 0, wrong = 0, most = 0, covered = 0;
  for (; runs < 80; ++runs) {
    Scene scene(rng, 1.5, 2.5);
    LedResolver resolver = scene.resolver();
    resolver.follow(scene.picture.view(), scene.blobs(), scene.predicted(rng), 2.5,
                    {scene.still.data(), scene.still.size()}, 0);
    // Slats aslant over one of them, brighter than any LED.
    const int under = runs % 6;
    const Vector2 at =
        *project_led(scene.rig.camera, scene.X_NB, scene.rig.leds.p_BL(under));
    const double turn = rng.uniform(0, kPi);
    for (int k = -4; k <= 4; ++k) {
      scene.picture.add(at + 4.0 * k * Vector2(std::cos(turn), std::sin(turn)),
                        LedColor::white, 2000, 1.1);
    }
    scene.picture.expose(rng);
    const LedFrame frame =
        resolver.hold(scene.picture.view(), scene.blobs(), scene.predicted(rng), cov, 0,
                      {scene.still.data(), scene.still.size()}, 0);
    most = std::max(most, static_cast<int>(frame.seen.size()));
    for (const LedObservation& o : frame.seen) {
      ++leds;
      if (o.leds == (1u << under)) ++covered;
      if (scene.error_px(o) > 0.6) ++wrong;
    }
  }
  EXPECT_GE(most, 5);
  EXPECT_GE(leds, 1.5 * runs);
  EXPECT_LE(covered, 0.02 * runs);
  EXPECT_LE(wrong, 0.02 * leds);
}

TEST(LedResolver, HoldsNothingByAVaguePrediction) {
  Rng rng(9);
  Scene scene(rng, 1, 2);
  LedResolver resolver = scene.resolver();
  const Matrix6 vague = 1e-3 * Matrix6::Identity();  // 3 cm
  EXPECT_TRUE(resolver
                  .hold(scene.picture.view(), scene.blobs(), scene.X_NB, vague, 0,
                        {scene.still.data(), scene.still.size()}, 0)
                  .seen.empty());
}

TEST(LedResolver, LearnsThePointSpread) {
  Rng rng(4);
  LedResolver resolver = Scene(rng, 1, 2).resolver();
  for (int run = 0; run < 60; ++run) {
    Scene scene(rng, 1.5, 3);
    resolver.follow(scene.picture.view(), scene.blobs(), scene.X_NB, 2.5,
                    {scene.still.data(), scene.still.size()}, 0);
  }
  EXPECT_NEAR(resolver.spread().variance_px2, 0.81, 0.08);
  EXPECT_LT(resolver.spread().share_sd, 0.1);
}

TEST(LedResolver, LearnsTheSkirtAndPlacesCloseLedsByIt) {
  Rng rng(11);
  constexpr double kSkirt = 0.06;
  LedResolver resolver = Scene(rng, 1, 2).resolver();
  double square = 0;
  int count = 0;
  for (int run = 0; run < 160; ++run) {
    Scene scene(rng, 2, 3, 0, kSkirt);
    const auto seen = resolver.follow(scene.picture.view(), scene.blobs(), scene.X_NB,
                                      2.5, {scene.still.data(), scene.still.size()}, 0);
    if (!seen || run < 60) continue;
    for (const LedObservation& o : seen->seen) {
      if (!(o.cov.trace() < 2 * 0.1 * 0.1)) continue;
      square += scene.error_px(o) * scene.error_px(o) / 2;
      ++count;
    }
  }
  EXPECT_NEAR(resolver.spread().skirt, kSkirt, 0.01);
  EXPECT_GT(count, 300);
  EXPECT_LT(std::sqrt(square / count), 0.03);
}

TEST(LedResolver, TheFirstPictureClaimsTheNoiseThatItHas) {
  // Of a camera whose lights have skirts, of which nothing is known yet.
  Rng rng(12);
  double nis = 0;
  int count = 0;
  for (int run = 0; run < 60; ++run) {
    Scene scene(rng, 1.5, 2.5, 0, 0.06);
    const auto tracker = *LedTracker::create({}, scene.rig.camera, scene.rig.leds);
    TrackDetail detail;
    const auto blobs = scene.blobs();
    LedFrame frame =
        tracker.track(blobs, scene.X_NB, 1e-6 * Matrix6::Identity(), 0, &detail);
    LedResolver resolver = scene.resolver();
    resolver.resolve(scene.picture.view(), blobs, detail,
                     {scene.still.data(), scene.still.size()}, frame);
    EXPECT_NEAR(resolver.spread().skirt, 0.06, 0.05) << run;
    for (const LedObservation& o : frame.seen) {
      if (!(o.cov.trace() < 2 * 0.1 * 0.1)) continue;
      nis += std::pow(scene.error_px(o), 2) / o.cov.trace();
      ++count;
    }
  }
  EXPECT_GT(count, 150);
  EXPECT_GT(nis / count, 0.4);
  EXPECT_LT(nis / count, 2);
}

TEST(LedResolver, NamesTheBoundThatDoesNotHold) {
  LedResolverConfig config;
  config.spread_sd_px = 0;
  const auto resolver = LedResolver::create(config, Camera{}, Constellation{});
  ASSERT_FALSE(resolver);
  EXPECT_NE(resolver.error().detail.find("resolver.spread_sd_px"), std::string::npos);
}

}  // namespace
}  // namespace alight
