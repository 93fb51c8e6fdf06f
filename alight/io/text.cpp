#include "alight/io/text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace alight {
namespace {

/// Damerau's distance with swaps of neighbours (optimal string alignment).
std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1,
                                          std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = a[i - 1] == b[j - 1] ? 0 : 1;
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + change});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[a.size()][b.size()];
}

/// "speed" for "speed_m_s": a word left without its unit, or given a wrong one.
bool same_stem(std::string_view a, std::string_view b) {
  const std::size_t n = std::min(a.size(), b.size());
  return n >= 4 && a.substr(0, n) == b.substr(0, n) && (a.size() == n || a[n] == '_') &&
         (b.size() == n || b[n] == '_');
}

}  // namespace

std::string nearest_key(std::string_view word, const std::vector<std::string>& known) {
  const std::string* best = nullptr;
  std::size_t best_edits = 0;
  for (const std::string& key : known) {
    std::size_t cost = edits(word, key);
    if (same_stem(word, key)) cost = std::min<std::size_t>(cost, 2);
    const std::size_t limit =
        std::max<std::size_t>(2, std::max(word.size(), key.size()) / 3);
    if (cost > limit || cost >= std::max(word.size(), key.size())) continue;
    if (best && cost >= best_edits) continue;
    best = &key;
    best_edits = cost;
  }
  return best ? *best : std::string();
}

std::string not_one_of(std::string_view word, const std::vector<std::string>& known) {
  std::string what = quoted(word) + " is not one of";
  for (const std::string& w : known) what += " " + w;
  const std::string near = nearest_key(word, known);
  if (!near.empty()) what += "; did you mean " + quoted(near) + "?";
  return what;
}

std::string number_text(double value) {
  if (std::isnan(value)) return ".nan";
  if (std::isinf(value)) return value > 0 ? ".inf" : "-.inf";
  char buffer[40];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value);
  return std::string(buffer, end.ptr);
}

std::string fixed_text(double value, int digits) {
  if (!std::isfinite(value)) return "-";
  std::array<char, 400> room;  // the longest double has 309 digits before the point
  const auto end = std::to_chars(room.data(), room.data() + room.size(), value,
                                 std::chars_format::fixed, std::clamp(digits, 0, 20));
  return std::string(room.data(), end.ptr);
}

bool parse_number(std::string_view text, double& value) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  double read = 0;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), read);
  if (end.ec != std::errc() || end.ptr != text.data() + text.size()) return false;
  if (text.empty() || !std::isfinite(read)) return false;
  value = read;
  return true;
}

bool parse_time(std::string_view text, Time& t) {
  constexpr double kLatest_s = 4e9;
  double seconds = 0;
  if (!parse_number(text, seconds) || std::abs(seconds) > kLatest_s) return false;
  const std::size_t point = text.find('.');
  const std::string_view whole = text.substr(0, point);
  const bool plain =
      !whole.empty() && text.find_first_not_of("0123456789.") == std::string_view::npos;
  if (!plain || whole.size() > 10) {  // signs, exponents, zeros in front
    t = from_seconds(seconds);
    return true;
  }
  const std::string_view part =
      point == std::string_view::npos ? std::string_view() : text.substr(point + 1);
  t = 0;
  for (const char c : whole) t = t * 10 + (c - '0');
  for (std::size_t i = 0; i < 9; ++i)
    t = t * 10 + (i < part.size() ? part[i] - '0' : 0);
  if (part.size() > 9 && part[9] >= '5') ++t;
  return true;
}

std::string quoted(std::string_view text) {
  // Appended, as gcc 12 sees an overlap in operator+ that is not there.
  std::string result(1, '\'');
  result.append(text);
  result += '\'';
  return result;
}

std::string_view trimmed(std::string_view text) {
  const char* blank = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(blank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(blank) - begin + 1);
}

std::string_view without_byte_order_mark(std::string_view text) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  return text.substr(0, kMark.size()) == kMark ? text.substr(kMark.size()) : text;
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> fields;
  while (true) {
    const std::size_t end = text.find(separator);
    fields.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return fields;
    text.remove_prefix(end + 1);
  }
}

}  // namespace alight
