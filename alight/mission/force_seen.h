#pragma once
#include <optional>

#include "alight/base/fixed_vector.h"
#include "alight/base/time.h"
#include "alight/geometry/pose.h"

namespace alight {

/// What pushes a drone, as its way shows: the mean of its acceleration over the last
/// 0.6 s less gravity, in an N that neither turns nor accelerates. Rotors push along z
/// of B only; of two readings of the same lights, the one that has the drone lean
/// otherwise than it flies is wrong.
///
/// No allocation.
class ForceSeen {
 public:
  void clear() { samples_.clear(); }

  /// Where it was seen, one picture after the other. What comes after a gap, or turned
  /// or moved as no drone does, begins anew.
  void add(Time t, const Pose& X_NB);

  /// The part of it across z of A, m/s^2, A being turned by R_BA against the B that was
  /// added. Nothing until it has been seen for long enough.
  std::optional<double> across(const Matrix3& R_BA) const;

 private:
  struct Sample {
    Time t = 0;
    Pose X_NB = Pose::Identity();
  };
  static constexpr std::size_t kSamples =
      7;  // the first, the middle and the last count
  FixedVector<Sample, kSamples> samples_;
};

}  // namespace alight
