// The brain allocates nothing while it flies (LandingSystem::step): every call of the
// C library's allocator is counted, so that Eigen's and OpenCV's count as well as
// new's.
#include <execinfo.h>

#include <cmath>
#include <cstdlib>
#include <sstream>

#include "bare_loop.h"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define ALIGHT_COUNTS_ALLOCATIONS 1
#else
#define ALIGHT_COUNTS_ALLOCATIONS 0
#endif

namespace {

constexpr int kDepth = 12;
thread_local bool armed = false;
thread_local int allocations = 0;
thread_local void* first_trace[kDepth];
thread_local int first_depth = 0;

#if ALIGHT_COUNTS_ALLOCATIONS
void count_allocation() {
  if (!armed) return;
  if (allocations++ > 0) return;
  armed = false;  // backtrace may allocate itself
  first_depth = backtrace(first_trace, kDepth);
  armed = true;
}
#endif

}  // namespace

#if ALIGHT_COUNTS_ALLOCATIONS
// NOLINTBEGIN(bugprone-reserved-identifier): glibc's names for its own allocator.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t size) {
  count_allocation();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  count_allocation();
  return __libc_calloc(count, size);
}
void* realloc(void* old, std::size_t size) {
  count_allocation();
  return __libc_realloc(old, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  count_allocation();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
  count_allocation();
  *out = __libc_memalign(alignment, size);
  return *out != nullptr ? 0 : 12;  // ENOMEM
}
}
// NOLINTEND(bugprone-reserved-identifier)
#endif

namespace alight {
namespace {

using test::BareLoop;

/// Allocations in the brain's step are counted.
void counted_step(BareLoop& loop) {
  loop.gather();
  armed = true;
  loop.think();
  armed = false;
  loop.act();
}

std::string first_place() {
  std::ostringstream text;
  char** names = backtrace_symbols(first_trace, first_depth);
  for (int i = 0; i < first_depth; ++i) text << "\n  " << names[i];
  std::free(names);
  return text.str();
}

TEST(Allocation, CounterSeesNewAndMalloc) {
  if (!ALIGHT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns the allocator";
  allocations = 0;
  armed = true;
  std::vector<int>* heap = new std::vector<int>(10);
  Eigen::VectorXd dynamic = Eigen::VectorXd::Constant(100, 1.0);
  armed = false;
  EXPECT_GE(allocations, 3) << dynamic.sum();
  delete heap;
}

void expect_none(const LandingRunOptions& options, const LandingConfig& config) {
  BareLoop loop(options, config);
  // Tables may be filled at first use while the drone still stands.
  for (int i = 0; i < 90; ++i) loop.step();
  allocations = 0;
  int steps = 0;
  MissionState first_in = MissionState::idle;
  while (loop.seconds() < 25 && loop.out.mission.state != MissionState::complete) {
    const int before = allocations;
    counted_step(loop);
    if (before == 0 && allocations > 0) first_in = loop.out.mission.state;
    ++steps;
  }
  EXPECT_EQ(allocations, 0) << "in " << steps << " steps, first in state "
                            << to_string(first_in) << ":" << first_place();
  EXPECT_EQ(loop.out.mission.state, MissionState::complete)
      << to_string(loop.out.mission.state) << ": " << loop.out.mission.reason
      << ", so that not every state was seen";
}

TEST(Allocation, NoneFromTakeOffToTouchDown) {
  if (!ALIGHT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns the allocator";
  const LandingRunOptions options = test::options_of("circle", 1);
  expect_none(options, LandingConfig::standard(options.rig));
}

TEST(Allocation, NoneWhileSightIsLostAndFoundAgain) {
  if (!ALIGHT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "a sanitizer owns the allocator";
  const LandingRunOptions options = test::options_of("circle", 2);
  BareLoop loop(options, LandingConfig::standard(options.rig));
  // The first sight comes when allocations are already counted.
  loop.dark = true;
  for (int i = 0; i < 60; ++i) loop.step();
  allocations = 0;
  int found = 0, unseen = 0;
  while (loop.seconds() < 14) {
    // Later, every third second begins with 0.7 s in the dark.
    loop.dark = loop.seconds() > 4 && std::fmod(loop.seconds(), 3) < 0.7;
    counted_step(loop);
    for (const FrameReport& frame : loop.out.trace.frames) {
      found += frame.initialized;
      unseen += !frame.tracked;
    }
  }
  EXPECT_EQ(allocations, 0) << first_place();
  EXPECT_GE(found, 1) << "nothing was ever found without a prior";
  EXPECT_GE(unseen, 60) << "sight was hardly lost";
}

}  // namespace
}  // namespace alight
