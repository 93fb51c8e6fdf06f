#pragma once
#include <optional>
#include <string_view>
#include <vector>

#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/rig.h"
#include "alight/sim/camera_renderer.h"

namespace alight {

/// The rows of the paper's evaluation of relative state estimation (Tables I and II).
enum class PaperRow : std::uint8_t {
  static_block,    ///< Platform still, the drone flies a rectangle before it.
  static_random,   ///< Platform still, the drone is flown about at random.
  dynamic_block,   ///< Platform round a block, the drone keeps its place in N.
  dynamic_random,  ///< Platform driven by hand, the drone flies a rectangle in N.
  circle,          ///< Platform in a circle, the drone follows.
  landing          ///< Platform in a circle, the drone lands on it.
};
inline constexpr PaperRow kPaperRows[] = {
    PaperRow::static_block,   PaperRow::static_random, PaperRow::dynamic_block,
    PaperRow::dynamic_random, PaperRow::circle,        PaperRow::landing};
const char* to_string(PaperRow row);
std::optional<PaperRow> paper_row(std::string_view name);
/// Flown by the whole of Alight in its loop; the other rows follow a script.
bool is_flown(PaperRow row);

/// A drone that goes where the script says: it stands on the pad, takes off, flies its
/// path before the camera, swaying a little, with the tilt that its motion in I and the
/// air ask for.
class ScriptedFlight {
 public:
  static constexpr Seconds kParked = 1.2;  ///< Stands so long,
  static constexpr Seconds kOnPath = 4.5;  ///< is on its path from here,
  static constexpr Seconds kEnd = 16;      ///< to here.

  /// @param R_FB  LED frame against the airframe, as in TrueExtras.
  /// @pre !is_flown(row)
  ScriptedFlight(PaperRow row, const Rig& rig, const Matrix3& R_FB, Rng rng);

  SceneAt at(Seconds t) const;

 private:
  /// Sums of three sines that stay within [-1, 1].
  struct Wave {
    explicit Wave(Rng rng, double slowest_hz, double fastest_hz);
    double operator()(Seconds t) const;
    double integral(Seconds t) const;  ///< From 0.
    double amplitude[3], rate[3], phase[3];
  };
  Vector3 path(Seconds t) const;  // p_NB
  Vector3 place(Seconds t) const;
  Vector3 place_I(Seconds t) const;
  Pose platform(Seconds t) const;

  PaperRow row_;
  Matrix3 R_FB_;
  Vector3 p_NC_;
  double height_m_;  // of the pad
  Vector3 parked_;   // p_NB
  double parked_yaw_;
  Vector3 corners_[4];
  Wave range_, azimuth_, elevation_, yaw_, sway_[3], speed_, turn_;
  std::vector<Vector2> driven_;  // p_IN, every kDriveStep
};

}  // namespace alight
