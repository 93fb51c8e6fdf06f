#pragma once
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <mutex>
#include <string>

namespace alight {

/// Holds standard error while it lives: libraries talk there of damage that is told
/// here in one line. `said` has what came.
class HeldStandardError {
 public:
  HeldStandardError() : lock_(mutex()), held_(memfd_create("held", MFD_CLOEXEC)) {
    std::fflush(stderr);
    saved_ = held_ < 0 ? -1 : fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0);
    if (saved_ >= 0) dup2(held_, STDERR_FILENO);
  }
  ~HeldStandardError() {
    release();
    if (held_ >= 0) close(held_);
  }
  HeldStandardError(const HeldStandardError&) = delete;
  HeldStandardError& operator=(const HeldStandardError&) = delete;

  std::string said() {
    release();
    std::string text(512, '\0');
    const ssize_t size = held_ < 0 ? 0 : pread(held_, text.data(), text.size(), 0);
    text.resize(static_cast<std::size_t>(std::max<ssize_t>(0, size)));
    return text;
  }

 private:
  static std::mutex& mutex() {
    static std::mutex one;
    return one;
  }
  void release() {
    if (saved_ < 0) return;
    std::fflush(stderr);
    dup2(saved_, STDERR_FILENO);
    close(saved_);
    saved_ = -1;
  }

  std::lock_guard<std::mutex> lock_;
  int held_ = -1;
  int saved_ = -1;
};

}  // namespace alight
