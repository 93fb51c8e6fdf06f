#pragma once
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/io/image_io.h"
#include "alight/run/landing_run.h"

namespace alight {

/// What the pictures of a run are drawn from, an entry a step.
struct RunTracks {
  std::vector<double> t;
  std::vector<Pose> X_IN, X_NB_true, X_NB_predicted;  ///< predicted: as control used it
  std::vector<FlatState> reference;
  std::vector<MissionState> state;
  std::vector<bool> predicted_valid, reference_valid;
};

/// A picture of the run that shows the LEDs well, with what was found in it.
struct ShownFrame {
  Image image;
  FrameReport report;
};

/// The frame with circles around the LEDs, crosses on refused blobs and the part around
/// the drone enlarged.
Image draw_detections(const ShownFrame& shown, const Rig& rig);

/// The landing from the side (N) and from above (I); tracking and estimation errors.
Result<std::vector<std::string>> save_run_pictures(const std::string& folder,
                                                   const RunTracks& tracks,
                                                   const ShownFrame& shown,
                                                   const Rig& rig);

}  // namespace alight
