#pragma once
#include <memory>

#include "alight/base/result.h"
#include "alight/mission/landing_config.h"
#include "alight/mission/landing_io.h"

namespace alight {

/// The brain: everything between what the platform's sensors say and what the autopilot
/// is told.
///
/// `step` is called at a fixed rate (100 Hz by default) with the events that arrived
/// since the last call. It has no clock, thread, file, socket or chance: the same calls
/// give the same bits, live, simulated or replayed. It allocates nothing.
///
///   detect, find or follow -> filter -> guard -> mission -> control
class LandingSystem {
 public:
  /// invalid_config, naming the field.
  static Result<LandingSystem> create(const LandingConfig& config, const Rig& rig);
  LandingSystem(LandingSystem&&) noexcept;
  LandingSystem& operator=(LandingSystem&&) noexcept;
  ~LandingSystem();

  /// An `input.now` that is not later than the last changes nothing and is counted in
  /// `trace.events_refused`, as is every event that is too old, not finite, of the
  /// future or out of order.
  void step(const Input& input, Output& output, Probe* probe = nullptr);

 private:
  struct Parts;
  explicit LandingSystem(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace alight
