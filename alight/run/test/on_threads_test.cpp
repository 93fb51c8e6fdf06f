#include "alight/run/on_threads.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <fstream>

namespace alight {
namespace {

TEST(OnThreads, AsManyAsAskedFor) {
  for (const std::size_t count : {std::size_t{1}, std::size_t{5}}) {
    std::atomic<std::size_t> ran{0};
    on_threads(count, [&] { ++ran; });
    EXPECT_EQ(ran, count);
  }
}

/// In a process of its own, whose room ends long before the threads do.
TEST(OnThreads, FewerWhenTheSystemGivesNoMore) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer needs more room";
#endif
  const auto starved = [] {
    // A thread's stack takes some MB.
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const rlim_t most =
        pages * static_cast<std::size_t>(getpagesize()) + (rlim_t{1} << 28);
    const rlimit room{most, most};
    if (setrlimit(RLIMIT_AS, &room) != 0) std::exit(2);
    const auto here = std::this_thread::get_id();
    std::atomic<bool> all_there{false};
    std::atomic<int> ran{0};
    on_threads(1000, [&] {
      if (std::this_thread::get_id() == here) {
        all_there = true;
        all_there.notify_all();
      }
      all_there.wait(false);
      ++ran;
    });
    std::exit(ran > 1 && ran < 1000 ? 0 : 1);
  };
  // Started anew: a fork of this one has what earlier tests left of their threads.
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(starved(), testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace alight
