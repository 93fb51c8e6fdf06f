#pragma once
#include <cmath>

namespace alight {

/// Weight of a residual, given the square of its normalized length, by Huber's loss
/// (Huber 1964): 1 within `limit`, falling with the length beyond; `limit` 0: always 1.
inline double huber_weight(double squared, double limit) {
  if (limit <= 0 || squared <= limit * limit) return 1;
  return limit / std::sqrt(squared);
}

}  // namespace alight
