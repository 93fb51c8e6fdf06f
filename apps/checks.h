#pragma once
#include <CLI/CLI.hpp>
#include <string>

#include "alight/io/text.h"

/// Each value is a finite number; CLI11 alone takes "nan".
inline CLI::Validator finite() {
  return CLI::Validator(
      [](const std::string& text) -> std::string {
        double value = 0;
        if (alight::parse_number(text, value)) return {};
        return alight::quoted(text) + " is not a finite number";
      },
      "NUMBER");
}
