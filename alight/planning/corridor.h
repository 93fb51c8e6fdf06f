#pragma once
#include <array>

#include "alight/base/fixed_vector.h"
#include "alight/planning/planner.h"

namespace alight {

/// The visibility-safety corridor (VSFC, eqn:MP_KINE): half-spaces of the rear space
/// (segment 0) and the touch-down space (segment 1) in N, shrunk for the drone.
struct Corridor {
  FixedVector<HalfSpace, 128> planes;
  bool full = false;     ///< More obstacles than the planes hold: not to be planned in.
  std::size_t hard = 0;  ///< Planes from here on are wishes (add_view_wishes).

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

/// The space a landing begins in: the rear one (above h_T, or beside the pad), or,
/// planned anew on its way down, the touch-down space for both segments.
enum class Beginning : std::uint8_t { rear, touch_down };
/// Those that the start lies in, the likelier one first; never empty.
FixedVector<Beginning, 2> beginnings(const PlannerConfig& config, const Rig& rig,
                                     const FlatState& start, const FlatState& end);

Corridor build_corridor(const PlannerConfig& config, const Rig& rig,
                        const FlatState& start, const FlatState& end,
                        Beginning beginning);
/// In the first of `beginnings`.
Corridor build_corridor(const PlannerConfig& config, const Rig& rig,
                        const FlatState& start, const FlatState& end);

/// The way back from a landing: out of the touch-down space (`low`), the feet
/// `escape_clearance_m` above the pad, to `goal` in the rear space; or within the rear
/// space.
Corridor build_escape_corridor(const PlannerConfig& config, const Rig& rig,
                               const FlatState& from, const FlatState& goal, bool low);

/// Visibility as a goal: view planes up to `view_wish_px` further inside the picture,
/// as far as the given points (of each segment) are inside them. False if there are
/// none.
using Fixed = std::array<FixedVector<Vector3, 4>, kSegments>;
bool add_view_wishes(const PlannerConfig& config, const Rig& rig,
                     const FlatState& start, const Fixed& fixed, Corridor& corridor);

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
