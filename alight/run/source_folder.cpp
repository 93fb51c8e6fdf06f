#include "alight/run/source_folder.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "alight/io/files.h"

namespace alight {
namespace {

namespace fs = std::filesystem;

/// "color_000012.png", "frame_00012.jpg"
bool is_picture(const std::string& name) {
  const std::size_t line = name.find('_'), dot = name.find('.');
  if (line == std::string::npos || dot == std::string::npos || dot <= line + 1) {
    return false;
  }
  const std::string_view kind(name.data(), line), end(name.data() + dot);
  const bool ours = kind == "color" || kind == "depth" || kind == "frame";
  return ours && (end == ".png" || end == ".jpg") &&
         std::all_of(name.begin() + static_cast<std::ptrdiff_t>(line) + 1,
                     name.begin() + static_cast<std::ptrdiff_t>(dot),
                     [](unsigned char c) { return std::isdigit(c) != 0; });
}

Result<void> take_away(const fs::path& path) {
  std::error_code code;
  fs::remove(path, code);
  if (!code) return {};
  return fail(Fault::io, path.string() + ": cannot be replaced: " + code.message());
}

}  // namespace

Result<void> begin_source(const std::string& folder) {
  if (auto good = make_folder(folder); !good) return good;
  const bool ours = find_file(folder + "/rig_true.yaml").has_value();
  for (const char* name : {"frames.csv", "sequence.json", "truth.csv", "truth.tum",
                           "rig.yaml", "rig_true.yaml", "scenario.yaml"}) {
    if (auto good = take_away(fs::path(folder) / name); !good) return good;
  }
  if (!ours) return {};
  std::error_code code;
  std::vector<fs::path> pictures;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, code)) {
    if (is_picture(entry.path().filename().string())) pictures.push_back(entry.path());
  }
  if (code) return fail(Fault::io, folder + ": cannot be read: " + code.message());
  for (const fs::path& picture : pictures) {
    if (auto good = take_away(picture); !good) return good;
  }
  return {};
}

}  // namespace alight
