#include "alight/planning/corridor.h"

#include <algorithm>
#include <cmath>

namespace alight {
namespace {

constexpr double kNearest = 0.05;  ///< m, nothing is seen nearer to the lens.

/// The faces of a box grown by `radius`, as half-spaces that lie outside it.
FixedVector<HalfSpace, 6> faces_outside(const Obstacle& box, double radius) {
  FixedVector<HalfSpace, 6> faces;
  for (int axis = 0; axis < 3; ++axis) {
    Vector3 n = Vector3::Zero();
    n[axis] = 1;
    faces.push_back({0, n, box.min_m[axis] - radius, Constraint::obstacle});
    faces.push_back({0, -n, -box.max_m[axis] - radius, Constraint::obstacle});
  }
  return faces;
}

double inside(const HalfSpace& plane, const Vector3& p) {
  return plane.b - plane.a.dot(p);
}

Vector3 nearest_in(const Obstacle& box, const Vector3& p) {
  return p.cwiseMax(box.min_m).cwiseMin(box.max_m);
}

/// The plane, tangent to the box grown by `radius`, that faces a point outside it.
void add_facing(const Obstacle& box, double radius, const Vector3& p,
                FixedVector<HalfSpace, 8>& planes) {
  const Vector3 q = nearest_in(box, p);
  const double distance = (p - q).norm();
  if (distance < 1e-6) return;
  const Vector3 n = (q - p) / distance;
  planes.push_back({0, n, n.dot(q) - radius, Constraint::obstacle});
}

/// Half-spaces outside a box grown by `radius`: its faces and the planes that face the
/// way from `must` to `wish` where it comes nearest, and `must` itself.
FixedVector<HalfSpace, 8> planes_outside(const Obstacle& box, double radius,
                                         const Vector3& must, const Vector3& wish) {
  FixedVector<HalfSpace, 8> planes;
  for (const HalfSpace& face : faces_outside(box, radius)) planes.push_back(face);
  // Nearest point of the way to the box: by turns, the sets being convex.
  const Vector3 way = wish - must;
  Vector3 p = must;
  for (int i = 0; i < 50 && way.squaredNorm() > 1e-12; ++i) {
    const Vector3 q = nearest_in(box, p);
    p = must + std::clamp((q - must).dot(way) / way.squaredNorm(), 0.0, 1.0) * way;
  }
  add_facing(box, radius, p, planes);
  add_facing(box, radius, must, planes);
  return planes;
}

/// The plane with `must` on its free side that leaves `wish` most room.
HalfSpace separating(const Obstacle& box, double radius, const Vector3& must,
                     const Vector3& wish) {
  const auto planes = planes_outside(box, radius, must, wish);
  const auto room = [&](const HalfSpace& plane) {
    const double a = inside(plane, must);
    return a < 0 ? a - 1e3
                 : std::min(a, 0.05) + std::min(inside(plane, wish), 0.05) + 1e-3 * a;
  };
  return *std::max_element(
      planes.begin(), planes.end(),
      [&](const HalfSpace& a, const HalfSpace& b) { return room(a) < room(b); });
}

/// Greatest overshoot of a heading per rad/s it starts with: 0.2 of the duration.
constexpr double kYawOvershoot = 0.2 * 4;

class Builder {
 public:
  Builder(const PlannerConfig& config, const Rig& rig, const FlatState& start,
          const FlatState& end)
      : config_(config),
        rig_(rig),
        start_(start),
        end_(end),
        paper_(config.profile == Profile::paper),
        radius_(config.shrink_m > 0 ? config.shrink_m : drone_radius(rig)),
        gear_(rig.drone.gear_height_m),
        also_(start.p_NB) {}

  Corridor build(Beginning beginning) {
    if (beginning == Beginning::rear) {
      add_rear();
    } else {
      add_touch_down(0);
    }
    add_touch_down(1);
    finish();
    return corridor_;
  }

  Corridor build_escape(const FlatState& from, bool low) {
    also_ = from.p_NB;
    add_rear();
    if (low) {
      gear_ += config_.escape_clearance_m;
      add_touch_down(1);
    }
    finish();
    // Out of the touch-down space first.
    Corridor back;
    for (const HalfSpace& plane : corridor_.planes) {
      if (low) {
        back.add(1 - plane.segment, plane.a, plane.b, plane.meaning);
      } else if (plane.segment == 0) {
        back.add(0, plane.a, plane.b, plane.meaning);
        back.add(1, plane.a, plane.b, plane.meaning);
      }
    }
    back.full = back.full || corridor_.full;
    back.hard = back.planes.size();
    return back;
  }

  FixedVector<Beginning, 2> beginnings() {
    const double z = start_.p_NB.z();
    Corridor saved;
    std::swap(saved, corridor_);
    add_touch_down(0);
    const bool down = std::all_of(
        corridor_.planes.begin(), corridor_.planes.end(),
        [&](const HalfSpace& plane) { return inside(plane, start_.p_NB) >= -1e-7; });
    std::swap(saved, corridor_);
    if (!down) return {Beginning::rear};
    // Beside the pad it may go round it; in between it is probably on its way down.
    const bool up = z >= config_.touch_down_height_m;
    if (up || (z < rear_low() && beside_pad().a.z() < 2)) {
      return {Beginning::rear, Beginning::touch_down};
    }
    if (z < rear_low()) return {Beginning::touch_down};
    return {Beginning::touch_down, Beginning::rear};
  }

  void add_wishes(const Fixed& fixed, Corridor& corridor) {
    const Vector3 p_NC = rig_.camera.X_NC.translation();
    std::array<bool, kSegments * 4> done{};
    for (const double share : {1.0, 0.75, 0.5, 0.25}) {
      const auto planes = view_planes(
          rig_.camera, config_.view_border_px + share * config_.view_wish_px);
      for (std::size_t s = 0; s < kSegments; ++s) {
        for (std::size_t k = 0; k < planes.size(); ++k) {
          if (done[s * 4 + k]) continue;
          const Vector3& n = planes[k].n;
          const double b = n.dot(p_NC) - support(n);
          const bool fits =
              std::all_of(fixed[s].begin(), fixed[s].end(),
                          [&](const Vector3& p) { return n.dot(p) <= b - 1e-6; });
          if (!fits) continue;
          done[s * 4 + k] = true;
          corridor.add(static_cast<int>(s), n, b, planes[k].meaning);
        }
      }
    }
  }

 private:
  void finish() {
    for (int segment = 0; segment < kSegments; ++segment) {
      add_free_space(segment);
      add_view(segment);
      add_obstacles(segment);
    }
    corridor_.hard = corridor_.planes.size();
  }

  double rear_low() const {
    return std::max(config_.touch_down_height_m - config_.dilation_m, radius_);
  }

  /// The side of the pad that the start is at; a.z() is 2 if it is above the pad.
  HalfSpace beside_pad() const {
    const double half = rig_.pad.size_m / 2;
    const Obstacle pad{{-half, -half, -rig_.pad.above_floor_m - 1}, {half, half, 0}};
    HalfSpace best;
    best.a.z() = 2;
    double most = 0;
    for (const HalfSpace& face : faces_outside(pad, radius_)) {
      if (face.a.z() != 0 || inside(face, start_.p_NB) < most) continue;
      most = inside(face, start_.p_NB);
      best = face;
    }
    return best;
  }

  /// The rear space: above h_T, or behind (beside) the pad if the start is lower.
  void add_rear() {
    const HalfSpace side = beside_pad();
    if (start_.p_NB.z() >= rear_low() || side.a.z() == 2) {
      corridor_.add(0, -Vector3::UnitZ(), -rear_low(), Constraint::touch_down_height);
    } else {
      corridor_.add(0, side.a, side.b, Constraint::pad);
    }
    add_rear_common();
  }

  void add_rear_common() {
    corridor_.add(0, -Vector3::UnitZ(), rig_.pad.above_floor_m - radius_,
                  Constraint::floor);
    const Vector3 n = pad_shadow_normal(rig_.camera, rig_.pad);
    if (!paper_ && n.norm() > 0) {
      const Vector3 p_NC = rig_.camera.X_NC.translation();
      corridor_.add(0, n, n.dot(p_NC) - support(n), Constraint::pad_shadow);
    }
  }

  void add_touch_down(int segment) {
    const double top = config_.touch_down_height_m + config_.dilation_m;
    corridor_.add(segment, Vector3::UnitZ(), top, Constraint::touch_down_height);
    if (paper_) {
      corridor_.add(segment, -Vector3::UnitZ(), -radius_, Constraint::pad);
      return;
    }
    corridor_.add(segment, -Vector3::UnitZ(), -gear_, Constraint::pad);
    const double slope = std::tan(config_.funnel_slope_deg * kDegree);
    for (const Vector3& side : {Vector3::UnitX().eval(), Vector3::UnitY().eval()}) {
      for (const double sign : {1.0, -1.0}) {
        // |x| <= radius + (z - z_end) / slope
        const Vector3 a = sign * slope * side - Vector3::UnitZ();
        const double b = slope * config_.funnel_radius_m - end_.p_NB.z();
        corridor_.add(segment, a, b, Constraint::funnel);
      }
    }
  }

  void add_free_space(int segment) {
    const Vector3 low = start_.p_NB.cwiseMin(end_.p_NB).cwiseMin(also_);
    const Vector3 high = start_.p_NB.cwiseMax(end_.p_NB).cwiseMax(also_);
    for (int axis = 0; axis < 3; ++axis) {
      Vector3 n = Vector3::Zero();
      n[axis] = 1;
      const double margin = config_.free_space_margin_m;
      if (axis < 2 || segment == 0) {
        corridor_.add(segment, n, high[axis] + margin, Constraint::free_space);
      }
      if (axis < 2) {
        corridor_.add(segment, -n, -(low[axis] - margin), Constraint::free_space);
      }
    }
  }

  void add_view(int segment) {
    const Vector3 p_NC = rig_.camera.X_NC.translation();
    const auto add = [&](const Vector3& n, double offset, Constraint meaning) {
      const double shift = paper_ ? radius_ : support(n);
      corridor_.add(segment, n, n.dot(p_NC) + offset - shift, meaning);
    };
    for (const ViewPlane& plane : view_planes(rig_.camera, config_.view_border_px)) {
      add(plane.n, 0, plane.meaning);
    }
    add(-rig_.camera.X_NC.linear().col(2), -kNearest, Constraint::view_depth);
  }

  void add_obstacles(int segment) {
    for (const Obstacle& box : rig_.pad.obstacles) {
      const Vector3& must = segment == 0 ? start_.p_NB : end_.p_NB;
      const Vector3& wish = segment == 0 ? end_.p_NB : start_.p_NB;
      const HalfSpace face = separating(box, radius_, must, wish);
      corridor_.add(segment, face.a, face.b, Constraint::obstacle);
    }
  }

  double support(const Vector3& n) const {
    const double tilt = std::min(config_.tilt_max_deg, rig_.drone.tilt_max_deg);
    YawRange yaw = yaw_range(start_.yaw, config_.end_yaw);
    const double over = kYawOvershoot * std::abs(start_.yaw_rate);
    yaw.low -= over;
    yaw.high += over;
    return led_support(rig_.leds, n, yaw,
                       (tilt + config_.attitude_spare_deg) * kDegree);
  }

  const PlannerConfig& config_;
  const Rig& rig_;
  const FlatState& start_;
  const FlatState& end_;
  bool paper_;
  double radius_;
  double gear_;   ///< Least height in the touch-down space, m.
  Vector3 also_;  ///< Lies in the free space too.
  Corridor corridor_;
};

}  // namespace

void Corridor::add(int segment, const Vector3& a, double b, Constraint meaning) {
  const double length = a.norm();
  if (!planes.push_back({segment, a / length, b / length, meaning})) full = true;
}

double drone_radius(const Rig& rig) { return rig.drone.size_m / 2 * std::sqrt(2.0); }

FlatState landing_end(const PlannerConfig& config, const Rig& rig) {
  FlatState end;
  end.p_NB.z() =
      config.end_height_m > 0 ? config.end_height_m : rig.drone.gear_height_m;
  end.v_NB.z() = -config.touch_down_speed_m_s;
  end.yaw = config.end_yaw;
  return end;
}

FixedVector<Beginning, 2> beginnings(const PlannerConfig& config, const Rig& rig,
                                     const FlatState& start, const FlatState& end) {
  return Builder(config, rig, start, end).beginnings();
}

Corridor build_corridor(const PlannerConfig& config, const Rig& rig,
                        const FlatState& start, const FlatState& end,
                        Beginning beginning) {
  return Builder(config, rig, start, end).build(beginning);
}

Corridor build_corridor(const PlannerConfig& config, const Rig& rig,
                        const FlatState& start, const FlatState& end) {
  return build_corridor(config, rig, start, end,
                        beginnings(config, rig, start, end)[0]);
}

Corridor build_escape_corridor(const PlannerConfig& config, const Rig& rig,
                               const FlatState& from, const FlatState& goal, bool low) {
  const FlatState end = landing_end(config, rig);
  FlatState start = goal;  // The headings that occur are those of a landing from there.
  start.yaw = from.yaw;
  start.yaw_rate = from.yaw_rate;
  return Builder(config, rig, start, end).build_escape(from, low);
}

bool add_view_wishes(const PlannerConfig& config, const Rig& rig,
                     const FlatState& start, const Fixed& fixed, Corridor& corridor) {
  if (config.view_wish_px <= 0) return false;
  Builder(config, rig, start, start).add_wishes(fixed, corridor);
  return corridor.planes.size() > corridor.hard && !corridor.full;
}

}  // namespace alight
