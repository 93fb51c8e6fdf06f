#pragma once
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "alight/base/result.h"

namespace alight {

/// Stops the fuzzer at this input.
inline void require(bool holds, const std::string& what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: %s\n", what.c_str());
  std::abort();
}

/// What is refused is refused in words for a person, which name the file.
inline void require_told(const Error& error, const std::string& path) {
  require(error.detail.find(path) != std::string::npos, "unnamed: " + error.detail);
}

/// A folder of this process, for readers that take a path.
inline const std::string& scratch_folder() {
  static const std::string folder = [] {
    const auto path = std::filesystem::temp_directory_path() /
                      ("alight_fuzz_" + std::to_string(getpid()));
    std::filesystem::create_directories(path);
    return path.string();
  }();
  return folder;
}

/// The bytes as the file of this name in it.
inline std::string input_file(const std::string& name, const void* data,
                              std::size_t size) {
  std::string path = scratch_folder() + "/" + name;
  std::FILE* file = std::fopen(path.c_str(), "wb");
  require(file != nullptr, path + " cannot be written");
  require(std::fwrite(data, 1, size, file) == size, path + " is not written");
  std::fclose(file);
  return path;
}

}  // namespace alight
