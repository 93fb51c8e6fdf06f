#pragma once
#include <algorithm>

namespace alight {

/// The middle value of [first, last), of two the larger; changes their order.
/// @pre not empty
template <class Iterator>
auto median(Iterator first, Iterator last) {
  const auto middle = first + (last - first) / 2;
  std::nth_element(first, middle, last);
  return *middle;
}

}  // namespace alight
