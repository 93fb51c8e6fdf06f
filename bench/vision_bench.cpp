#ifdef ALIGHT_WITH_ARUCO
#include <opencv2/aruco.hpp>
#endif

#include "alight/estimation/relative_filter.h"
#include "alight/mission/relative_estimator.h"
#include "alight/vision/bright_scan.h"
#include "alight/vision/led_finder.h"
#include "alight/vision/led_tracker.h"
#include "bench/flight.h"

namespace alight::bench {
namespace {

const ColorBuffer& picture(std::size_t i) { return pictures()[i % kFrames]; }

/// The least that any detector does: look at every pixel, average the bright ones.
void BM_BareScan(benchmark::State& state) {
  std::size_t i = 0;
  for (auto _ : state) {
    const ImageView image = picture(i++).view();
    long n = 0, su = 0, sv = 0;
    for (int v = 0; v < image.height; ++v) {
      const std::uint8_t* pixel = image.row(v);
      for (int u = 0; u < image.width; ++u, pixel += 3) {
        if (std::max({pixel[0], pixel[1], pixel[2]}) > 60) {
          ++n;
          su += u;
          sv += v;
        }
      }
    }
    benchmark::DoNotOptimize(n);
    benchmark::DoNotOptimize(su);
    benchmark::DoNotOptimize(sv);
  }
}
BENCHMARK(BM_BareScan)->Unit(benchmark::kMicrosecond);

/// The same, running over the dark 64 bytes at a time: the harder yardstick.
void BM_BareScanVectorized(benchmark::State& state) {
  std::size_t i = 0;
  for (auto _ : state) {
    const ImageView image = picture(i++).view();
    long n = 0, su = 0, sv = 0;
    for (int v = 0; v < image.height; ++v) {
      const std::uint8_t* row = image.row(v);
      const int end = 3 * image.width;
      for (int b = first_bright(row, 0, end, 60); b < end;) {
        const int u = b / 3;
        ++n;
        su += u;
        sv += v;
        b = first_bright(row, 3 * (u + 1), end, 60);
      }
    }
    benchmark::DoNotOptimize(n);
    benchmark::DoNotOptimize(su);
    benchmark::DoNotOptimize(sv);
  }
}
BENCHMARK(BM_BareScanVectorized)->Unit(benchmark::kMicrosecond);

BlobDetector make_detector() {
  const Intrinsics lens = alan_rig().camera.intrinsics;
  auto detector = BlobDetector::create({}, lens.width, lens.height);
  if (!detector) std::abort();
  return std::move(*detector);
}

/// Budget: 1.5 times BM_BareScan.
void BM_DetectFullFrame(benchmark::State& state) {
  BlobDetector detector = make_detector();
  std::size_t i = 0, blobs = 0;
  for (auto _ : state) {
    const auto found = detector.detect(picture(i++).view());
    if (!found) {
      state.SkipWithError("not detected");
      break;
    }
    blobs += found->size();
  }
  state.counters["blobs"] = benchmark::Counter(static_cast<double>(blobs),
                                               benchmark::Counter::kAvgIterations);
}
BENCHMARK(BM_DetectFullFrame)->Unit(benchmark::kMicrosecond);

void BM_FindLeds(benchmark::State& state) {
  const Rig rig = alan_rig();
  BlobDetector detector = make_detector();
  auto finder = LedFinder::create({}, rig.camera, rig.leds);
  if (!finder) std::abort();
  std::size_t i = 0, found = 0;
  for (auto _ : state) {
    const auto blobs = detector.detect(picture(i++).view());
    found += blobs && finder->find(*blobs);
  }
  state.counters["found"] = benchmark::Counter(static_cast<double>(found),
                                               benchmark::Counter::kAvgIterations);
}
BENCHMARK(BM_FindLeds)->Unit(benchmark::kMicrosecond);

Time time_of(std::size_t i) { return from_seconds(static_cast<double>(i) / kRateHz); }

/// Predict, detect in the region of interest, associate, update: all that a followed
/// picture costs. Budget: a 20th of BM_Aruco.
void BM_TrackUpdate(benchmark::State& state) {
  const Rig rig = alan_rig();
  BlobDetector detector = make_detector();
  const auto tracker = LedTracker::create({}, rig.camera, rig.leds);
  auto filter =
      RelativeFilter::create(RelativeFilterConfig::camera_only(), rig.camera, rig.leds);
  if (!tracker || !filter) std::abort();
  Laps laps;
  std::size_t i = 0, seen = 0, updated = 0;
  double square = 0;
  for (auto _ : state) {
    const std::size_t k = i++ % kFrames;
    const Pose X_NB_true = scene_at(static_cast<double>(k) / kRateHz).X_NB;
    if (k == 0) {
      RelativeState x;
      x.p_NB = X_NB_true.translation();
      x.R_NB = X_NB_true.linear();
      x.v_NB = (scene_at(0.001).X_NB.translation() - x.p_NB) / 0.001;
      filter->reset(0, x, 1e-4 * Covariance9::Identity());
    }
    laps.time([&] {
      (void)filter->predict_to(time_of(k), {});
      const Matrix6 cov = filter->tracking_covariance().topLeftCorner<6, 6>();
      const Pose X_NB = filter->state().X_NB();
      const auto blobs =
          detector.detect(picture(k).view(), {}, tracker->roi(X_NB, cov));
      if (!blobs) return;
      const LedFrame frame = tracker->track(*blobs, X_NB, cov, time_of(k));
      seen += static_cast<std::size_t>(frame.led_count());
      updated += filter->update(frame).has_value();
    });
    square += (filter->state().p_NB - X_NB_true.translation()).squaredNorm();
  }
  laps.report(state);
  const auto average = benchmark::Counter::kAvgIterations;
  state.counters["leds"] = {static_cast<double>(seen), average};
  state.counters["updated"] = {static_cast<double>(updated), average};
  state.counters["rmse_mm"] = 1000 * std::sqrt(square / static_cast<double>(i));
}
BENCHMARK(BM_TrackUpdate)->Unit(benchmark::kMicrosecond);

/// What RelativeEstimator makes of a followed picture: the above, and LEDs placed by
/// their pixels. Budget: 30 us median, 60 us p99. `alight measure` tells the same with
/// a renderer between the pictures, which leaves no cache as it was.
void BM_EstimatorUpdate(benchmark::State& state) {
  auto estimator =
      RelativeEstimator::create(RelativeEstimatorConfig::camera_only(), alan_rig());
  if (!estimator) std::abort();
  const NoMotion motion;
  FrameReport report;
  Laps laps;
  std::size_t i = 0, tracked = 0;
  for (auto _ : state) {
    const std::size_t k = i % kFrames;
    if (k == 0) estimator->forget();  // the flight begins anew: to be found again
    CameraFrame frame;
    frame.captured = frame.received = time_of(++i);
    frame.color = picture(k).view();
    const auto fuse = [&] { estimator->fuse(frame, motion, report); };
    if (k == 0) {
      fuse();
    } else {
      laps.time(fuse);
    }
    tracked += report.tracked;
  }
  laps.report(state);
  state.counters["tracked"] = {static_cast<double>(tracked),
                               benchmark::Counter::kAvgIterations};
}
BENCHMARK(BM_EstimatorUpdate)->Unit(benchmark::kMicrosecond);

#ifdef ALIGHT_WITH_ARUCO
/// The peer, single-threaded, on the same pictures. No marker is in them: what it costs
/// to look for one.
void BM_Aruco(benchmark::State& state) {
  cv::setNumThreads(1);
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50);
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  std::size_t i = 0;
  for (auto _ : state) {
    const ColorBuffer& color = picture(i++);
    const cv::Mat image(color.height, color.width, CV_8UC3,
                        const_cast<std::uint8_t*>(color.pixels().data()));
    cv::aruco::detectMarkers(image, dictionary, corners, ids);
    benchmark::DoNotOptimize(ids.data());
  }
}
BENCHMARK(BM_Aruco)->Unit(benchmark::kMicrosecond);
#endif

}  // namespace
}  // namespace alight::bench
