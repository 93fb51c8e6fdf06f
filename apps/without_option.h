#pragma once
#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

#include "alight/mission/ablation.h"

/// `--without PART`, repeatable.
inline void add_without(CLI::App& command, std::vector<alight::Part>& parts) {
  std::map<std::string, alight::Part> named;
  for (const alight::Part part : alight::kParts) named[alight::to_string(part)] = part;
  std::vector<std::string> names;
  for (const auto& [name, part] : named) names.push_back(name);
  command
      .add_option_function<std::vector<std::string>>(
          "--without",
          [&parts, named](const std::vector<std::string>& chosen) {
            for (const std::string& name : chosen) parts.push_back(named.at(name));
          },
          "Leave a part of the default profile out, to measure what it buys; "
          "repeatable")
      ->check(CLI::IsMember(names))
      ->excludes("--profile");
}
