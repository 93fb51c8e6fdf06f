// The brain allocates nothing while it flies (LandingSystem::step): every call of the
// C library's allocator is counted, so that Eigen's and OpenCV's count as well as
// new's.
#include <execinfo.h>

#include <cmath>
#include <cstdlib>
#include <deque>
#include <sstream>

#include "alight/mission/landing_system.h"
#include "alight/planning/planner.h"
#include "alight/sim/camera_renderer.h"
#include "alight/sim/world.h"
#include "run_scenarios.h"

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

void count_allocation() {
  if (!armed) return;
  if (allocations++ > 0) return;
  armed = false;  // backtrace may allocate itself
  first_depth = backtrace(first_trace, kDepth);
  armed = true;
}

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

/// The closed loop of run_landing, bare, so that nothing but the brain runs while
/// allocations are counted.
class BareLoop {
 public:
  BareLoop(const LandingRunOptions& options, const LandingConfig& config)
      : rig_(options.rig),
        world_(World::create(options.scenario, options.rig, options.seed).value()),
        renderer_(
            CameraRenderer::create({}, world_->true_rig().rig, options.seed).value()),
        brain_(LandingSystem::create(config, options.rig).value()),
        planner_(Planner::create({}, options.rig).value()) {
    black_.width = rig_.camera.intrinsics.width;
    black_.height = rig_.camera.intrinsics.height;
    black_.pixels.resize(static_cast<std::size_t>(3 * black_.width * black_.height));
  }

  /// One step of the brain; allocations in it are counted if `counted`.
  void step(bool counted) {
    now_ += from_seconds(0.01);
    world_->advance_to(now_);
    gather();
    armed = counted;
    brain_.step({now_, events_}, out);
    armed = false;
    world_->send(out.setpoint, now_);
    if (out.has_external_pose) world_->send(out.external_pose, now_);
    if (out.order != AutopilotOrder::none) world_->send(out.order, now_);
    if (out.mission.state == MissionState::follow) world_->start_platform();
    if (out.has_plan_request) {
      plans_.push_back({now_ + from_seconds(0.02), planner_.plan(out.plan_request)});
    }
  }

  double seconds() const { return to_seconds(now_); }

  Output out;
  bool dark = false;  ///< Pictures are black.

 private:
  void gather() {
    const double period = 1 / rig_.timing.rate_hz;
    const Time half = from_seconds(0.5e-3 * rig_.timing.exposure_ms);
    for (;;) {
      const Time t = from_seconds((static_cast<double>(taken_) + 0.5) * period);
      if (t + half > now_) break;
      const auto scene = [&](Time at) {
        const TruthState truth = world_->truth_at(at);
        return SceneAt{truth.platform.X_IN, truth.X_NB};
      };
      const std::array<SceneAt, 3> scenes{scene(t - half), scene(t), scene(t + half)};
      pictures_.emplace_back();
      EXPECT_TRUE(renderer_.render(taken_, scenes, pictures_.back(), nullptr));
      CameraFrame frame;
      frame.captured = t;
      frame.received = t + from_seconds(1e-3 * rig_.timing.frame_to_use_ms);
      frame.color = dark ? black_.view() : pictures_.back().view();
      frames_.push_back(frame);
      ++taken_;
    }
    events_.clear();
    batch_.clear();
    world_->collect(now_, batch_);
    for (const auto& e : batch_.odometry) events_.emplace_back(e);
    for (const auto& e : batch_.telemetry) events_.emplace_back(e);
    for (const auto& e : batch_.link) events_.emplace_back(e);
    while (!frames_.empty() && frames_.front().received <= now_) {
      events_.emplace_back(frames_.front());
      frames_.pop_front();
    }
    while (pictures_.size() > 8) pictures_.pop_front();
    while (!plans_.empty() && plans_.front().received <= now_) {
      events_.emplace_back(plans_.front());
      plans_.pop_front();
    }
    if (now_ == from_seconds(1)) {
      events_.emplace_back(OperatorInput{now_, now_, OperatorWish::go});
    }
  }

  Rig rig_;
  std::unique_ptr<World> world_;
  CameraRenderer renderer_;
  LandingSystem brain_;
  Planner planner_;
  Time now_ = 0;
  std::uint64_t taken_ = 0;
  std::vector<Event> events_;
  SensorBatch batch_;
  std::deque<ColorBuffer> pictures_;
  ColorBuffer black_;
  std::deque<CameraFrame> frames_;
  std::deque<PlanArrival> plans_;
};

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
  for (int i = 0; i < 90; ++i) loop.step(false);
  allocations = 0;
  int steps = 0;
  MissionState first_in = MissionState::idle;
  while (loop.seconds() < 25 && loop.out.mission.state != MissionState::complete) {
    const int before = allocations;
    loop.step(true);
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
  for (int i = 0; i < 60; ++i) loop.step(false);
  allocations = 0;
  int found = 0, unseen = 0;
  while (loop.seconds() < 14) {
    // Later, every third second begins with 0.7 s in the dark.
    loop.dark = loop.seconds() > 4 && std::fmod(loop.seconds(), 3) < 0.7;
    loop.step(true);
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
