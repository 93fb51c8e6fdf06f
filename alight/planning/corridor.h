#pragma once
#include <array>

#include "alight/base/fixed_vector.h"
#include "alight/planning/planner.h"

namespace alight {

/// The visibility-safety corridor (VSFC, eqn:MP_KINE): half-spaces of the rear space
/// (segment 0) and the touch-down space (segment 1) in N, shrunk for the drone.
struct Corridor {
  FixedVector<HalfSpace, 128> planes;
  bool full = false;  ///< More obstacles than the planes hold: not to be planned in.

  void add(int segment, const Vector3& a, double b, Constraint meaning);
};

/// Headings the plan passes through, rad; low <= high.
struct YawRange {
  double low = 0;
  double high = 0;
};
YawRange yaw_range(double start, double end);

/// Half the diagonal of the drone, m.
double drone_radius(const Rig& rig);

/// Where and how fast a landing ends.
FlatState landing_end(const PlannerConfig& config, const Rig& rig);

Corridor build_corridor(const PlannerConfig& config, const Rig& rig,
                        const FlatState& start, const FlatState& end);

/// A view plane in N through the lens: n'(p - p_NC) <= 0 for points in the picture,
/// `border` px from its edge. Distortion is met by the innermost point of each edge.
struct ViewPlane {
  Vector3 n = Vector3::Zero();
  Constraint meaning = Constraint::view_left;
};
std::array<ViewPlane, 4> view_planes(const Camera& camera, double border_px);

/// The plane through the lens and the pad's far edge: what lies above (n'(p - p_NC) <=
/// 0) is not hidden by the pad. Seen from below the pad's surface it is the near edge.
Vector3 pad_shadow_normal(const Camera& camera, const PadSpec& pad);

/// Largest n'R p_BL over the LEDs, headings in `yaw` and further rotations by at most
/// `angle` about any axis (n unit). m
double led_support(const Constellation& leds, const Vector3& n, const YawRange& yaw,
                   double angle);

}  // namespace alight
