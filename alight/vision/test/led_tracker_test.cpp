#include "alight/vision/led_tracker.h"

#include <gtest/gtest.h>

#include <bit>

#include "scene.h"

namespace alight {
namespace {

Matrix6 loose_covariance() {
  Matrix6 cov = Matrix6::Zero();
  cov.diagonal() << 1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3;
  return cov;
}

LedTracker make_tracker(const Rig& rig, LedTrackerConfig config = {}) {
  return *LedTracker::create(config, rig.camera, rig.leds);
}

/// The true pose with the prediction's error: up to 15 px sideways, 10 % in range, 3
/// deg.
Pose nudged(const Rig& rig, const Pose& X_NB, Rng& rng) {
  const Pose X_CN = rig.camera.X_NC.inverse();
  Vector3 p_CB = X_CN * X_NB.translation();
  const double px = p_CB.z() / rig.camera.intrinsics.fx;
  const double way = rng.uniform(0, 2 * kPi), shift = rng.uniform(0, 15) * px;
  p_CB *= rng.uniform(0.91, 1.1);
  p_CB += shift * Vector3(std::cos(way), std::sin(way), 0);
  const Vector3 turn = 3 * kDegree * Vector3(rng.normal(), rng.normal(), rng.normal());
  return make_pose(X_NB.linear() * so3_exp(turn.cwiseMax(-0.1).cwiseMin(0.1)),
                   rig.camera.X_NC * p_CB);
}

struct Case {
  const char* name;
  int hidden;
  int strays_near;
  bool color;
  double range_max;
};
class LedTrackerMany : public testing::TestWithParam<Case> {};

TEST_P(LedTrackerMany, NeverSwapsAndSeldomMisses) {
  const Case c = GetParam();
  const Rig rig = alan_rig();
  const LedTracker tracker = make_tracker(rig);
  int wrong = 0, seen = 0, there = 0;
  for (unsigned seed = 0; seed < 1000; ++seed) {
    Rng rng(seed);
    const Pose X_NB = test::random_pose(rig, rng, 0.4, c.range_max);
    std::vector<Blob> blobs;
    Vector2 middle = Vector2::Zero();
    for (int i = c.hidden; i < rig.leds.size(); ++i) {
      const int led = (i + static_cast<int>(seed)) % rig.leds.size();
      const Vector2 uv = *project_led(rig.camera, X_NB, rig.leds.p_BL(led));
      blobs.push_back(
          test::blob_at(uv, c.color ? rig.leds.color(led) : LedColor::none, rng));
      middle = uv;
      ++there;
    }
    for (int i = 0; i < c.strays_near; ++i) {
      blobs.push_back(
          test::blob_at(middle + Vector2(rng.uniform(-80, 80), rng.uniform(-80, 80)),
                        c.color ? LedColor::white : LedColor::none, rng));
    }
    const LedFrame frame =
        tracker.track(blobs, nudged(rig, X_NB, rng), loose_covariance(), 7);
    EXPECT_EQ(frame.t, 7);
    unsigned used = 0;
    for (const LedObservation& o : frame.seen) {
      EXPECT_EQ(used & o.leds, 0u) << "an LED in two places";
      used |= o.leds;
    }
    seen += frame.led_count();
    wrong += test::wrong_observations(rig, X_NB, frame, 1.5);
  }
  RecordProperty("seen", seen);
  RecordProperty("wrong", wrong);
  EXPECT_LE(wrong, c.strays_near > 0 || c.hidden > 0 ? seen / 200 : seen / 2000)
      << "of " << seen;
  EXPECT_GE(seen, 0.97 * there);
}
INSTANTIATE_TEST_SUITE_P(Cases, LedTrackerMany,
                         testing::Values(Case{"Clean", 0, 0, true, 2},
                                         Case{"NoColor", 0, 0, false, 2},
                                         Case{"TwoHidden", 2, 0, true, 2},
                                         Case{"Lamps", 0, 4, true, 2},
                                         Case{"StraysNoColor", 0, 2, false, 1.2}),
                         [](const auto& case_of) { return case_of.param.name; });

TEST(LedTracker, RenderedAndMergedLedsKeepTheirPlace) {
  const Rig rig = alan_rig();
  const LedTracker tracker = make_tracker(rig);
  auto detector = BlobDetector::create({}, 848, 480);
  int merged = 0, wrong = 0, seen = 0, blobs_seen = 0;
  for (unsigned seed = 0; seed < 150; ++seed) {
    Rng rng(seed);
    const Pose X_NB = test::random_pose(rig, rng, 1.2, 3);
    test::Picture picture;
    for (const Led& led : rig.leds.leds) {
      picture.add(*project_led(rig.camera, X_NB, led.p_BL), led.color, 600, 1.0);
    }
    const Pose X_NB_predicted = nudged(rig, X_NB, rng);
    const auto blobs = detector->detect(
        picture.expose(rng), {}, tracker.roi(X_NB_predicted, loose_covariance()));
    ASSERT_TRUE(blobs);
    blobs_seen += static_cast<int>(blobs->size());
    const LedFrame frame = tracker.track(*blobs, X_NB_predicted, loose_covariance());
    for (const LedObservation& o : frame.seen) {
      if (std::popcount(o.leds) > 1) ++merged;
    }
    seen += frame.led_count();
    wrong += test::wrong_observations(rig, X_NB, frame, 1.0);
  }
  EXPECT_GT(merged, 30);
  EXPECT_LE(wrong, blobs_seen / 100) << "of " << blobs_seen;
  EXPECT_GE(seen, 0.95 * 6 * 150);
}

TEST(LedTracker, TheRegionHoldsEveryLed) {
  const Rig rig = alan_rig();
  const LedTracker tracker = make_tracker(rig);
  for (unsigned seed = 0; seed < 300; ++seed) {
    Rng rng(seed);
    const Pose X_NB = test::random_pose(rig, rng);
    const Roi roi = tracker.roi(nudged(rig, X_NB, rng), loose_covariance());
    EXPECT_GE(roi.u0, 0);
    EXPECT_LE(roi.u1, 848);
    for (const Led& led : rig.leds.leds) {
      const Vector2 uv = *project_led(rig.camera, X_NB, led.p_BL);
      EXPECT_TRUE(uv.x() >= roi.u0 && uv.x() < roi.u1 && uv.y() >= roi.v0 &&
                  uv.y() < roi.v1);
    }
  }
  // Behind the lens there is nothing to look at.
  EXPECT_TRUE(
      tracker.roi(make_pose(Matrix3::Identity(), Vector3(3, 0, 0)), loose_covariance())
          .empty());
}

TEST(LedTracker, SaysWhyBlobsAreRefused) {
  const Rig rig = alan_rig();
  const LedTracker tracker = make_tracker(rig);
  Rng rng(4);
  const Pose X_NB = test::random_pose(rig, rng, 0.6, 1);
  std::vector<Blob> blobs;
  for (const Led& led : rig.leds.leds) {
    blobs.push_back(
        test::blob_at(*project_led(rig.camera, X_NB, led.p_BL), led.color, rng));
  }
  blobs.push_back(test::blob_at({5, 5}, LedColor::white, rng));
  blobs.push_back(test::blob_at(blobs[0].uv + Vector2(1, 2), LedColor::red, rng));
  const LedFrame frame = tracker.track(blobs, X_NB, loose_covariance());
  EXPECT_EQ(frame.led_count(), 6);
  ASSERT_EQ(frame.refused.size(), 2u);
  EXPECT_EQ(frame.refused[0].reason, Refusal::no_led_near);
  EXPECT_EQ(frame.refused[1].reason, Refusal::wrong_color);
}

// One LED has left the picture, and a lamp stands where it would be next.
TEST(LedTracker, AKnownStrayIsNoLedHoweverNear) {
  const Rig rig = alan_rig();
  const LedTracker tracker = make_tracker(rig);
  for (unsigned seed = 1; seed <= 50; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    const Pose X_NB = test::random_pose(rig, rng, 0.6, 1);
    const int gone = static_cast<int>(seed) % rig.leds.size();
    std::vector<Blob> blobs;
    for (int i = 0; i < rig.leds.size(); ++i) {
      Vector2 uv = *project_led(rig.camera, X_NB, rig.leds.p_BL(i));
      if (i == gone) uv += Vector2(2, -1);
      blobs.push_back(
          test::blob_at(uv, i == gone ? LedColor::white : rig.leds.color(i), rng));
      blobs.back().stray = i == gone;
    }
    const LedFrame frame = tracker.track(blobs, X_NB, loose_covariance());
    EXPECT_EQ(frame.led_count(), 5);
    ASSERT_EQ(frame.refused.size(), 1u);
    EXPECT_EQ(frame.refused[0].reason, Refusal::stray);
  }
}

TEST(LedTracker, InAPictureFullOfNoiseTheLedsAreFollowedAllTheSame) {
  const Rig rig = alan_rig();
  const LedTracker tracker = make_tracker(rig);
  int seen = 0, wrong = 0;
  for (unsigned seed = 0; seed < 50; ++seed) {
    Rng rng(seed);
    const Pose X_NB = test::random_pose(rig, rng, 0.4, 1);
    const LedImages images = led_images(rig.camera, rig.leds, X_NB);
    // More specks than are looked at, and they come first.
    std::vector<Blob> blobs;
    for (int i = 0; i < 200; ++i) {
      const Vector2 aside(rng.uniform(-60, 60), rng.uniform(-60, 60));
      Blob speck = test::blob_at(images.middle + aside, LedColor::none, rng);
      speck.brightness *= 0.02;
      blobs.push_back(speck);
    }
    for (const Led& led : rig.leds.leds) {
      blobs.push_back(
          test::blob_at(*project_led(rig.camera, X_NB, led.p_BL), led.color, rng));
    }
    const LedFrame frame = tracker.track(blobs, X_NB, loose_covariance());
    seen += frame.led_count();
    wrong += test::wrong_observations(rig, X_NB, frame, 1.5);
  }
  EXPECT_GE(seen, 50 * 5);
  EXPECT_LE(wrong, seen / 20);
}

TEST(LedTracker, PaperFollowsAShiftedConstellation) {
  const Rig rig = alan_rig();
  LedTrackerConfig config;
  config.profile = LedTrackerConfig::Profile::paper;
  const LedTracker tracker = make_tracker(rig, config);
  int wrong = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    Rng rng(seed);
    const Pose X_NB = test::random_pose(rig, rng, 0.4, 1.5);
    std::vector<Blob> blobs;
    for (const Led& led : rig.leds.leds) {
      blobs.push_back(
          test::blob_at(*project_led(rig.camera, X_NB, led.p_BL), led.color, rng));
    }
    Pose X_NB_old = X_NB;
    X_NB_old.translation().y() += 0.03;
    const LedFrame frame = tracker.track(blobs, X_NB_old, loose_covariance());
    EXPECT_EQ(frame.seen.size(), 6u);
    wrong += test::wrong_observations(rig, X_NB, frame, 1.0);
  }
  EXPECT_LE(wrong, 5);  // The nearest neighbour is not one to one.
}

TEST(LedTracker, StandsAbsurdInput) {
  const Rig rig = alan_rig();
  const LedTracker tracker = make_tracker(rig);
  Rng rng(1);
  const Pose X_NB = test::random_pose(rig, rng);
  EXPECT_TRUE(tracker.track({}, X_NB, loose_covariance()).seen.empty());
  const std::vector<Blob> heap(kMaxBlobs);
  (void)tracker.track(heap, X_NB, 1e6 * Matrix6::Identity());
  Pose nan = X_NB;
  nan.translation().x() = std::nan("");
  EXPECT_TRUE(tracker.track(heap, nan, loose_covariance()).seen.empty());
  EXPECT_TRUE(tracker.roi(nan, loose_covariance()).empty());
}

TEST(LedTrackerConfig, NamesTheFieldAndItsBounds) {
  LedTrackerConfig config;
  config.match_px = -1;
  const auto bad = config.validate();
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().detail.find("match_px is -1"), std::string::npos);
}

TEST(LedTracker, RefusesWhatThePicturesEdgeCutsByName) {
  const Rig rig = alan_rig();
  const LedTracker tracker = make_tracker(rig);
  int others = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    Rng rng(seed);
    const Pose X_NB = test::random_pose(rig, rng, 0.4, 2);
    std::vector<Blob> blobs = test::blobs_of(rig, X_NB, rng);
    const Blob& cut = blobs[seed % blobs.size()];
    blobs[seed % blobs.size()].cut = true;  // even where it would fit
    const LedFrame frame = tracker.track(blobs, X_NB, loose_covariance());
    for (const LedObservation& o : frame.seen) EXPECT_NE(o.uv, cut.uv) << seed;
    others += frame.led_count() >= rig.leds.size() - 1;
    int named = 0;
    for (const RefusedBlob& refused : frame.refused) {
      named += refused.uv == cut.uv && refused.reason == Refusal::cut_by_edge;
    }
    EXPECT_EQ(named, 1) << "seed " << seed;
    // All of it cut: nothing is seen, everything is named.
    for (Blob& blob : blobs) blob.cut = true;
    const LedFrame none = tracker.track(blobs, X_NB, loose_covariance());
    EXPECT_TRUE(none.seen.empty());
    EXPECT_EQ(none.refused.size(), blobs.size());
    for (const RefusedBlob& refused : none.refused) {
      EXPECT_EQ(refused.reason, Refusal::cut_by_edge);
    }
  }
  EXPECT_GE(others, 190);
}

/// As it comes from the picture: drones half out of it.
TEST(LedTracker, ALightAtThePicturesEdgePullsNoMeasurement) {
  const Rig rig = alan_rig();
  const LedTracker tracker = make_tracker(rig);
  auto detector = BlobDetector::create({}, 848, 480);
  ASSERT_TRUE(detector);
  int cut_lights = 0;
  for (unsigned seed = 0; cut_lights < 60 && seed < 4000; ++seed) {
    Rng rng(seed);
    const Vector2 at(rng.uniform(0, 848),
                     rng.chance(0.5) ? rng.uniform(-50, 10) : rng.uniform(430, 480));
    const Pose X_NB = make_pose(
        Matrix3::Identity(),
        rig.camera.X_NC * Vector3(rng.uniform(0.6, 1.5) *
                                  rig.camera.intrinsics.unproject(at).normalized()));
    int at_edge = 0;
    for (const Led& led : rig.leds.leds) {
      const auto uv = project_led(rig.camera, X_NB, led.p_BL);
      at_edge += uv && std::abs(std::min(uv->y(), 479 - uv->y())) < 1.5 &&
                 uv->x() > 5 && uv->x() < 842;
    }
    if (at_edge == 0) continue;
    test::Picture picture;
    for (const Led& led : rig.leds.leds) {
      picture.add(*project_led(rig.camera, X_NB, led.p_BL), led.color, 900, 1.5);
    }
    const auto blobs = detector->detect(picture.expose(rng));
    ASSERT_TRUE(blobs);
    const LedFrame frame = tracker.track(*blobs, X_NB, loose_covariance());
    EXPECT_EQ(test::wrong_observations(rig, X_NB, frame, 1.0), 0) << "seed " << seed;
    int named = 0;
    for (const RefusedBlob& refused : frame.refused) {
      named += refused.reason == Refusal::cut_by_edge;
    }
    EXPECT_GE(named, 1) << "seed " << seed;
    cut_lights += at_edge;
  }
  EXPECT_GE(cut_lights, 60);
}

}  // namespace
}  // namespace alight
