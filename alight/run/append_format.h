#pragma once
#include <cstdarg>
#include <cstdio>
#include <string>

namespace alight {

/// printf onto the end of a text; a line longer than 511 characters is cut.
[[gnu::format(printf, 2, 3)]] inline void append_format(std::string& text,
                                                        const char* format, ...) {
  char line[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  text += line;
}

}  // namespace alight
