#pragma once
#include <algorithm>
#include <array>
#include <chrono>
#include <vector>

#include "alight/mission/landing_io.h"

namespace alight {

/// Times the stages of every step by the machine's clock.
class TimingProbe final : public Probe {
 public:
  void begin(Stage stage) override { of(stage).start = Clock::now(); }
  void end(Stage stage) override {
    const std::chrono::duration<double, std::micro> took =
        Clock::now() - of(stage).start;
    of(stage).us.push_back(took.count());
  }
  const std::vector<double>& us(Stage stage) const {
    return stages_[static_cast<std::size_t>(stage)].us;
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct One {
    Clock::time_point start;
    std::vector<double> us;
  };
  One& of(Stage stage) { return stages_[static_cast<std::size_t>(stage)]; }
  std::array<One, kStages> stages_;
};

}  // namespace alight
