#pragma once
#include <string>

namespace alight {

/// A nlohmann document as text. A file's name may hold any bytes, JSON only UTF-8: what
/// is none is replaced, where `dump` alone would throw.
template <class Json>
std::string json_text(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace alight
