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

/// The face with `must` on its free side that leaves `wish` most room.
HalfSpace separating(const Obstacle& box, double radius, const Vector3& must,
                     const Vector3& wish) {
  const auto faces = faces_outside(box, radius);
  const auto room = [&](const HalfSpace& face) {
    const double a = inside(face, must);
    return a < 0 ? a - 1e3
                 : std::min(a, 0.05) + std::min(inside(face, wish), 0.05) + 1e-3 * a;
  };
  return *std::max_element(
      faces.begin(), faces.end(),
      [&](const HalfSpace& a, const HalfSpace& b) { return room(a) < room(b); });
}

class Builder {
 public:
  Builder(const PlannerConfig& config, const Rig& rig, const FlatState& start,
          const FlatState& end)
      : config_(config),
        rig_(rig),
        start_(start),
        end_(end),
        paper_(config.profile == Profile::paper),
        radius_(config.shrink_m > 0 ? config.shrink_m : drone_radius(rig)) {}

  Corridor build() {
    add_rear();
    add_touch_down(1);
    for (int segment = 0; segment < kSegments; ++segment) {
      add_free_space(segment);
      add_view(segment);
      add_obstacles(segment);
    }
    return corridor_;
  }

 private:
  /// The rear space: above h_T, or behind (beside) the pad if the start is lower. A
  /// start in the touch-down space, as when planning anew, keeps to that.
  void add_rear() {
    const Vector3& p = start_.p_NB;
    const double low =
        std::max(config_.touch_down_height_m - config_.dilation_m, radius_);
    const double top = config_.touch_down_height_m + config_.dilation_m;
    if (p.z() >= low) {
      corridor_.add(0, -Vector3::UnitZ(), -low, Constraint::touch_down_height);
      return add_rear_common();
    }
    const double half = rig_.pad.size_m / 2;
    const Obstacle pad{{-half, -half, -rig_.pad.above_floor_m - 1}, {half, half, 0}};
    HalfSpace best;
    double most = -1e9;
    for (const HalfSpace& face : faces_outside(pad, radius_)) {
      if (face.a.z() != 0 || inside(face, p) <= most) continue;
      most = inside(face, p);
      best = face;
    }
    if (most >= 0) {
      corridor_.add(0, best.a, best.b, Constraint::pad);
      return add_rear_common();
    }
    if (p.z() <= top && p.z() >= end_.p_NB.z() - 1e-9) return add_touch_down(0);
    corridor_.add(0, -Vector3::UnitZ(), -low, Constraint::touch_down_height);
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
    corridor_.add(segment, -Vector3::UnitZ(), -rig_.drone.gear_height_m,
                  Constraint::pad);
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
    const Vector3 low = start_.p_NB.cwiseMin(end_.p_NB);
    const Vector3 high = start_.p_NB.cwiseMax(end_.p_NB);
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
    return led_support(rig_.leds, n, yaw_range(start_.yaw, config_.end_yaw),
                       (tilt + config_.attitude_spare_deg) * kDegree);
  }

  const PlannerConfig& config_;
  const Rig& rig_;
  const FlatState& start_;
  const FlatState& end_;
  bool paper_;
  double radius_;
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

Corridor build_corridor(const PlannerConfig& config, const Rig& rig,
                        const FlatState& start, const FlatState& end) {
  return Builder(config, rig, start, end).build();
}

}  // namespace alight
