#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "alight/base/time.h"

namespace alight {

/// The word of `known` with the fewest edits from `word` (insert, delete, replace, swap
/// of neighbours); empty when none is close enough to be a slip of the keyboard.
std::string nearest_key(std::string_view word, const std::vector<std::string>& known);

/// "'WORD' is not one of A B C; did you mean 'B'?", the last part where one is close.
std::string not_one_of(std::string_view word, const std::vector<std::string>& known);

/// Shortest decimal that reads back as the same double: 0.1, 415.872, 1e-09.
std::string number_text(double value);

/// With so many digits after the point; "-" for what is no finite number.
std::string fixed_text(double value, int digits);

/// The whole of `text` as a finite number; false for anything else ("1.2x", "nan", "").
bool parse_number(std::string_view text, double& value);

/// Decimal seconds to the nearest nanosecond, digit by digit, so that times since 1970
/// keep their last ones. False for what is no number, and beyond 4e9 s either way:
/// differences of times then still fit, and a stamp in ms or us is told.
bool parse_time(std::string_view text, Time& t);

/// 'text'
std::string quoted(std::string_view text);

std::string_view trimmed(std::string_view text);

/// Without the mark (U+FEFF) that some editors put before UTF-8.
std::string_view without_byte_order_mark(std::string_view text);

/// Fields between `separator`; "a,b," has three, the last empty.
std::vector<std::string_view> split(std::string_view text, char separator);

}  // namespace alight
