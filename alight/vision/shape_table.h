#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "alight/geometry/rig.h"

namespace alight {

/// What three LEDs can look like. For each of a few LED triples (see covering_triples)
/// it tabulates which image triangles the drone can make at all,
/// seen from this camera at an attitude that is allowed: direction of the first side
/// and place of the third corner relative to it. A look-up tells most wrong triples of
/// blobs from right ones before a pose is computed.
class ShapeTable {
 public:
  using Triple = std::array<int, 3>;

  /// `allowed` says whether a pose is one the drone can have; none tilted by more than
  /// `tilt_max` is.
  ShapeTable(const Camera& camera, const Constellation& leds, double range_min_m,
             double range_max_m, double tilt_max,
             const std::function<bool(const Pose&)>& allowed);

  const std::vector<Triple>& triples() const { return triples_; }
  /// The first of them, which suffice while most LEDs are seen.
  std::size_t few() const { return few_; }

  /// First side of a triangle, prepared for its many third corners.
  struct Side {
    Vector2 a, along,
        across;  // where the first corner is; by the side's length squared
    std::size_t angle;
  };
  static Side side(const Vector2& a, const Vector2& b);

  /// Words of a bit set over `triples()`: those that may look like this triangle
  /// (undistorted px).
  std::size_t words() const { return words_; }
  const std::uint64_t* possible(const Side& ab, const Vector2& c) const {
    return &bits_[cell(ab, c) * words_];
  }

 private:
  static constexpr std::size_t kAngles = 32;
  static constexpr std::size_t kGrid = 32;
  static std::size_t cell(const Side& ab, const Vector2& c) {
    // f in the frame of the side, the plane drawn into a square.
    const Vector2 f = c - ab.a;
    const double along = ab.along.dot(f), across = ab.across.dot(f);
    constexpr double kHalf = kGrid / 2.0;
    const double scale = kHalf / (1 + std::max(std::abs(along), std::abs(across)));
    const auto at = [](double x) {
      return std::min(static_cast<std::size_t>(static_cast<int>(kHalf + x)), kGrid - 1);
    };
    return (ab.angle * kGrid + at(across * scale)) * kGrid + at(along * scale);
  }
  void widen();

  std::size_t words_ = 1;
  std::size_t few_ = 0;
  std::vector<Triple> triples_;
  std::vector<std::uint64_t> bits_;
};

/// LED triples such that all sets of LEDs that may be all that is seen contain one
/// (greedy cover, wide ones preferred). The first `few` do while most are seen: all but
/// one of six, three of eight, six of sixteen; all of them for four of six, and of more
/// than ten LEDs for two fifths.
struct CoveringTriples {
  std::vector<std::array<int, 3>> triples;
  std::size_t few = 0;
};
CoveringTriples covering_triples(const Constellation& leds);

}  // namespace alight
