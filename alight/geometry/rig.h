#pragma once
#include <optional>
#include <string>
#include <vector>

#include "alight/base/fixed_vector.h"
#include "alight/base/result.h"
#include "alight/geometry/camera.h"
#include "alight/geometry/led_frame.h"
#include "alight/geometry/mosaic.h"

namespace alight {

struct Led {
  Vector3 p_BL = Vector3::Zero();   ///< m
  LedColor color = LedColor::none;  ///< none: any colour (infrared rigs)
};

/// The LEDs in the order of the rig file.
struct Constellation {
  FixedVector<Led, kMaxLeds> leds;

  int size() const { return static_cast<int>(leds.size()); }
  const Vector3& p_BL(int i) const { return leds[static_cast<std::size_t>(i)].p_BL; }
  LedColor color(int i) const { return leds[static_cast<std::size_t>(i)].color; }
  /// Mean of the LEDs' places.
  Vector3 middle_B() const {
    Vector3 middle = Vector3::Zero();
    for (const Led& led : leds) middle += led.p_BL / size();
    return middle;
  }
};

/// How well a rig file knows where its LEDs are as a whole, one sd: what moves, turns
/// or scales all of them alike, which no picture shows.
struct LedFrameSpec {
  Vector3 shift_sd_m = Vector3::Zero();   ///< Along the axes of B,
  Vector3 turn_sd_rad = Vector3::Zero();  ///< about these, through the LEDs' middle.
  double size_sd = 0;                     ///< Share of their distances.

  bool exact() const {
    return shift_sd_m.isZero(0) && turn_sd_rad.isZero(0) && size_sd == 0;
  }
};

struct CameraTiming {
  double rate_hz = 60;
  double exposure_ms = 2;
  double readout_ms = 0;        ///< Rolling shutter, first row to last; 0 is global. A
                                ///< picture's time is that of its middle row.
  double frame_to_use_ms = 30;  ///< From mid-exposure until the picture can be used.
};

struct DroneSpec {
  double size_m = 0.18;
  double mass_kg = 0.55;
  Vector3 inertia_kg_m2{0.0018, 0.0018, 0.003};
  double arm_m = 0.09;
  double propeller_radius_m = 0.0381;
  double motor_ms = 30;
  double thrust_to_weight = 2.5;
  double tilt_max_deg = 35;
  double gear_height_m = 0.06;  ///< Origin of B above the pad at rest.
};

/// A box on the platform that the drone must not touch, in N.
struct Obstacle {
  Vector3 min_m = Vector3::Zero();
  Vector3 max_m = Vector3::Zero();
};

struct PadSpec {
  double size_m = 0.43;
  double above_floor_m = 0.26;
  std::vector<Obstacle> obstacles;
};

struct DynamicLimits {
  double speed_m_s = 4;          ///< of v_IB
  double acceleration_m_s2 = 8;  ///< of a_IB
};

enum class TagFamily : std::uint8_t { dict_4x4_50, tag36h11 };
const char* to_string(TagFamily family);

/// A square marker on the drone, for the methods that look for one (aruco, apriltag).
struct Tag {
  TagFamily family = TagFamily::dict_4x4_50;
  int id = 0;
  double size_m = 0.06;  ///< Side of the black square; white paper goes on around it.
  /// T: origin at the tag's centre; who looks at it sees x right, y up; z out of it.
  Pose X_BT = Pose::Identity();
};

/// What the user wrote down of camera, drone and pad (CONTRACT: Rig). The true rig
/// differs; only the simulation knows it.
struct Rig {
  Camera camera;
  CameraTiming timing;
  /// Of a camera whose pictures keep what each pixel saw: raw ones, and those that were
  /// interpolated to colours but neither compressed nor scaled.
  Mosaic mosaic = Mosaic::none;
  /// The camera stores light by its power 1 / gamma, 1: as it is; 0: not known.
  double gamma = 0;
  static constexpr double kGammaLeast = 0.4, kGammaMost = 3;
  Constellation leds;
  LedFrameSpec led_frame;
  DroneSpec drone;
  PadSpec pad;
  DynamicLimits limits;
  std::optional<Tag> tag;

  /// Names the first field that is out of range, its value and its bounds.
  Result<void> validate() const;
};

/// X_NC (optical) from the pose of the camera's housing in N: x out of the lens, y
/// left, z up.
Pose optical_from_housing(const Pose& X_NH);

/// The inverse of optical_from_housing.
Pose housing_from_optical(const Pose& X_NC);

/// The rig of the paper's authors; config/rigs/alan.yaml says the same.
Rig alan_rig();

}  // namespace alight
