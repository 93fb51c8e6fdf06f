#pragma once
#include "alight/base/fixed_vector.h"
#include "alight/sim/scene.h"
#include "alight/sim/world.h"

namespace alight {

/// Turns touches into what a judge of the landing wants to know (ContactReport).
class ContactWatch {
 public:
  ContactWatch(const DroneSpec& drone, const PadSpec& pad);

  /// After each physics step. `before` is the truth at its begin: a landing is judged
  /// by the motion that met the pad, not by what the contact left of it.
  void step(const FixedVector<Touch, 32>& touches, const TruthState& before,
            const TruthState& now, const Matrix3& R_FB);

  const ContactReport& report() const { return report_; }
  bool standing_on_pad(const TruthState& now) const;

 private:
  void strike(const char* what, Time t);

  DroneSpec drone_;
  PadSpec pad_;
  ContactReport report_;
  Matrix3 R_FB_ = Matrix3::Identity();
  std::array<Time, 4> foot_on_pad_;  ///< Last touch of each.
  std::array<Time, 4> foot_on_floor_;
  Time last_touch_ = 0;
};

}  // namespace alight
