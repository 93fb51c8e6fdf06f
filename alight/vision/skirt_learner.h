#pragma once
#include "alight/vision/spot_fit.h"

namespace alight {

/// Learns how high and how wide the skirts of lights are from many looks at them, each
/// of which tells little.
class SkirtLearner {
 public:
  static constexpr int kMemory = 60;  ///< looks; older ones count less and less

  /// Moves the skirt of `spread`, with which the look was taken.
  void add(const SkirtLook& look, PointSpread& spread);

  /// So many looks have told of it that the next hardly matters.
  bool settled() const { return looks_ >= kMemory; }

 private:
  int looks_ = 0;
  Matrix2 information_ = Matrix2::Zero();  // on the height and the log of the variance
  double usual_ = 0;                       // of the latter
};

}  // namespace alight
