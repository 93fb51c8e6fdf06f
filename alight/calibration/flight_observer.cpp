#include "alight/calibration/flight_observer.h"

#include <bit>
#include <cmath>

#include "alight/vision/pose_from_leds.h"

namespace alight {
namespace {

// A pose may be this far off when its LEDs are looked for: it has seen this picture.
constexpr double kPlaceSd = 0.01;  // m
constexpr double kTurnSd = 0.02;   // rad
constexpr int kFewestBlobs = 4;
// rms beyond which correspondences are wrong: of the picture, and for LEDs that are
// off.
constexpr double kPictureRms = 1.0;
constexpr double kLedGate = 2.5;

RelativeEstimatorConfig estimator_config(double led_sd_m) {
  auto config = RelativeEstimatorConfig::camera_only();
  config.finder.led_sd_m = led_sd_m;
  config.tracker.led_sd_m = led_sd_m;
  config.filter.led_position_sd_m = led_sd_m;
  config.learn_leds = false;  // that is what it is for
  return config;
}

}  // namespace

Result<FlightObserver> FlightObserver::create(const FlightObserverConfig& config,
                                              const Rig& rig) {
  const auto parts = estimator_config(config.led_sd_m);
  auto estimator = RelativeEstimator::create(parts, rig);
  if (!estimator) return fail(estimator.error());
  const Intrinsics& lens = rig.camera.intrinsics;
  auto detector = BlobDetector::create(parts.blobs, lens.width, lens.height);
  if (!detector) return fail(detector.error());
  auto finder = LedFinder::create(parts.finder, rig.camera, rig.leds, rig.pad.size_m);
  if (!finder) return fail(finder.error());
  auto tracker = LedTracker::create(parts.tracker, rig.camera, rig.leds);
  if (!tracker) return fail(tracker.error());
  return FlightObserver(config, rig, std::move(*estimator), std::move(*detector),
                        std::move(*finder), std::move(*tracker));
}

FlightObserver::FlightObserver(const FlightObserverConfig& config, const Rig& rig,
                               RelativeEstimator estimator, BlobDetector detector,
                               LedFinder finder, LedTracker tracker)
    : config_(config),
      rig_(rig),
      estimator_(std::move(estimator)),
      linear_(rig.camera.intrinsics.width, rig.camera.intrinsics.height,
              estimator_.gamma()),
      detector_(std::move(detector)),
      finder_(std::move(finder)),
      tracker_(std::move(tracker)),
      lights_(rig.leds) {}

void FlightObserver::look(const CameraFrame& frame) {
  ++pictures_;
  if (linear_.gamma() != estimator_.gamma()) linear_.set_gamma(estimator_.gamma());
  Result<BlobSpan> blobs = fail(Fault::invalid_input);
  if (detector_.takes(frame.color, frame.depth)) {
    blobs = detector_.detect(linear_.of(frame.color), frame.depth);
  }
  ObservedFrame out;
  const bool found = observe(frame, blobs ? *blobs : BlobSpan(), out);
  lights_.add(blobs ? *blobs : BlobSpan(), found ? &out : nullptr);
  if (!found) return;
  ++seen_;
  if (!still(out)) frames_.push_back(out);
}

bool FlightObserver::observe(const CameraFrame& frame, BlobSpan blobs,
                             ObservedFrame& out) {
  FrameReport report;
  estimator_.fuse(frame, NoMotion(), report);
  out.t = frame.captured;
  if (report.tracked) {
    out.X_NB = report.x.X_NB();
    Matrix6 cov = Matrix6::Zero();
    cov.diagonal() << Vector3::Constant(kPlaceSd * kPlaceSd),
        Vector3::Constant(kTurnSd * kTurnSd);
    const LedFrame seen = tracker_.track(blobs, out.X_NB, cov, frame.captured);
    out.seen = estimator_.seen_at_once(seen).seen;
    if (fits(out)) return true;
  }
  // Single pictures that were put together as a flight cannot be tracked.
  const auto found = finder_.find(blobs, frame.captured);
  if (!found) return false;
  out.X_NB = found->fit.X_NB;
  out.seen = found->frame.seen;
  return fits(out);
}

bool FlightObserver::fits(ObservedFrame& frame) const {
  if (frame.seen.size() < kFewestBlobs) return false;
  const auto fit = refine_pose(rig_.camera, rig_.leds,
                               {frame.seen.data(), frame.seen.size()}, frame.X_NB);
  if (!fit) return false;
  const double range =
      (fit->X_NB.translation() - rig_.camera.X_NC.translation()).norm();
  const double led_px =
      config_.led_sd_m * rig_.camera.intrinsics.fx / std::max(range, 0.05);
  if (fit->rms_px > kPictureRms + kLedGate * led_px) return false;
  frame.X_NB = fit->X_NB;
  return true;
}

bool FlightObserver::still(const ObservedFrame& frame) const {
  if (frames_.empty()) return false;
  const ObservedFrame& last = frames_.back();
  if (last.seen.size() != frame.seen.size()) return false;
  for (std::size_t i = 0; i < frame.seen.size(); ++i) {
    if (last.seen[i].leds != frame.seen[i].leds ||
        (last.seen[i].uv - frame.seen[i].uv).norm() > config_.still_px) {
      return false;
    }
  }
  return true;
}

}  // namespace alight
