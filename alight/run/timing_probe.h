#pragma once
#include <array>
#include <vector>

#include "alight/mission/landing_io.h"
#include "alight/run/cpu_time.h"

namespace alight {

/// Times the stages of every step by the CPU time of the thread that calls.
class TimingProbe final : public Probe {
 public:
  void begin(Stage stage) override { of(stage).start_us = thread_cpu_us(); }
  void end(Stage stage) override {
    of(stage).us.push_back(thread_cpu_us() - of(stage).start_us);
  }
  const std::vector<double>& us(Stage stage) const {
    return stages_[static_cast<std::size_t>(stage)].us;
  }

 private:
  struct One {
    double start_us = 0;
    std::vector<double> us;
  };
  One& of(Stage stage) { return stages_[static_cast<std::size_t>(stage)]; }
  std::array<One, kStages> stages_;
};

}  // namespace alight
