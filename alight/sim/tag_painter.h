#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "alight/base/result.h"
#include "alight/base/rng.h"
#include "alight/geometry/rig.h"
#include "alight/sim/camera_config.h"
#include "alight/sim/camera_renderer.h"

namespace alight {

/// What is printed on a tag: square cells, row by row from the top as one sees it, with
/// the black border and one cell of white around it.
struct TagPattern {
  int cells = 0;  ///< Along a side, white ones included.
  std::vector<bool> white;

  bool at(int row, int column) const {
    return white[static_cast<std::size_t>(row * cells + column)];
  }
};

/// invalid_config for an id beyond those that can be drawn, 0 to 49 of each family.
Result<TagPattern> tag_pattern(const Tag& tag);

/// The rig's tag as the camera sees it, lit by the room: anti-aliased, blurred by point
/// spread and motion, with shot noise. Seen from its front only; the drone's own parts
/// never hide it, the platform does, all or nothing.
class TagPainter {
 public:
  /// @pre true_rig.tag, and `pattern` is its.
  TagPainter(const CameraSimConfig& config, const Rig& true_rig, TagPattern pattern);

  /// `brightness` scales the room's light; `rng` decides the shot noise. A rolling
  /// shutter sees all of a tag when it sees its middle.
  void paint(const RowScenes& scenes, double brightness, Rng rng, ColorBuffer& out);

 private:
  struct Box {
    int u0, v0, u1, v1;  // half-open
    int width() const { return u1 - u0; }
    int height() const { return v1 - v0; }
  };
  bool in_sight(const Pose& X_NB) const;
  bool extend(const Pose& X_CT, Box& box) const;
  void accumulate(const Pose& X_CT, float share);
  void spread(const Box& box, std::vector<float>& image);

  CameraSimConfig config_;
  Rig rig_;
  TagPattern pattern_;
  Pose X_CN_;
  std::vector<Obstacle> opaque_;  // in N
  double white_;                  // counts of white paper
  std::vector<float> kernel_;     // of the point spread, from the middle out
  std::vector<Vector3> rays_;     // of the box's samples
  std::vector<float> cover_, light_, row_;
};

}  // namespace alight
