#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "alight/vision/gamma_learner.h"
#include "alight/vision/led_tracker.h"
#include "alight/vision/lights_fitted.h"
#include "alight/vision/linear_picture.h"
#include "scene.h"

// Sanitizers bring an allocator of their own, which must not be mixed with this one.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define ALIGHT_COUNTS_ALLOCATIONS 1
#else
#define ALIGHT_COUNTS_ALLOCATIONS 0
#endif

namespace {
std::atomic<long> news{0};
}  // namespace

#if ALIGHT_COUNTS_ALLOCATIONS
void* operator new(std::size_t size) {
  ++news;
  if (void* room = std::malloc(size)) return room;
  std::abort();
}
void operator delete(void* room) noexcept { std::free(room); }
void operator delete(void* room, std::size_t) noexcept { std::free(room); }
#endif

namespace alight {
namespace {

TEST(Allocation, NoneOnceDetectorFinderAndTrackerStand) {
  static FixedVector<Blob, kMaxBlobs> lights;  // large
  const Rig rig = alan_rig();
  auto detector = BlobDetector::create({}, 848, 480);
  auto finder = LedFinder::create({}, rig.camera, rig.leds);
  const auto tracker = LedTracker::create({}, rig.camera, rig.leds);
  ASSERT_TRUE(detector && finder && tracker);
  const Matrix6 cov = 1e-4 * Matrix6::Identity();
  LinearPicture linear(848, 480, 2.2);
  GammaLearner gamma;
  int found = 0, parted = 0, looks = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    Rng rng(seed);
    const Pose X_NB = test::random_pose(rig, rng, 0.5, 2);
    test::Picture picture;
    for (const Led& led : rig.leds.leds) {
      picture.add(*project_led(rig.camera, X_NB, led.p_BL), led.color);
    }
    for (unsigned i = 0; i < 10 * seed; ++i) {
      picture.add({rng.uniform(0, 848), rng.uniform(0, 480)}, LedColor::white);
    }
    picture.add({30, 30}, LedColor::green, 250, 0.9);
    picture.add({32, 32}, LedColor::green, 250, 0.9);
    const ImageView view = picture.expose(rng);
    const long before = news;
    const auto blobs = detector->detect(view);
    if (blobs) {
      found += finder->find(*blobs).has_value();
      (void)tracker->track(*blobs, X_NB, cov);
      (void)tracker->roi(X_NB, cov);
      lights.assign(blobs->begin(), blobs->end());
      parted +=
          fit_lights(view, {.variance_px2 = 0.81, .share_sd = 0.35}, *detector, lights);
    }
    (void)linear.of(view, {10, 10, 100, 100});
    gamma.look(view, std::array{Vector2(30, 30), Vector2(32, 32)}, 0.9, {});
    looks += gamma.busy();
    while (gamma.busy()) gamma.step();
    EXPECT_EQ(news, before);
  }
  EXPECT_GT(looks, 5);
  EXPECT_GT(found, 5);
  EXPECT_GT(parted, 5);
#if ALIGHT_COUNTS_ALLOCATIONS
  const long before = news;
  void* volatile room = ::operator new(1);
  ::operator delete(room);
  EXPECT_EQ(news, before + 1);  // The counter counts.
#endif
}

}  // namespace
}  // namespace alight
