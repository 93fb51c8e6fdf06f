#pragma once
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace alight {

/// A folder that lives as long as the test.
class Scratch : public testing::Test {
 protected:
  Scratch()
      : folder_(std::filesystem::temp_directory_path() /
                ("alight_io_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(folder_);
  }
  ~Scratch() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::string file(const std::string& name, const std::string& text) const {
    const std::filesystem::path target = folder_ / name;
    std::filesystem::create_directories(target.parent_path());
    std::ofstream(target, std::ios::binary) << text;
    return target.string();
  }
  int entries() const {
    int count = 0;
    for ([[maybe_unused]] const auto& e :
         std::filesystem::directory_iterator(folder_)) {
      ++count;
    }
    return count;
  }

 private:
  std::filesystem::path folder_;
};

}  // namespace alight
