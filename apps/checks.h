#pragma once
#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdint>
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

/// A number within these bounds, ends included.
inline CLI::Validator within(double low, double high) {
  const std::string bounds =
      "[" + alight::number_text(low) + ", " + alight::number_text(high) + "]";
  return CLI::Validator(
      [=](const std::string& text) -> std::string {
        double value = 0;
        if (alight::parse_number(text, value) && value >= low && value <= high) {
          return {};
        }
        return alight::quoted(text) + " is no number in " + bounds;
      },
      "in " + bounds);
}

/// A whole number of so many bits; CLI11 alone takes hexadecimal ones and clips.
inline CLI::Validator seed_number(int bits = 63) {
  return CLI::Validator(
      [bits](const std::string& text) -> std::string {
        std::int64_t value = 0;
        const char* const end = text.data() + text.size();
        const auto read = std::from_chars(text.data(), end, value);
        const bool whole = read.ec == std::errc() && read.ptr == end && value >= 0;
        if (whole && (value >> (bits - 1)) <= 1) return {};
        return alight::quoted(text) + " is not a whole number from 0 to 2^" +
               std::to_string(bits) + " - 1";
      },
      "NUMBER");
}

/// A folder or file needs a name.
inline CLI::Validator named() {
  return CLI::Validator(
      [](const std::string& text) -> std::string {
        return text.empty() ? "the name is empty" : "";
      },
      "NAME");
}
