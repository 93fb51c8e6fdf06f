#pragma once
#include <cstddef>
#include <system_error>
#include <thread>
#include <vector>

namespace alight {

/// Does `work` on so many threads, this one among them, and waits for all. Each takes
/// its share from what they have in common: where the system gives fewer threads, they
/// do it all.
template <class Work>
void on_threads(std::size_t count, Work&& work) {
  std::vector<std::jthread> others;
  try {
    while (others.size() + 1 < count) others.emplace_back([&work] { work(); });
  } catch (const std::system_error&) {
  }
  work();
}

}  // namespace alight
