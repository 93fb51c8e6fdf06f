#pragma once
#include <string>
#include <string_view>

#include "alight/base/result.h"

namespace alight {

/// Whether there is a file to read. io: "FILE: no such file", "FILE: is a folder", ...
Result<void> find_file(const std::string& path);

/// The bytes of a file; io, as of `find_file`.
Result<std::string> read_file(const std::string& path);

/// Writes beside `path` and renames, so that nobody ever sees half a file under its
/// name. Missing folders are made. io when the disk or the rights refuse.
Result<void> write_file(const std::string& path, std::string_view bytes);

/// Whether a folder is there, or could be made, and files written in it; makes nothing.
/// io: "PATH: is a file, a folder is needed", ...
Result<void> check_folder(const std::string& path);

/// Whether a file of this name could be written; makes nothing. For work that takes
/// long before it writes.
Result<void> check_file(const std::string& path);

/// Makes a folder and its parents; an existing one is fine.
Result<void> make_folder(const std::string& path);

}  // namespace alight
