#pragma once
#include <span>

#include "alight/base/fixed_vector.h"
#include "alight/base/time.h"
#include "alight/geometry/pose.h"
#include "alight/geometry/rig.h"

namespace alight {

/// Instants of a picture at most.
inline constexpr int kMaxInstants = 8;

/// Where platform and drone truly are at one instant.
struct SceneAt {
  Pose X_IN = Pose::Identity();
  Pose X_NB = Pose::Identity();
};

/// On the way from one pose to another, `share` of it.
Pose between(const Pose& from, const Pose& to, double share);

/// How long a row is exposed: no longer than from one picture to the next, whatever
/// `factor` (PictureTrouble) asks for.
Seconds exposure_of(const CameraTiming& timing, double factor = 1);
/// From when the first row's exposure begins until the last one's ends.
Seconds span_of(const CameraTiming& timing, double factor = 1);

/// What moves while a picture is taken, and which part of it each row sees.
class RowScenes {
 public:
  using Instants = FixedVector<SceneAt, 3>;

  /// @param instants       At an even pace over the whole picture's `span_of`; not
  ///                       empty, kept by the caller.
  /// @param readout_share  Of that, what reading out takes: 0 is a global shutter.
  RowScenes(std::span<const SceneAt> instants, double readout_share, int height)
      : instants_(instants), readout_share_(readout_share), height_(height) {}

  /// The same picture of something else that moves.
  RowScenes of(std::span<const SceneAt> instants) const {
    return {instants, readout_share_, height_};
  }

  bool rolling() const { return readout_share_ > 0; }
  /// While row `v` is exposed: begin, middle and end; all instants for a global
  /// shutter. `room` is where they are kept.
  std::span<const SceneAt> of_row(double v, Instants& room) const;
  /// While the row is exposed in which something is seen: `image(scene)` says where, if
  /// anywhere (optional, px).
  template <class Image>
  std::span<const SceneAt> where_seen(Image&& image, Instants& room) const {
    if (!rolling()) return instants_;
    std::span<const SceneAt> seen = of_row(0.5 * (height_ - 1), room);
    for (int k = 0; k < kRounds; ++k) {
      const auto uv = image(seen[seen.size() / 2]);
      if (!uv) break;
      seen = of_row(uv->y(), room);
    }
    return seen;
  }

 private:
  // What moves by a whole picture while one is read out is found to a thousandth.
  static constexpr int kRounds = 4;

  SceneAt at(double share) const;

  std::span<const SceneAt> instants_;
  double readout_share_;
  int height_;
};

}  // namespace alight
