#pragma once
#include <initializer_list>
#include <sstream>
#include <string>
#include <string_view>

#include "alight/base/result.h"

namespace alight {

/// A setting, by the name its file gives it, and where it must lie, ends included.
struct Bound {
  std::string_view name;
  double value, low, high;
};

/// "NAME is VALUE, must lie in [LOW, HIGH]"; empty when it does. NaN lies nowhere.
inline std::string complaint_about(const Bound& b) {
  if (b.value >= b.low && b.value <= b.high) return {};
  std::ostringstream text;
  text << b.name << " is " << b.value << ", must lie in [" << b.low << ", " << b.high
       << "]";
  return text.str();
}

/// invalid_config with the complaint about the first bound that does not hold.
inline Result<void> check_bounds(std::initializer_list<Bound> bounds) {
  for (const Bound& b : bounds) {
    if (std::string text = complaint_about(b); !text.empty()) {
      return fail(Fault::invalid_config, std::move(text));
    }
  }
  return {};
}

/// Conditions one after the other; the first complaint is kept.
class FirstComplaint {
 public:
  void range(std::string_view name, double value, double low, double high) {
    if (text_.empty()) text_ = complaint_about({name, value, low, high});
  }
  void that(bool holds, std::string_view complaint) {
    if (text_.empty() && !holds) text_ = complaint;
  }
  Result<void> result() const {
    if (text_.empty()) return {};
    return fail(Fault::invalid_config, text_);
  }

 private:
  std::string text_;
};

}  // namespace alight
