#pragma once
#include <cstdint>
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/so3.h"

namespace alight {

enum class PathKind : std::uint8_t { still, straight, circle, block, eight };

/// Shape of the UGV's drive. Every path begins at the origin, heading along x.
struct PathConfig {
  PathKind kind = PathKind::still;
  double radius_m = 1.5;         ///< circle, and each loop of the eight
  double side_m = 3;             ///< block
  double corner_radius_m = 0.5;  ///< block; 0: corners are turned in place

  Result<void> validate() const;
};

/// A point of the path on the floor.
struct PathPoint {
  Vector2 p_I = Vector2::Zero();  ///< m
  double heading = 0;             ///< rad, continuous along the path but at corners
  double curvature = 0;           ///< 1/m, positive to the left
};

/// A plane curve by arc length, made of lines and arcs; closed ones go on for ever.
/// Circle, block and the eight's first loop turn to the left.
class Path {
 public:
  explicit Path(const PathConfig& config);

  /// Point at `s` m from the start; s below 0 is on the line before it.
  PathPoint at(double s) const;

  /// Arc length of the next corner at or after `s` that is turned in place; infinite
  /// when there is none.
  double next_corner(double s) const;
  /// Heading after the corner at `s`, less that before it, rad.
  double corner_turn() const { return corner_turn_; }

  bool moves() const { return !pieces_.empty(); }
  double length() const { return length_; }  ///< of one round, m; infinite when open

 private:
  struct Piece {
    double s;  ///< where it begins
    double length;
    double curvature;
    PathPoint start;
  };
  void add(double length, double curvature);

  std::vector<Piece> pieces_;
  std::vector<double> corners_;  ///< arc lengths in [0, length_)
  double length_ = 0;
  double corner_turn_ = 0;
  PathPoint end_;
};

}  // namespace alight
