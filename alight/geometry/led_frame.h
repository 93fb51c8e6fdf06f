#pragma once
#include <cstdint>

#include "alight/base/fixed_vector.h"
#include "alight/base/time.h"
#include "alight/geometry/camera.h"

namespace alight {

inline constexpr int kMaxLeds = 16;
inline constexpr int kMaxRefused = 32;
inline constexpr int kMaxGroup = 4;  ///< Lights told apart within one patch.

/// Information on the images of up to kMaxGroup LEDs together, px^-2; 2 n x 2 n.
using GroupMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0,
                                  2 * kMaxGroup, 2 * kMaxGroup>;

enum class LedColor : std::uint8_t { none, red, green, blue, white };
const char* to_string(LedColor color);

/// What the picture says of one LED, or of several whose images ran together.
struct LedObservation {
  std::uint16_t leds = 0;  ///< Bit i: LED i of the rig contributes. The measurement is
                           ///< of the mean of their images.
  Vector2 uv = Vector2::Zero();       ///< px
  Matrix2 cov = Matrix2::Identity();  ///< px^2, of `uv`
  double depth_m = 0;                 ///< Along the optical axis; 0 when unknown.
};

/// Observations of single LEDs whose images overlap: what is known of each depends on
/// the others.
struct OverlappingLeds {
  int first = 0;            ///< They stand together in LedFrame::seen from here.
  int count = 0;            ///< 2 to kMaxGroup.
  GroupMatrix information;  ///< px^-2, of their uv one after the other; singular where
                            ///< the picture does not decide. Their `cov` are its
                            ///< marginals, kept finite.
};

/// Why a blob was not used.
enum class Refusal : std::uint8_t {
  no_led_near,  ///< No LED is expected there.
  wrong_color,
  too_small,
  too_large,
  other_is_nearer,    ///< Its LED took a better blob.
  cut_by_edge,        ///< Part of it lies outside the picture.
  off_constellation,  ///< Does not fit the pose that the others agree on.
  gated,              ///< The filter found it improbable.
  stray               ///< Known from earlier pictures as no LED.
};
const char* to_string(Refusal refusal);

struct RefusedBlob {
  Vector2 uv = Vector2::Zero();
  Refusal reason = Refusal::no_led_near;
};

/// The correspondences of one picture: what vision hands to estimation.
struct LedFrame {
  Time t = 0;  ///< Mid-exposure, ns.
  FixedVector<LedObservation, kMaxLeds> seen;
  FixedVector<OverlappingLeds, kMaxLeds / 2> groups;  ///< In the order of `first`.
  FixedVector<RefusedBlob, kMaxRefused> refused;

  /// Number of LEDs in view, merged ones counted each.
  int led_count() const;
};

/// Image of an observation's LEDs: the mean of theirs; empty if one is behind the lens.
/// `J` is by the tangent (dp_NB, dR in B), as in project_led.
struct Constellation;
std::optional<Vector2> project_observation(const Camera& camera, const Pose& X_NB,
                                           const Constellation& leds,
                                           std::uint16_t which, Matrix26* J = nullptr);

}  // namespace alight
