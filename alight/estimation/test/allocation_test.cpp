#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>

#include "alight/estimation/test/flight.h"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define ALIGHT_COUNTS_ALLOCATIONS 1
#endif

namespace {
std::atomic<long> g_allocations{0};
}

#ifdef ALIGHT_COUNTS_ALLOCATIONS
// Below operator new, since Eigen calls malloc itself.
extern "C" {
void* __libc_malloc(std::size_t);
void* malloc(std::size_t size) {
  g_allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
}
}
#endif

namespace alight::test {

long allocations() {
#ifdef ALIGHT_COUNTS_ALLOCATIONS
  return g_allocations.load();
#else
  return -1;
#endif
}

namespace {

TEST(Allocation, TheGuardCounts) {
  if (allocations() < 0) GTEST_SKIP() << "heap not countable here";
  const long before = allocations();
  void* volatile block = std::malloc(16);
  std::free(block);
  EXPECT_EQ(allocations(), before + 1);
}

TEST(Allocation, PredictAndUpdateTakeNone) {
  if (allocations() < 0) GTEST_SKIP() << "heap not countable here";
  const Rig rig = alan_rig();
  const Flight flight;
  for (const auto& config : {RelativeFilterConfig{}, RelativeFilterConfig::paper(),
                             RelativeFilterConfig::camera_only()}) {
    Rng rng(3);
    auto filter = RelativeFilter::create(config, rig.camera, rig.leds).value();
    filter.reset(0, flight.state(0), start_covariance());
    for (int k = 1; k <= 30; ++k) {
      const Time t = from_seconds(k / 60.0);
      const auto input = flight.input((k - 0.5) / 60);
      auto frame = picture(rig.camera, rig.leds, flight.state(to_seconds(t)).X_NB(), t,
                           0.2, rng);
      // Every way through: a good picture, an improbable one, an empty one.
      if (k % 5 == 0) {
        for (auto& o : frame.seen) o.uv.x() += 50;
      }
      if (k % 7 == 0) frame.seen.clear();
      const long before = allocations();
      const bool predicted = filter.predict_to(t, input).has_value();
      const bool late = filter.predict_to(t - 1, input).has_value();
      (void)filter.update(frame);
      filter.update_velocity(flight.state(to_seconds(t)).v_NB, 0.3);
      (void)filter.covariance();
      const double sd = filter.position_sd() + filter.yaw_sd() + filter.velocity_sd();
      EXPECT_EQ(allocations(), before) << "frame " << k;
      EXPECT_TRUE(predicted);
      EXPECT_FALSE(late);
      EXPECT_TRUE(std::isfinite(sd));
    }
  }
}

}  // namespace
}  // namespace alight::test
