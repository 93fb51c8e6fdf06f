#pragma once
#include "alight/base/time.h"
#include "alight/estimation/motion_model.h"

namespace alight {

/// What moves the drone between pictures. Asked for times in any order.
class MotionSource {
 public:
  virtual ~MotionSource() = default;
  virtual PredictionInput at(Time t, const RelativeState& x) const = 0;
};

/// Nothing known: hover, platform at rest.
class NoMotion final : public MotionSource {
 public:
  PredictionInput at(Time t, const RelativeState& x) const override;
};

}  // namespace alight
