#include "alight/run/landing_run.h"
#include "bench/flight.h"

namespace alight::bench {
namespace {

void render(benchmark::State& state, const CameraSimConfig& config, bool with_depth) {
  CameraRenderer renderer = make_renderer(config);
  ColorBuffer color;
  DepthBuffer depth;
  std::uint64_t frame = 0;
  for (auto _ : state) {
    const auto exposure = exposure_at(static_cast<int>(frame % kFrames));
    if (!renderer.render(frame++, exposure, color, with_depth ? &depth : nullptr)) {
      state.SkipWithError("not rendered");
      break;
    }
    benchmark::DoNotOptimize(color.pixels().data());
    benchmark::DoNotOptimize(depth.pixels().data());
    benchmark::ClobberMemory();
  }
}

/// Budget: 0.35 ms, so that 60 frames of a second of simulation take 21 ms.
void BM_RenderColorAndDepth(benchmark::State& state) {
  CameraSimConfig config;
  config.lights = static_cast<int>(state.range(0));
  render(state, config, true);
}
BENCHMARK(BM_RenderColorAndDepth)
    ->ArgName("lights")
    ->Arg(0)
    ->Arg(40)
    ->Arg(100)
    ->Unit(benchmark::kMicrosecond);

void BM_RenderColor(benchmark::State& state) { render(state, {}, false); }
BENCHMARK(BM_RenderColor)->Unit(benchmark::kMicrosecond);

void BM_RenderJpeg(benchmark::State& state) {
  CameraSimConfig config;
  config.jpeg = 85;
  render(state, config, false);
}
BENCHMARK(BM_RenderJpeg)->Unit(benchmark::kMicrosecond);

/// The whole loop on one core: world, pictures with noise and depth, radio, brain.
/// Budget: 20 times real time.
void BM_Landing(benchmark::State& state) {
  LandingRunOptions options;
  options.rig = alan_rig();
  options.scenario.wind = {.mean_m_s = 2, .from_deg = 0, .gusts = Gusts::dryden};
  double simulated_s = 0;
  for (auto _ : state) {
    const auto result = run_landing(options);
    if (!result) return state.SkipWithError(result.error().detail.c_str());
    simulated_s += result->simulated_s;
    ++options.seed;
  }
  state.counters["times_real_time"] = {simulated_s, benchmark::Counter::kIsRate};
}
BENCHMARK(BM_Landing)->Iterations(5)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace alight::bench
