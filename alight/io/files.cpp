#include "alight/io/files.h"

#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace alight {
namespace fs = std::filesystem;

Result<void> find_file(const std::string& path) {
  std::error_code code;
  const fs::file_status status = fs::status(path, code);
  if (status.type() == fs::file_type::not_found) {
    return fail(Fault::io, (path.empty() ? "''" : path) + ": no such file");
  }
  if (code) return fail(Fault::io, path + ": " + code.message());
  if (fs::is_directory(status)) {
    return fail(Fault::io, path + ": is a folder, a file is needed");
  }
  if (fs::is_block_file(status) || fs::is_character_file(status)) {
    return fail(Fault::io, path + ": is a device, a file is needed");
  }
  return {};
}

Result<std::string> read_file(const std::string& path) {
  if (auto there = find_file(path); !there) return fail(there.error());
  std::ifstream in(path, std::ios::binary);
  std::ostringstream bytes;
  if (in && in.peek() != std::ifstream::traits_type::eof()) bytes << in.rdbuf();
  if (in.bad() || !in.is_open()) return fail(Fault::io, path + ": cannot be read");
  return bytes.str();
}

Result<void> write_file(const std::string& path, std::string_view bytes) {
  const fs::path target(path);
  if (target.has_parent_path()) {
    if (auto made = make_folder(target.parent_path().string()); !made) return made;
  }
  // Two writers of one file must not share the temporary one.
  static std::atomic<unsigned> serial{0};
  const std::string temporary = path + ".part" + std::to_string(getpid()) + "." +
                                std::to_string(serial.fetch_add(1));
  std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out.close();
  std::error_code code;
  if (out) fs::rename(temporary, target, code);
  if (!out || code) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    return fail(Fault::io, path + ": cannot be written" +
                               (code ? ": " + code.message() : std::string()));
  }
  return {};
}

Result<void> check_folder(const std::string& path) {
  std::error_code code;
  fs::path place = fs::absolute(path, code).lexically_normal();
  while (!fs::exists(place, code) && place.has_relative_path()) {
    // Not that it is missing: the name is too long, a link leads in a circle.
    if (code) return fail(Fault::io, place.string() + ": " + code.message());
    place = place.parent_path();
  }
  if (!fs::is_directory(place, code)) {
    return fail(Fault::io, place.string() + ": is a file, a folder is needed");
  }
  if (access(place.c_str(), W_OK | X_OK) != 0) {
    return fail(Fault::io, place.string() + ": nothing may be written there");
  }
  return {};
}

Result<void> check_file(const std::string& path) {
  std::error_code code;
  const fs::file_status status = fs::status(path, code);
  if (fs::is_directory(status)) {
    return fail(Fault::io, path + ": is a folder, a file is needed");
  }
  if (!fs::status_known(status)) return fail(Fault::io, path + ": " + code.message());
  const fs::path folder = fs::path(path).parent_path();
  return check_folder(folder.empty() ? "." : folder.string());
}

Result<void> make_folder(const std::string& path) {
  std::error_code code, unseen;
  fs::create_directories(path, code);
  if (!fs::is_directory(path, unseen)) {
    return fail(Fault::io, path + ": cannot be made a folder" +
                               (code ? ": " + code.message() : std::string()));
  }
  return {};
}

}  // namespace alight
