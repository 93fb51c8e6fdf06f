#include "alight/platform/path.h"

#include <cassert>
#include <cmath>
#include <limits>

#include "alight/base/bounds.h"

namespace alight {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

PathPoint advance(const PathPoint& start, double curvature, double ds) {
  PathPoint point = start;
  point.curvature = curvature;
  const double turn = curvature * ds;
  const double half = turn / 2;
  const double chord = std::abs(half) < 1e-9 ? ds : ds * std::sin(half) / half;
  const double mid = start.heading + half;
  point.p_I += chord * Vector2(std::cos(mid), std::sin(mid));
  point.heading = start.heading + turn;
  return point;
}

}  // namespace

Result<void> PathConfig::validate() const {
  return check_bounds({{"radius_m", radius_m, 0.1, 1000},
                       {"side_m", side_m, 0.2, 1000},
                       {"corner_radius_m", corner_radius_m, 0, side_m / 2}});
}

Path::Path(const PathConfig& config) {
  assert(config.validate());
  const double quarter = kPi / 2;
  switch (config.kind) {
    case PathKind::still:
      break;
    case PathKind::straight:
      add(kInfinite, 0);
      break;
    case PathKind::circle:
      add(2 * kPi * config.radius_m, 1 / config.radius_m);
      break;
    case PathKind::eight:
      add(2 * kPi * config.radius_m, 1 / config.radius_m);
      add(2 * kPi * config.radius_m, -1 / config.radius_m);
      break;
    case PathKind::block: {
      const double r = config.corner_radius_m;
      const double straight = config.side_m - 2 * r;
      add(straight / 2, 0);
      for (int corner = 0; corner < 4; ++corner) {
        if (r > 0) {
          add(quarter * r, 1 / r);
        } else {
          corners_.push_back(length_);
          end_.heading += quarter;
          corner_turn_ = quarter;
        }
        add(corner == 3 ? straight / 2 : straight, 0);
      }
      break;
    }
  }
}

void Path::add(double length, double curvature) {
  if (length <= 0) return;
  pieces_.push_back({length_, length, curvature, end_});
  length_ += length;
  if (std::isfinite(length)) end_ = advance(end_, curvature, length);
}

PathPoint Path::at(double s) const {
  if (pieces_.empty()) return {};
  if (s < 0) return advance({}, 0, s);
  const double round = std::isfinite(length_) ? std::floor(s / length_) : 0;
  const double rest = round > 0 ? s - round * length_ : s;
  std::size_t k = 0;
  while (k + 1 < pieces_.size() && pieces_[k + 1].s <= rest) ++k;
  const Piece& piece = pieces_[k];
  return advance(piece.start, piece.curvature, rest - piece.s);
}

double Path::next_corner(double s) const {
  if (corners_.empty()) return kInfinite;
  const double round = std::max(0.0, std::floor(s / length_));
  for (const double corner : corners_) {
    if (round * length_ + corner >= s) return round * length_ + corner;
  }
  return (round + 1) * length_ + corners_.front();
}

}  // namespace alight
