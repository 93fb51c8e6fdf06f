#pragma once
#include <optional>

#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/platform_state.h"
#include "alight/platform/ugv_controller.h"
#include "alight/sim/recorded_drive.h"
#include "alight/sim/scenario.h"

namespace alight {

/// How the platform truly moves: a UGV on its path (without slip), or a boat that
/// heaves, rolls and pitches on a straight course, or a drive that was recorded.
class PlatformMotion {
 public:
  /// `height` of the pad above the floor, m; a recorded drive brings its own.
  /// @pre A recorded drive holds (RecordedDrive::create).
  PlatformMotion(const PlatformScenario& config, double height, bool moving, Rng rng);

  void start() { moving_ = true; }
  /// At most the scenario's speed. A recorded drive takes no wishes.
  void wish_speed(double m_s);

  /// Advances by `dt` s.
  void step(Seconds dt);

  const PlatformState& state() const { return state_; }

 private:
  struct Deck {
    double heave, roll, pitch;
  };
  Deck deck(double t_s) const;
  void step_boat(Seconds dt);
  void step_recorded(Seconds dt);

  PlatformScenario config_;
  double height_;
  bool moving_;
  double wish_;
  PlatformState state_;
  Path path_;
  UgvController controller_;
  UgvPose pose_;
  UgvCommand command_;
  std::optional<RecordedDrive> drive_;
  Seconds driven_ = 0;  ///< s into it
  double phase_[3] = {0, 0, 0};
};

}  // namespace alight
