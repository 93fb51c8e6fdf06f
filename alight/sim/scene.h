#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "alight/base/fixed_vector.h"
#include "alight/base/result.h"
#include "alight/base/time.h"
#include "alight/geometry/platform_state.h"
#include "alight/sim/true_rig.h"

namespace alight {

/// What can touch and be touched.
enum class Part : std::uint8_t {
  foot,
  body,
  rotor,
  pad,
  chassis,
  housing,
  obstacle,
  floor
};

/// A touch of drone part `ours` on `theirs`.
struct Touch {
  Part ours = Part::foot;
  int foot = 0;  ///< 0 to 3, of a foot.
  Part theirs = Part::floor;
};

/// The airframe's motion; F as in TrueExtras.
struct BodyMotion {
  Pose X_IF = Pose::Identity();
  Vector3 v_IF = Vector3::Zero();  ///< m/s in I, of F's origin
  Vector3 w_F = Vector3::Zero();   ///< rad/s
  Vector3 f_F = Vector3::Zero();   ///< Specific force at F's origin, m/s^2
};

/// Rigid bodies and contact, in MuJoCo: the drone on four feet, the platform with pad,
/// camera housing and obstacles, the floor. The platform follows the motion given to
/// it, whatever stands on it, and carries by friction.
class Scene {
 public:
  static Result<std::unique_ptr<Scene>> create(const TrueRig& rig, const Pose& X_IF,
                                               const PlatformState& platform,
                                               Seconds step);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  /// One step, in which the platform goes from `now` to `next` and the drone feels
  /// `force_I`, N, at the origin of F, and `moment_I`, Nm about it; gravity comes on
  /// top.
  void step(const PlatformState& now, const PlatformState& next, const Vector3& force_I,
            const Vector3& moment_I);

  const BodyMotion& body() const;
  /// Touches of the last step.
  const FixedVector<Touch, 32>& touches() const;
  /// Of the drone's feet, in F, m.
  static Vector3 foot(const DroneSpec& drone, int i);

 private:
  struct Parts;
  explicit Scene(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

/// The scene as MuJoCo reads it (MJCF).
std::string scene_mjcf(const TrueRig& rig, Seconds step);

}  // namespace alight
