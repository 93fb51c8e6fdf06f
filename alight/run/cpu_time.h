#pragma once
#include <ctime>

namespace alight {

/// CPU time of this thread, us: unlike the clock's, it does not depend on who else
/// runs.
inline double thread_cpu_us() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) +
         1e-3 * static_cast<double>(now.tv_nsec);
}

}  // namespace alight
