#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alight/base/result.h"
#include "alight/run/flight_path.h"
#include "alight/sim/camera_renderer.h"

namespace alight {

/// The picture conditions that the estimator is judged by.
enum class SequenceKind : std::uint8_t {
  clean,
  hard  ///< JPEG 80, the brightest LED three times the dimmest, five times shot noise.
};
const char* to_string(SequenceKind kind);
std::optional<SequenceKind> sequence_kind(std::string_view name);

struct SequenceOptions {
  static constexpr int kFramesMost = 36000, kLightsMost = 1000;
  static constexpr double kLedErrorMost_mm = 50;
  Rig rig;  ///< As written down; what flies is drawn around it.
  SequenceKind kind = SequenceKind::clean;
  std::uint64_t seed = 1;
  int frames = 600;
  FlightPathConfig path;
  double platform_speed_m_s = 0.5;  ///< Straight ahead, drawn up to this: the room's
                                    ///< lights pass by.
  int lights = 40;                  ///< Pieces of ceiling lights in the room.
  int strays = 0;                   ///< Single lamps more, all in the first picture.
  std::vector<int> dead;            ///< LEDs that never shine.
  Seconds dark_from = 0;            ///< No LED shines from here, s after the begin,
  Seconds dark_to = 0;              ///< to here.
  double led_error_mm = 0;          ///< sd of each LED's place, each axis.

  /// Names the first field out of range, its value and its bounds.
  Result<void> validate() const;
};

/// A flight of the drone before the platform's camera, with its truth: what the
/// estimator is measured on. Every frame is rendered when asked for, in any order; the
/// same options give the same bits.
class Sequence {
 public:
  static Result<Sequence> create(const SequenceOptions& options);

  int frames() const { return options_.frames; }
  Time time(int k) const;  ///< Mid-exposure, ns.
  /// Of B in N at mid-exposure.
  RelativeState truth(int k) const { return path_.at(to_seconds(time(k)) - kBegin); }
  const Rig& true_rig() const { return true_rig_; }
  const FlightPath& path() const { return path_; }
  /// Of the compression; 0 is none.
  int jpeg() const { return jpeg_; }

  enum class Compression : std::uint8_t { applied, left_out };
  Result<void> render(int k, ColorBuffer& color,
                      Compression compression = Compression::applied);

  static constexpr Seconds kBegin = 1;  ///< Time of the first frame.

 private:
  Sequence(const SequenceOptions& options, FlightPath path, Rig true_rig);
  SceneAt scene(Seconds t) const;
  Result<void> make_renderers(const Rng& rng);

  SequenceOptions options_;
  FlightPath path_;
  Rig true_rig_;
  int jpeg_ = 0;
  Vector3 platform_velocity_ = Vector3::Zero();
  std::vector<CameraRenderer> renderers_;  // raw, compressed, and both in the dark
};

/// Leaves frames.csv, the pictures, truth.tum, truth.csv (with the velocity), rig.yaml
/// (as written down), rig_true.yaml and, last, sequence.json: a SOURCE (CONTRACT) with
/// its truth. `progress` is called after each picture.
/// @returns What sequence.json holds.
Result<std::string> save_sequence(const std::string& folder,
                                  const SequenceOptions& options,
                                  const std::function<void(int done)>& progress = {});

}  // namespace alight
