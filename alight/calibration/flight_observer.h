#pragma once
#include <vector>

#include "alight/base/result.h"
#include "alight/calibration/light_tracks.h"
#include "alight/calibration/observed_frame.h"
#include "alight/mission/relative_estimator.h"

namespace alight {

struct FlightObserverConfig {
  double led_sd_m = 0.003;  ///< How well the rig knows its LEDs.
  double still_px = 0.5;    ///< A picture in which no LED has moved this far since the
                            ///< last one kept says nothing new.
};

/// Looks at the pictures of a flight, one after the other, and keeps what they show of
/// the LEDs: follows the drone (RelativeEstimator); where that is not sure, searches
/// the picture on its own.
class FlightObserver {
 public:
  static Result<FlightObserver> create(const FlightObserverConfig& config,
                                       const Rig& rig);

  /// Colour or grey, later than the one before.
  void look(const CameraFrame& frame);

  const std::vector<ObservedFrame>& frames() const { return frames_; }
  /// The drone's lights, followed from picture to picture.
  const std::vector<LightTrack>& tracks() const { return lights_.tracks(); }
  int pictures() const { return pictures_; }
  int seen() const { return seen_; }  ///< Pictures with a pose, still ones included.

 private:
  FlightObserver(const FlightObserverConfig& config, const Rig& rig,
                 RelativeEstimator estimator, BlobDetector detector, LedFinder finder,
                 LedTracker tracker);
  bool observe(const CameraFrame& frame, BlobSpan blobs, ObservedFrame& out);
  /// Makes the pose as exact as its LEDs allow, unless they contradict each other.
  bool fits(ObservedFrame& frame) const;
  bool still(const ObservedFrame& frame) const;

  FlightObserverConfig config_;
  Rig rig_;
  RelativeEstimator estimator_;
  LinearPicture linear_;
  BlobDetector detector_;
  LedFinder finder_;
  LedTracker tracker_;
  std::vector<ObservedFrame> frames_;
  LightTracks lights_;
  int pictures_ = 0;
  int seen_ = 0;
};

}  // namespace alight
