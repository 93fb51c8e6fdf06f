#pragma once
#include <optional>
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/calibration/constellation.h"
#include "alight/calibration/lens.h"
#include "alight/calibration/mount.h"

namespace alight {

/// The LEDs of a rig from a recorded flight.
struct CalibrateFlightOptions {
  std::string source;  ///< Folder or video (io/image_source.h).
  Rig rig;
  ConstellationConfig config;
  int passes = 3;  ///< Over the pictures, each with the LEDs of the one before.
};

struct CalibrateFlightResult {
  Rig rig;  ///< With the LEDs as found, all else as it was.
  ConstellationFit fit;
  int pictures = 0;
  int seen = 0;  ///< Pictures in which the drone was found, in the last pass.
};

/// @returns io or invalid_input for a source that cannot be read to its end;
///          invalid_config for a rig or distances that do not hold; too_few_points or
///          degenerate for weak data, with what to record instead.
Result<CalibrateFlightResult> calibrate_flight(const CalibrateFlightOptions& options);

/// The lens of a rig from pictures of a board.
struct CalibrateLensOptions {
  std::string source;
  Rig rig;
  BoardSpec board;
  LensConfig config;
};

struct CalibrateLensResult {
  Rig rig;  ///< With the lens as found, all else as it was.
  LensFit fit;
  int pictures = 0;
  int seen = 0;  ///< Pictures that show the board.
};

/// As calibrate_flight.
Result<CalibrateLensResult> calibrate_lens(const CalibrateLensOptions& options);

/// A tag laid or stood on the pad, and where.
struct PadTag {
  TagFamily family = TagFamily::dict_4x4_50;
  int id = 0;
  double size_m = 0.1;
  Pose X_NT = Pose::Identity();  ///< T as in geometry's Tag: x right, y up, z to you.
};

/// The camera's place on the platform, from a tag or from the drone parked on the pad.
struct CalibrateMountOptions {
  std::vector<std::string> sources;  ///< Each of one parking; one alone with a tag.
  std::vector<double> headings_deg;  ///< Of each parking; empty: all 0.
  Rig rig;
  std::optional<PadTag> tag;
  double led_sd_m = 0.001;  ///< How well the rig knows its LEDs.
  MountConfig config;
};

struct CalibrateMountResult {
  Rig rig;  ///< With the mount as found, all else as it was.
  MountFit fit;
  int pictures = 0;
  int seen = 0;
};

/// As calibrate_flight.
Result<CalibrateMountResult> calibrate_mount(const CalibrateMountOptions& options);

/// What `alight calibrate ... --json` prints.
std::string calibration_json(const CalibrateFlightOptions& options,
                             const CalibrateFlightResult& result);
std::string calibration_json(const CalibrateLensOptions& options,
                             const CalibrateLensResult& result);
std::string calibration_json(const CalibrateMountOptions& options,
                             const CalibrateMountResult& result);

}  // namespace alight
