#pragma once
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "alight/run/cpu_time.h"
#include "alight/sim/camera_renderer.h"

namespace alight::bench {

inline constexpr int kFrames = 64;
inline constexpr double kRateHz = 60;

/// A second of a drone that follows a platform on its circle, 0.6 to 1.1 m from the
/// lens, in a room with lights.
inline SceneAt scene_at(double t) {
  SceneAt scene;
  const double turn = 0.6 * t;
  scene.X_IN =
      make_pose(from_rpy(0, 0, turn),
                1.5 * Vector3(std::cos(turn), std::sin(turn), 0) + Vector3(0, 0, 0.26));
  scene.X_NB = make_pose(
      from_rpy(0.08 * std::sin(3 * t), 0.05 * std::cos(2 * t), 0.1 * std::sin(t)),
      Vector3(-0.35 + 0.15 * std::sin(1.5 * t), 0.1 * std::cos(2 * t),
              0.42 + 0.05 * std::sin(2 * t)));
  return scene;
}

inline std::vector<SceneAt> exposure_at(int frame) {
  const double t = frame / kRateHz;
  return {scene_at(t - 0.001), scene_at(t + 0.001)};
}

inline CameraRenderer make_renderer(const CameraSimConfig& config) {
  auto renderer = CameraRenderer::create(config, alan_rig(), 1);
  if (!renderer) std::abort();
  return std::move(*renderer);
}

/// The pictures of that second, rendered once.
inline const std::vector<ColorBuffer>& pictures() {
  static const std::vector<ColorBuffer> all = [] {
    CameraRenderer renderer = make_renderer({});
    std::vector<ColorBuffer> frames(kFrames);
    for (int i = 0; i < kFrames; ++i) {
      const auto exposure = exposure_at(i);
      if (!renderer.render(static_cast<std::uint64_t>(i), exposure,
                           frames[static_cast<std::size_t>(i)])) {
        std::abort();
      }
    }
    return frames;
  }();
  return all;
}

/// CPU times of single calls, for percentiles.
class Laps {
 public:
  Laps() { us_.reserve(1 << 20); }
  template <class Call>
  void time(Call&& call) {
    const double begin = thread_cpu_us();
    call();
    us_.push_back(thread_cpu_us() - begin);
  }
  void report(benchmark::State& state) {
    if (us_.empty()) return;
    std::sort(us_.begin(), us_.end());
    const auto at = [&](double share) {
      return us_[static_cast<std::size_t>(share * static_cast<double>(us_.size() - 1))];
    };
    state.counters["p50_us"] = at(0.5);
    state.counters["p99_us"] = at(0.99);
  }

 private:
  std::vector<double> us_;
};

}  // namespace alight::bench
