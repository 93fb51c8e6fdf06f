#pragma once
#include "alight/base/time.h"

namespace alight {

/// When row `v_px` of a picture is exposed (its middle), after the picture's time: a
/// rolling shutter reads rows one after the other, `readout` s from the first to the
/// last, and a picture's time is that of the row in the middle.
inline Seconds row_delay(double v_px, int height_px, Seconds readout) {
  return readout * (v_px / (height_px - 1) - 0.5);
}

}  // namespace alight
